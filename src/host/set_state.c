/*
 * set_state.c: a user-defined state. It is built in the state that the next attempt would overwrite, once
 * all is checked: that state may be the one in which the last step began, which is still read. The history
 * that led to the present state is discarded.
 */
#include "base/elementary.h"
#include "model/support.h"
#include "sim/rescue.h"

#include <math.h>
#include <string.h>

static drape_status check_given(const drape_sim *sim, double t, const double *x, const double *v)
{
    size_t n = 3 * (size_t)sim->model->node_count;
    if (!x || !v)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_set_state: there are no %s",
                          x ? "velocities" : "positions");
    if (!(t >= 0 && t <= DRAPE_MOST))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_set_state: t = %g s; it is 0 to %g s", t,
                          DRAPE_MOST);
    for (size_t i = 0; i < 2 * n; i++) {
        double value = i < n ? x[i] : v[i - n];
        int32_t node = (int32_t)(i % n / 3), c = drape_model_cloth_of(sim->model, node);
        if (!isfinite(value))
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                              "drape_sim_set_state: %s of node %d of %s is %g; it must be finite",
                              i < n ? "the position" : "the velocity",
                              (int)(node - sim->model->cloths[c].first_node), sim->model->cloths[c].name,
                              value);
    }
    return DRAPE_OK;
}

/* Places pinned nodes where their pins are at the time of the state, and those that the host moves at their
 * given positions. */
static void place_pinned(const drape_sim *sim, const double *given, double t, double *x)
{
    const drape_model *m = sim->model;
    const drape_motion *motion = drape_system_motion(sim->system);
    for (int32_t i = 0; i < m->node_count; i++)
        if (m->pinned[i])
            drape_motion_place_fixed(motion, i, x + 3 * (size_t)i);
    drape_motion_place_pins(motion, t, x);
    for (int32_t i = 0; i < motion->moved_count; i++) {
        size_t at = 3 * (size_t)motion->moved_node[i];
        if (motion->pin_path[i].given)
            memcpy(x + at, given + at, 3 * sizeof *x);
    }
}

static drape_status check_pinned(const drape_sim *sim, const double *given, double t, const double *placed)
{
    const drape_model *m = sim->model;
    for (int32_t i = 0; i < m->node_count; i++) {
        const double *x = given + 3 * (size_t)i, *pin = placed + 3 * (size_t)i;
        const drape_cloth *cloth = &m->cloths[drape_model_cloth_of(m, i)];
        if (m->pinned[i] && !(drape_hypot(drape_hypot(x[0] - pin[0], x[1] - pin[1]), x[2] - pin[2]) <=
                              DRAPE_SAME * m->length))
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                              "drape_sim_set_state: node %d of %s is at (%g %g %g); its pin has it at (%g %g "
                              "%g) m at t = %g s",
                              (int)(i - cloth->first_node), cloth->name, x[0], x[1], x[2], pin[0], pin[1],
                              pin[2], t);
    }
    return DRAPE_OK;
}

/* Nodes that pins hold in some directions stay where they are along these. scratch (node_count x 3) */
static drape_status check_supported(const drape_sim *sim, const double *given, double *scratch)
{
    const drape_model *m = sim->model;
    const double *now = drape_sim_state(sim)->x;
    for (size_t i = 0; i < 3 * (size_t)m->node_count; i++)
        scratch[i] = given[i] - now[i];
    drape_system_project(sim->system, scratch);
    for (int32_t i = 0; i < m->support_count; i++) {
        const int32_t node = m->supports[i].node;
        const double *x = given + 3 * (size_t)node, *at = now + 3 * (size_t)node;
        const double *within = scratch + 3 * (size_t)node;
        double off[3];
        for (int k = 0; k < 3; k++)
            off[k] = x[k] - at[k] - within[k];
        const double distance = drape_hypot(drape_hypot(off[0], off[1]), off[2]);
        const drape_cloth *cloth = &m->cloths[drape_model_cloth_of(m, node)];
        if (m->free_of_node[node] >= 0 && !(distance <= DRAPE_SAME * m->length))
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                              "drape_sim_set_state: node %d of %s is at (%g %g %g), which is %g m off the "
                              "plane or line on which a pin holds it",
                              (int)(node - cloth->first_node), cloth->name, x[0], x[1], x[2], distance);
    }
    return DRAPE_OK;
}

