/*
 * teleport.c: pins and colliders that a host sends or turns faster than teleport_speed. Cloth would be torn
 * after them for seconds; it is placed with them instead, by the rigid motion that fits its pins best in
 * the sense of least squares (Horn 1987, Closed-form solution of absolute orientation using unit
 * quaternions, J. Opt. Soc. Am. A 4, section 4), less the path that they would have covered at their own
 * velocity.
 */
#include "base/rotation.h"
#include "base/vec3.h"
#include "host/place.h"
#include "realtime/realtime.h"
#include "sim/rides.h"
#include "sparse/project.h"

#include <string.h>

/* Pins on a line, or a single pin, leave a rotation free: then the smallest one is chosen, since this share
 * of the spread of the pins counts against any rotation. It changes a rotation that is not free by no more
 * than that [rad]. */
#define REST 1e-6

/* ---- The best rigid motion ---- */

/* Of the pins of a cloth: where they are, and where they are to be. */
typedef struct pins {
    const drape_model *model;
    const drape_cloth *cloth;
    const double *from, *to; /* (node_count x 3) */
} pins;

static void mean_of(const pins *p, const double *x, double mean[3])
{
    int32_t count = 0;
    memset(mean, 0, 3 * sizeof *mean);
    for (int32_t i = 0; i < p->cloth->mesh.node_count; i++) {
        const int32_t node = p->cloth->first_node + i;
        if (!p->model->pinned[node])
            continue;
        count++;
        vec3_add_scaled(1, x + 3 * (size_t)node, mean);
    }
    for (int k = 0; k < 3; k++)
        mean[k] /= count;
}

/* S[3 a + b] = sum of (from - its mean)_a (to - its mean)_b; returns the spread of both. */
static double correlate(const pins *p, const double *from, const double *to, double S[9])
{
    double spread = 0;
    memset(S, 0, 9 * sizeof *S);
    for (int32_t i = 0; i < p->cloth->mesh.node_count; i++) {
        const size_t node = (size_t)(p->cloth->first_node + i);
        double a[3], b[3];
        if (!p->model->pinned[node])
            continue;
        vec3_sub(p->from + 3 * node, from, a);
        vec3_sub(p->to + 3 * node, to, b);
        for (int k = 0; k < 9; k++)
            S[k] += a[k / 3] * b[k % 3];
        spread += (vec3_dot(a, a) + vec3_dot(b, b)) / 2;
    }
    return spread;
}

