/* rides.c: see rides.h. */
#include "sim/rides.h"

#include "colliders/deformed.h"

#include <string.h>

void drape_sim_ride(const drape_sim *sim, int32_t node, int32_t collider, int32_t triangle, bool given)
{
    const drape_state *now = drape_sim_state(sim);
    drape_motion *motion = drape_system_steer(sim->system);
    drape_ride ride;
    drape_motion_ride_from(motion, collider, triangle, now->t, now->x + 3 * (size_t)node, &ride);
    ride.given = given;
    ride.since = now->t;
    drape_motion_take_ride(motion, node, &ride);
}

drape_status drape_sim_ride_triangles(const drape_sim *sim, int32_t collider, int32_t count,
                                      const int32_t *nodes, int32_t **out)
{
    const drape_state *now = drape_sim_state(sim);
    *out = drape_alloc(sim->ctx, (size_t)count + 1, sizeof **out);
    return *out ? drape_deformed_nearest(sim->ctx, drape_system_motion(sim->system), collider, now->t, count,
                                         nodes, now->x, *out)
                : DRAPE_E_MEMORY;
}

int32_t drape_sim_carrier(const drape_sim *sim, int32_t node)
{
    const drape_motion *motion = drape_system_motion(sim->system);
    return motion->place[node] < 0 ? -1 : drape_motion_carrier(motion, motion->place[node]);
}

void drape_sim_ride_on(drape_sim *sim, int32_t node)
{
    const drape_motion *motion = drape_system_motion(sim->system);
    const drape_ride ride = motion->ride[motion->place[node]];
    drape_sim_ride(sim, node, ride.collider, ride.triangle, ride.given);
}

/* ---- In another model ---- */

/* Whether a triangle of one collider is one of the other, too. */
static bool same_triangles(const drape_collider *a, const drape_collider *b)
{
    const int32_t count = a->shape.triangle_count;
    if (a->frames.frame_count == 0 || b->frames.frame_count == 0)
        return a->frames.frame_count == b->frames.frame_count;
    return count == b->shape.triangle_count &&
           memcmp(a->shape.triangle, b->shape.triangle, 3 * (size_t)count * sizeof *a->shape.triangle) == 0;
}

/* Pins of `to` that its colliders are to carry on triangles that are not known yet. */
typedef struct joining {
    int32_t *collider; /* (node_count) -1: none */
    bool *given;       /* (node_count) by the host, not by the scene */
    int32_t *nodes;    /* (node_count) workspace */
} joining;

/* Pins that went on with a ride, each on the collider of the same name. */
static void continue_rides(drape_sim *to, const drape_sim *from, const int32_t *before, joining *join)
{
    const drape_model *m = to->model;
    const drape_motion *motion = drape_system_motion(from->system);
    for (int32_t i = 0; i < motion->moved_count; i++) {
        const int32_t node = motion->moved_node[i], on = drape_motion_carrier(motion, i);
        drape_ride ride = motion->ride[i];
        int32_t c = 0;
        while (c < m->collider_count && before[c] != on)
            c++;
        if (on < 0 || c == m->collider_count || !m->pinned[node] ||
            !(ride.given || (m->ride && m->ride[node].collider == c)))
            continue;
        ride.collider = c;
        if (same_triangles(&m->colliders[c], &from->model->colliders[on])) {
            drape_motion_take_ride(drape_system_steer(to->system), node, &ride);
            continue;
        }
        join->collider[node] = c;
        join->given[node] = ride.given;
    }
}

/* Pins that the new scene attaches to another collider than the former one did, or newly. */
static void begin_rides(drape_sim *to, const drape_sim *from, const int32_t *before, joining *join)
{
    const drape_ride *ride = to->model->ride, *former = from->model->ride;
    for (int32_t i = 0; ride && i < to->model->node_count; i++) {
        if (ride[i].collider < 0 || !to->model->pinned[i] ||
            (former && former[i].collider >= 0 && before[ride[i].collider] == former[i].collider))
            continue;
        join->collider[i] = ride[i].triangle < 0 ? ride[i].collider : -1;
        join->given[i] = false;
        if (ride[i].triangle >= 0)
            drape_sim_ride(to, i, ride[i].collider, ride[i].triangle, false);
    }
}

drape_status drape_sim_continue_rides(drape_sim *to, const drape_sim *from, const int32_t *before)
{
    const size_t nodes = (size_t)to->model->node_count;
    drape_arena scratch = drape_arena_of(to->ctx);
    joining join = {drape_arena_take(&scratch, nodes, sizeof *join.collider),
                    drape_arena_take(&scratch, nodes, sizeof *join.given),
                    drape_arena_take(&scratch, nodes, sizeof *join.nodes)};
    drape_status status = drape_arena_status(&scratch);
    for (size_t i = 0; !status && i < nodes; i++)
        join.collider[i] = -1;
    if (!status)
        continue_rides(to, from, before, &join);
    if (!status && to->model->ride != from->model->ride)
        begin_rides(to, from, before, &join);
    for (int32_t c = 0; !status && c < to->model->collider_count; c++) {
        int32_t count = 0, *triangles = NULL;
        for (int32_t i = 0; i < to->model->node_count; i++)
            if (join.collider[i] == c)
                join.nodes[count++] = i;
        if (count > 0)
            status = drape_sim_ride_triangles(to, c, count, join.nodes, &triangles);
        for (int32_t i = 0; !status && i < count; i++)
            drape_sim_ride(to, join.nodes[i], c, triangles[i], join.given[join.nodes[i]]);
        drape_free(to->ctx, triangles);
    }
    drape_arena_free(&scratch);
    return status;
}