/* Images stay displaced from each other as they are. */
static drape_status check_images(const drape_sim *sim, const double *given)
{
    const drape_model *m = sim->model;
    const double *now = drape_sim_state(sim)->x;
    for (int32_t i = 0; m->image_set && i < m->node_count; i++) {
        if (m->image_set[i] < 0 || m->pinned[i])
            continue;
        const int32_t first = m->image[m->image_start[m->image_set[i]]];
        double off[3];
        for (size_t k = 0, a = 3 * (size_t)i, b = 3 * (size_t)first; k < 3; k++)
            off[k] = given[a + k] - given[b + k] - (now[a + k] - now[b + k]);
        const double distance = drape_hypot(drape_hypot(off[0], off[1]), off[2]);
        const drape_cloth *cloth = &m->cloths[drape_model_cloth_of(m, i)];
        if (!(distance <= DRAPE_SAME * m->length))
            return drape_fail(
                sim->ctx, DRAPE_E_ARGUMENT,
                "drape_sim_set_state: node %d of %s is %g m from where the period of its periodic "
                "edge has it from node %d",
                (int)(i - cloth->first_node), cloth->name, distance, (int)(first - cloth->first_node));
    }
    return DRAPE_OK;
}

/* Makes the state a beginning: nothing that led to the previous state counts. */
static void start_anew(drape_sim *sim, double t_before)
{
    double t = drape_sim_state(sim)->t;
    sim->before = sim->past[0] = sim->past[1] = -1;
    memset(sim->scratch, 0, sizeof sim->scratch);
    sim->chosen.integrator->restart(sim->integrator, drape_sim_state(sim));
    if (sim->rescue)
        sim->rescue->leave(sim);
    drape_events_reset(sim);
    drape_schedule_init(&sim->schedule, sim->schedule.stepping, sim->schedule.dt, t);
    if (t != t_before) { /* the first frame at or after t; otherwise it may have been emitted already */
        int64_t k = (int64_t)floor(t * sim->frame_rate);
        sim->next_frame = (double)k / sim->frame_rate < t ? k + 1 : k;
    }
    drape_sim_reset_energy(sim);
}

drape_status drape_sim_set_state(drape_sim *sim, double t, const double *x, const double *v)
{
    drape_status guarded = drape_sim_guard(sim, "drape_sim_set_state");
    if (guarded)
        return guarded;
    drape_status status = check_given(sim, t, x, v);
    if (status)
        return status;
    const drape_model *m = sim->model;
    const size_t size = 3 * (size_t)m->node_count * sizeof *x;
    double *placed = sim->query_scratch;
    status = check_images(sim, x);
    if (!status)
        status = check_supported(sim, x, placed);
    if (status)
        return status;
    memcpy(placed, x, size);
    place_pinned(sim, x, t, placed);
    status = check_pinned(sim, x, t, placed);
    if (status)
        return status;
    drape_state *now = &sim->states[sim->now], *next = &sim->states[sim->next];
    next->t = t;
    memcpy(next->x, placed, size);
    memcpy(next->v, v, size);
    /* Fixed nodes have no velocity, those with supports at rest none along what is held, nor have those at
     * rest where the host put them; pinned nodes and supports that move keep the given one until a step
     * sets it to the mean over their displacement. */
    const drape_motion *motion = drape_system_motion(sim->system);
    for (int32_t i = 0; i < m->node_count; i++)
        if (m->pinned[i])
            memset(next->v + 3 * (size_t)i, 0, 3 * sizeof *next->v);
    drape_supports_stop(motion, motion, drape_sim_state(sim)->v, next->v);
    for (int32_t i = 0; i < motion->moved_count; i++) {
        size_t at = 3 * (size_t)motion->moved_node[i];
        if (!motion->pin_path[i].given)
            memcpy(next->v + at, v + at, 3 * sizeof *next->v);
    }
    drape_motion_hold_pins(drape_system_steer(sim->system), next->x);
    drape_state_commit(m, now, next);
    drape_state_relax(m, now, false, next); /* the account of energy starts anew */
    sim->next = sim->now;
    sim->now = (int)(next - sim->states);
    start_anew(sim, now->t);
    return DRAPE_OK;
}
