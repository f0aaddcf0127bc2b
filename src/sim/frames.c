/*
 * frames.c: frame times are k / frame_rate. No step is shortened for a frame: between the states of a
 * step, it shows dense output.
 *
 * A frame is written only if its positions, and the straight path to them from the state before the step,
 * pass the check that steps pass, with the colliders where they are at the time of the frame. If the
 * interpolant does not, positions on the straight line between the two states are tried, first that of the
 * time itself and then ever farther from it. That of the time itself may fail, too: the check of a step
 * takes a collider to move straight between the kinks of its motion, while a host may send it on a curve,
 * and large faces may dip into a round collider between two states that are free of it. If all of them
 * fail, the frame is the state at the end of the step, at its own time, and so are the other frames of
 * this step.
 */
#include "sim/dense.h"

#include <math.h>

#define PARTS 16 /* of the line between two states, on which free positions are searched */

static void straight(const drape_state *a, const drape_state *b, double share, size_t n, double *x)
{
    for (size_t i = 0; i < n; i++)
        x[i] = (1 - share) * a->x[i] + share * b->x[i];
}

/* Checks contact in sim->frame. Contact still compares with the state before, in which the last step
 * began. */
static drape_status check(drape_sim *sim, double t)
{
    drape_reason reason;
    drape_diagnostic diagnostic;
    return drape_system_check_contact(sim->system, sim->frame, t, &reason, &diagnostic);
}

/* Interpolates into sim->frame. Returns a status > 0 if no positions passed the check. */
static drape_status make_frame(drape_sim *sim, const drape_state *before, double t)
{
    const drape_state *now = drape_sim_state(sim);
    const size_t n = 3 * (size_t)sim->model->node_count;
    const double share = (t - before->t) / (now->t - before->t);
    drape_sim_dense_positions(sim, before, now, t, sim->frame);
    drape_status status = check(sim, t);
    for (int i = 0; status > 0 && i <= 2 * PARTS; i++) {
        const double shift = (double)((i + 1) / 2) / PARTS;
        straight(before, now, fmin(fmax(i % 2 ? share + shift : share - shift, 0), 1), n, sim->frame);
        status = check(sim, t);
    }
    return status;
}

static drape_status emit(drape_sim *sim, double time, const double *x, const double *v)
{
    drape_event event = {.kind = DRAPE_EVENT_FRAME,
                         .sim = sim,
                         .frame = sim->next_frame,
                         .time = time,
                         .positions = x,
                         .velocities = v};
    sim->next_frame++;
    return drape_sim_notify(sim, &event);
}

/* A frame between the states of the last step; *late: some frame of the step is the state at its end. */
static drape_status emit_between(drape_sim *sim, const drape_state *before, double time, bool *late)
{
    const drape_state *now = drape_sim_state(sim);
    drape_status status = *late ? DRAPE_RETRY_REJECTED : make_frame(sim, before, time);
    *late = status > 0;
    if (status < 0)
        return status;
    if (*late)
        return emit(sim, now->t, now->x, now->v);
    drape_sim_dense_velocities(sim, before, now, time, sim->frame_velocity);
    return emit(sim, time, sim->frame, sim->frame_velocity);
}

drape_status drape_sim_emit_frames(drape_sim *sim)
{
    const drape_state *before = sim->before >= 0 ? &sim->states[sim->before] : NULL;
    const drape_state *now = drape_sim_state(sim);
    double near = before ? DRAPE_SAME * (now->t - before->t) : 0;
    drape_status status = DRAPE_OK;
    bool late = false;
    if (before && sim->chosen.integrator->steady_state)
        return DRAPE_OK;
    if (sim->observer_count == 0) { /* without observers frames are counted but not computed */
        sim->next_frame = (int64_t)floor((now->t + near) * sim->frame_rate) + 1;
        return DRAPE_OK;
    }
    while (!status) {
        double time = (double)sim->next_frame / sim->frame_rate;
        if (time > now->t + near)
            return DRAPE_OK;
        if (!before || time > now->t - near)
            status = emit(sim, now->t, now->x, now->v);
        else
            status = emit_between(sim, before, time, &late);
    }
    return status;
}