static drape_placement fit(const pins *p)
{
    drape_placement by = {.given = true, .turn = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    double from[3], to[3], turned[3], S[9], q[4];
    mean_of(p, p->from, from);
    mean_of(p, p->to, to);
    const double spread = correlate(p, from, to, S);
    if (spread > 0) {
        /* The unit quaternion q that makes q' N q largest, for Horn's matrix N of the products S. */
        const double xx = S[0], xy = S[1], xz = S[2], yx = S[3], yy = S[4], yz = S[5], zx = S[6], zy = S[7],
                     zz = S[8];
        const double rest = REST * spread;
        double N[16] = {xx + yy + zz + rest, yz - zy, zx - xz, xy - yx, yz - zy,
                        xx - yy - zz,        xy + yx, zx + xz, zx - xz, xy + yx,
                        -xx + yy - zz,       yz + zy, xy - yx, zx + xz, yz + zy,
                        -xx - yy + zz};
        double v[16];
        int best = 0;
        drape_diagonalise(4, N, v);
        for (int i = 1; i < 4; i++)
            best = N[5 * i] > N[5 * best] ? i : best;
        for (int i = 0; i < 4; i++)
            q[i] = v[4 * i + best];
        drape_rotation_of_quaternion(q, by.turn);
    }
    drape_placement_turn(&by, from, turned);
    vec3_sub(to, turned, by.shift);
    return by;
}

/* ---- Pins ---- */

static bool is_in(const drape_cloth *cloth, int32_t node)
{
    return node >= cloth->first_node && node < cloth->first_node + cloth->mesh.node_count;
}

/* The targets of all pins after `seconds`: those that are not sent follow their motion. */
static const double *targets(drape_sim *sim, int32_t count, const int32_t *nodes, double seconds,
                             const double *positions)
{
    const drape_state *now = drape_sim_state(sim);
    double *to = sim->query_scratch;
    memcpy(to, now->x, 3 * (size_t)sim->model->node_count * sizeof *to);
    drape_motion_place_pins(drape_system_motion(sim->system), now->t + seconds, to);
    for (int32_t i = 0; i < count; i++)
        memcpy(to + 3 * (size_t)nodes[i], positions + 3 * (size_t)i, 3 * sizeof *to);
    return to;
}

/* The mean velocity of the sent pins of a cloth on arrival; if the host gives none, they keep their present
 * one. */
static void mean_velocity(const drape_sim *sim, const drape_cloth *cloth, int32_t count, const int32_t *nodes,
                          const double *velocities, const drape_placement *by, double mean[3])
{
    int32_t sent = 0;
    memset(mean, 0, 3 * sizeof *mean);
    for (int32_t i = 0; i < count; i++) {
        double v[3];
        if (!is_in(cloth, nodes[i]))
            continue;
        if (velocities)
            memcpy(v, velocities + 3 * (size_t)i, sizeof v);
        else
            drape_motion_pin_arrival(drape_system_motion(sim->system), nodes[i], drape_sim_state(sim)->t, v);
        if (!velocities)
            drape_placement_turn(by, v, v);
        vec3_add_scaled(1, v, mean);
        sent++;
    }
    for (int k = 0; k < 3; k++)
        mean[k] /= sent;
}

/* All placements are checked before any cloth is placed, so that after an error nothing has changed. The
 * placement of a cloth does not depend on the other cloths. */
drape_status drape_teleport_pins(drape_sim *sim, int32_t count, const int32_t *nodes, double seconds,
                                 const double *positions, const double *velocities)
{
    const drape_model *m = sim->model;
    const drape_place_list none = {NULL, 0};
    drape_status status = DRAPE_OK;
    for (int32_t i = 0; i < 2 * m->cloth_count && !status; i++) {
        const bool checks = i < m->cloth_count;
        const int32_t c = i % m->cloth_count;
        const drape_place_list one = {&c, 1};
        double v[3];
        const double *x = drape_sim_state(sim)->x;
        bool fast = false;
        for (int32_t k = 0; sim->teleport_speed > 0 && k < count && !fast; k++) {
            double path[3];
            if (!is_in(&m->cloths[c], nodes[k]))
                continue;
            vec3_sub(positions + 3 * (size_t)k, x + 3 * (size_t)nodes[k], path);
            fast = vec3_norm(path) > sim->teleport_speed * seconds;
        }
        if (!fast)
            continue;
        const pins p = {.model = m,
                        .cloth = &m->cloths[c],
                        .from = x,
                        .to = targets(sim, count, nodes, seconds, positions)};
        drape_placement by = fit(&p);
        mean_velocity(sim, p.cloth, count, nodes, velocities, &by, v);
        vec3_add_scaled(-seconds, v, by.shift);
        status = checks ? drape_sim_check_place(sim, &one, &none, &by)
                        : drape_sim_place_parts(sim, &one, &none, &by, false);
        if (!checks && !status)
            drape_log(sim->ctx, DRAPE_LOG_INFO,
                      "t=%.9g: pins of %s are sent faster than %.4g m/s: it is placed there",
                      drape_sim_state(sim)->t, p.cloth->name, sim->teleport_speed);
    }
    return status;
}

/* ---- Colliders ---- */

/* How many pins of a cloth a collider carries, and how many pins it has. */
static int32_t count_carried(const drape_sim *sim, int32_t collider, const drape_cloth *cloth, int32_t *total)
{
    int32_t carried = 0;
    *total = 0;
    for (int32_t i = 0; i < cloth->mesh.node_count; i++) {
        const int32_t node = cloth->first_node + i;
        if (!sim->model->pinned[node])
            continue;
        *total += 1;
        carried += drape_sim_carrier(sim, node) == collider;
    }
    return carried;
}

/* Cloth with pins on a collider is placed with it: as the collider is or, if it has other pins, too, by the
 * rigid motion that fits all pins best. That depends on the final places of the pins, so it does not matter
 * in which order several colliders are sent. */
static void carry(drape_sim *sim, int32_t collider, const drape_placement *by)
{
    const drape_model *m = sim->model;
    const drape_place_list none = {NULL, 0};
    for (int32_t c = 0; c < m->cloth_count; c++) {
        int32_t count;
        const int32_t carried = count_carried(sim, collider, &m->cloths[c], &count);
        drape_placement fitted = *by;
        if (carried == 0)
            continue;
        if (carried < count) {
            const pins p = {.model = m,
                            .cloth = &m->cloths[c],
                            .from = drape_sim_state(sim)->x,
                            .to = targets(sim, 0, NULL, 0, NULL)};
            fitted = fit(&p);
        }
        (void)drape_sim_place_parts(sim, &(drape_place_list){&c, 1}, &none, &fitted, false);
    }
}

/* Whether all that a collider carries can be placed with it. */
static drape_status check_carried(const drape_sim *sim, int32_t collider, const drape_placement *by)
{
    const drape_place_list one = {&collider, 1};
    drape_status status = DRAPE_OK;
    for (int32_t c = 0; !status && c < sim->model->cloth_count; c++) {
        int32_t count;
        if (count_carried(sim, collider, &sim->model->cloths[c], &count) > 0)
            status = drape_sim_check_place(sim, &(drape_place_list){&c, 1}, &one, by);
    }
    return status;
}

/* Whether some point of a collider may be too fast: its speed is at most that of the pivot plus that by which
 * the turn moves the farthest point. */
static bool is_swung_too_fast(const drape_sim *sim, int32_t collider, double seconds, const drape_sent *to,
                              const double from[3], const double now[9])
{
    double path[3], between[9], turn[3] = {0};
    vec3_sub(to->displacement, from, path);
    if (to->rotation) {
        drape_rotation_between(to->rotation, now, between);
        drape_rotation_log(between, turn);
    }
    return sim->teleport_speed > 0 &&
           vec3_norm(path) + sim->model->colliders[collider].radius * vec3_norm(turn) >
               sim->teleport_speed * seconds;
}

/* The placement from where a collider is, displaced by `from` and turned by `now`, to where it must be to
 * arrive in time with the velocities v and w. */
static drape_placement placement_to(const double pivot[3], const double from[3], const double now[9],
                                    double seconds, const drape_sent *to, const double v[3],
                                    const double w[3])
{
    drape_placement by = {.given = true, .turn = DRAPE_NO_ROTATION};
    double back[9], start[9], turn[3] = {0}, before[3];
    if (to->rotation) {
        vec3_add_scaled(-seconds, w, turn);
        drape_rotation_exp(turn, back);
        drape_rotation_product(back, to->rotation, start);
        drape_rotation_between(start, now, by.turn);
    }
    vec3_sub(to->displacement, from, by.shift); /* of the pivot; without a turn, free of its rounding */
    vec3_add_scaled(-seconds, v, by.shift);
    if (drape_rotation_is_none(by.turn))
        return by;
    for (int k = 0; k < 3; k++)
        before[k] = pivot[k] + from[k];
    vec3_add_scaled(1, before, by.shift);
    drape_placement_turn(&by, before, before);
    vec3_add_scaled(-1, before, by.shift);
    return by;
}

drape_status drape_teleport_collider(drape_sim *sim, int32_t collider, double seconds, const drape_sent *to)
{
    const drape_motion *motion = drape_system_motion(sim->system);
    const double t = drape_sim_state(sim)->t;
    double from[3], now[9], v[3], w[3];
    drape_motion_collider(motion, collider, t, from);
    drape_motion_rotation(motion, collider, t, now);
    if (!is_swung_too_fast(sim, collider, seconds, to, from, now))
        return DRAPE_OK;
    drape_motion_collider_arrival(motion, collider, t, v, w);
    const drape_placement by =
        placement_to(sim->model->colliders[collider].pivot, from, now, seconds, to,
                     to->velocity ? to->velocity : v, to->angular_velocity ? to->angular_velocity : w);
    drape_status status = check_carried(sim, collider, &by);
    if (!status)
        status = drape_sim_place_parts(sim, &(drape_place_list){NULL, 0}, &(drape_place_list){&collider, 1},
                                       &by, false);
    if (!status)
        carry(sim, collider, &by);
    if (!status)
        drape_log(sim->ctx, DRAPE_LOG_INFO, "t=%.9g: %s is sent faster than %.4g m/s: it is placed there", t,
                  sim->model->colliders[collider].name, sim->teleport_speed);
    return status;
}
