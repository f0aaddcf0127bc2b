/* release.c: pins that let their nodes go. Which nodes are free decides the size of everything: the unknowns,
 * the pattern of the matrix, what integrators keep. So a sim is made for a model without these pins, beside
 * the present one, as when a checkpoint is restored. It goes on from the same state and account; the
 * integrator and the controller start anew, as after a kink. */
#include "sim/sim.h"

#include <math.h>
#include <string.h>

static void copy_state(drape_sim *to, const drape_sim *from)
{
    const size_t n = 3 * (size_t)to->model->node_count;
    const drape_state *now = drape_sim_state(from);
    drape_state *state = &to->states[to->now];
    state->t = now->t;
    memcpy(state->x, now->x, n * sizeof *state->x);
    memcpy(state->v, now->v, n * sizeof *state->v);
    memcpy(state->internal, now->internal, (size_t)to->model->internal_count * sizeof *state->internal);
}

/* A released node goes on with the velocity that its pin had in the last step. */
static void let_go(drape_sim *to, const drape_sim *from)
{
    drape_state *state = &to->states[to->now];
    const drape_motion *motion = drape_system_motion(from->system);
    const double before = from->before >= 0 ? from->states[from->before].t : state->t;
    for (int32_t i = 0; i < to->model->node_count; i++) {
        double *v = state->v + 3 * (size_t)i;
        if (!from->model->pinned[i] || to->model->pinned[i])
            continue;
        memset(v, 0, 3 * sizeof *v);
        if (motion->place[i] >= 0)
            drape_motion_pin_velocity(motion, motion->place[i], state->t, before + (state->t - before) / 2,
                                      v);
    }
}

static drape_status copy_reasons(drape_sim *to, const drape_sim *from)
{
    to->reason_count = from->reason_count;
    for (int i = 0; i < from->reason_count; i++) {
        to->reasons[i].count = from->reasons[i].count;
        to->reasons[i].reason = drape_arena_text(to->arena, from->reasons[i].reason);
    }
    return drape_arena_status(to->arena);
}

/* The energy account goes on; nodes that are free now have kinetic energy in it, which counts as given. */
static void copy_account(drape_sim *to, drape_sim *from)
{
    const drape_energy before = drape_sim_energy(from);
    to->audit = from->audit;
    drape_sim_shift_energy(to, &before);
}

static drape_status copy_driver(drape_sim *to, drape_sim *from)
{
    to->schedule = from->schedule;
    to->next_frame = from->next_frame;
    to->attempts = from->attempts;
    to->statistics = from->statistics;
    to->realtime = from->realtime;
    to->earlier = drape_work_sum(from->chosen.integrator->work(from->integrator), &from->earlier);
    memcpy(to->relaxed_logged, from->relaxed_logged,
           ((size_t)to->model->collider_count + 1) * sizeof *to->relaxed_logged);
    if (to->chosen.integrator->set_effort)
        to->chosen.integrator->set_effort(to->integrator, to->realtime.effort);
    drape_events_continue(to, from);
    return copy_reasons(to, from);
}

/* All that goes on from one sim to the next. */
static drape_status go_on(drape_sim *to, drape_sim *from)
{
    copy_state(to, from);
    let_go(to, from);
    drape_status status = drape_system_continue(to->system, from->system);
    if (!status)
        status = copy_driver(to, from);
    if (!status)
        copy_account(to, from);
    return status;
}

drape_status drape_sim_release(drape_sim *sim, const uint8_t *nodes)
{
    const size_t count = (size_t)sim->model->node_count;
    drape_sim *other = NULL;
    uint8_t *released = drape_alloc(sim->ctx, count, sizeof *released);
    if (!released)
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < count; i++)
        released[i] = (sim->released && sim->released[i]) || (nodes[i] && sim->model->pinned[i]);
    drape_status status = drape_sim_create_like(sim, released, &other);
    if (!status)
        status = go_on(other, sim);
    if (!status)
        drape_sim_exchange(sim, other);
    drape_sim_destroy(&other);
    drape_free(sim->ctx, released);
    return status;
}
