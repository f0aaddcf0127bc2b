/* attach.c: pins that a host gives to colliders to carry, and lets go; what becomes of such pins when
 * cloth or colliders are placed elsewhere, and when a sim goes on with another model. */
#include "sim/attach.h"

#include "colliders/deformed.h"

#include <string.h>

/* The collider carries the node from where it is; triangle -1: as a whole. */
static void attach(const drape_sim *sim, int32_t node, int32_t collider, int32_t triangle, bool given)
{
    const drape_state *now = drape_sim_state(sim);
    drape_motion *motion = drape_system_steer(sim->system);
    drape_ride ride;
    drape_motion_ride_from(motion, collider, triangle, now->t, now->x + 3 * (size_t)node, &ride);
    ride.given = given;
    ride.since = now->t;
    drape_motion_take_ride(motion, node, &ride);
}

/* *out: the triangles (count) of a collider that carry these nodes from where they are, to be freed. */
static drape_status find_triangles(const drape_sim *sim, int32_t collider, int32_t count,
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
    attach(sim, node, ride.collider, ride.triangle, ride.given);
}

/* ---- For hosts ---- */

static drape_status check_triangles(const drape_sim *sim, int32_t collider, int32_t count,
                                    const int32_t *triangles)
{
    const drape_collider *c = &sim->model->colliders[collider];
    if (triangles && c->frames.frame_count == 0)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_attach: triangles, but %s is a %s, which is rigid and carries pins as a "
                          "whole",
                          c->name, c->ops->entry.name);
    for (int32_t i = 0; triangles && i < count; i++)
        if (triangles[i] < 0 || triangles[i] >= c->shape.triangle_count)
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                              "drape_sim_attach: triangle %d; %s has the triangles 0 to %d",
                              (int)triangles[i], c->name, (int)c->shape.triangle_count - 1);
    return DRAPE_OK;
}

static drape_status carry(drape_sim *sim, int32_t collider, int32_t count, const int32_t *nodes,
                          const int32_t *triangles)
{
    /* contact may need memory for its energy; a sim that was made for new pins has it */
    const drape_energy before = drape_sim_energy(sim);
    if (drape_system_status(sim->system) == DRAPE_E_MEMORY) {
        sim->energy_known = false;
        return DRAPE_E_MEMORY;
    }
    for (int32_t i = 0; i < count; i++)
        attach(sim, nodes[i], collider, triangles ? triangles[i] : -1, true);
    /* Pins move with their colliders at once. */
    const drape_motion *motion = drape_system_motion(sim->system);
    drape_state *now = &sim->states[sim->now];
    for (int32_t i = 0; i < count; i++)
        drape_motion_pin_velocity(motion, motion->place[nodes[i]], now->t, now->t,
                                  now->v + 3 * (size_t)nodes[i]);
    sim->chosen.integrator->restart(sim->integrator, now);
    drape_sim_shift_energy(sim, &before);
    return DRAPE_OK;
}

drape_status drape_sim_attach(drape_sim *sim, int32_t collider, int32_t count, const int32_t *nodes,
                              const int32_t *triangles)
{
    drape_status status = drape_sim_guard(sim, "drape_sim_attach");
    if (status)
        return status;
    if (collider < 0 || collider >= sim->model->collider_count)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_attach: collider %d; the model has %d",
                          (int)collider, (int)sim->model->collider_count);
    status = drape_sim_check_nodes(sim, "drape_sim_attach", count, nodes);
    if (!status)
        status = check_triangles(sim, collider, count, triangles);
    int32_t *nearest = NULL;
    if (!status && !triangles && sim->model->colliders[collider].frames.frame_count > 0)
        status = find_triangles(sim, collider, count, nodes, &nearest);
    if (!status)
        status = drape_sim_set_pins(sim, count, nodes, 1);
    if (!status)
        status = carry(sim, collider, count, nodes, nearest ? nearest : triangles);
    drape_free(sim->ctx, nearest);
    return status;
}

drape_status drape_sim_detach(drape_sim *sim, int32_t count, const int32_t *nodes)
{
    drape_status status = drape_sim_guard(sim, "drape_sim_detach");
    if (!status)
        status = drape_sim_check_nodes(sim, "drape_sim_detach", count, nodes);
    for (int32_t i = 0; !status && i < count; i++)
        if (drape_sim_carrier(sim, nodes[i]) < 0)
            status = drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                                "drape_sim_detach: no collider carries node %d, which is %s", (int)nodes[i],
                                sim->model->pinned[nodes[i]] ? "pinned otherwise" : "free");
    return status ? status : drape_sim_set_pins(sim, count, nodes, 0);
}

int32_t drape_sim_attached(const drape_sim *sim, int32_t node)
{
    return sim && node >= 0 && node < sim->model->node_count ? drape_sim_carrier(sim, node) : -1;
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
            attach(to, i, ride[i].collider, ride[i].triangle, false);
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
            status = find_triangles(to, c, count, join.nodes, &triangles);
        for (int32_t i = 0; !status && i < count; i++)
            attach(to, join.nodes[i], c, triangles[i], join.given[join.nodes[i]]);
        drape_free(to->ctx, triangles);
    }
    drape_arena_free(&scratch);
    return status;
}
