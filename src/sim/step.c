/*
 * step.c: the driver. An advance is a loop of attempts, each a call of try_step: compute_next makes a step
 * into the state `next` and checks it; a verdict is found (control.h draws how); accept exchanges `now` and
 * `next`, reject leaves `next` to be overwritten.
 */
#include "base/clock.h"
#include "base/finite.h"
#include "base/reason.h"
#include "model/support.h"
#include "sim/dense.h"
#include "sim/rescue.h"
#include "sim/untangle.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* ---- Compute and check ---- */

static drape_state *next_state(drape_sim *sim)
{
    return &sim->states[sim->next];
}

static drape_status check(drape_sim *sim, drape_step_info *info)
{
    drape_state *next = next_state(sim);
    size_t n = 3 * (size_t)sim->model->node_count;
    const bool finite = drape_all_finite(next->x, n) && drape_all_finite(next->v, n);
    if (!drape_ranks_all(drape_model_ranks(sim->model), finite)) {
        info->reason = DRAPE_REASON_NONFINITE;
        return DRAPE_RETRY_NONFINITE;
    }
    if (info->committed)
        return DRAPE_OK;
    sim->attempted_known = false;
    drape_sim_settle_work(sim, next, info);
    const bool away = !info->lenient && drape_sim_ran_away(sim, next, info);
    const drape_status measured = drape_system_agree(sim->system);
    if (measured) {
        info->reason = measured == DRAPE_E_STOPPED ? DRAPE_REASON_CANCELLED : DRAPE_REASON_MEMORY;
        return measured;
    }
    if (away) {
        info->reason = DRAPE_REASON_ENERGY;
        return DRAPE_RETRY_REJECTED;
    }
    if (!info->lenient && drape_sim_left_too_much(sim, next, info)) {
        info->reason = DRAPE_REASON_RESIDUAL;
        return DRAPE_RETRY_NONLINEAR;
    }
    const drape_state *before = drape_sim_state(sim);
    const drape_status status =
        drape_system_check_contact(sim->system, next->x, next->t, &info->reason, &info->diagnostic);
    if (status || info->lenient)
        return status;
    return drape_system_check(sim->system, next->x, before->x, before->internal, &info->reason,
                              &info->diagnostic);
}

/* Adds to work that from one state to another of what no integrator counts: the forces of the host, and terms
 * that depend on time, of which *open may be wrong. Adds what of it is dissipated. */
static void add_outer_work(const drape_sim *sim, const drape_state *from, const drape_state *to, double *work,
                           double *open, double *dissipated)
{
    work[DRAPE_BY_HOST] += drape_system_push_work(sim->system, from->x, to->x);
    drape_system_add_timed_work(sim->system, from, to, work, open,
                                sim->chosen.integrator->steady_state ? NULL : dissipated);
}

/* Makes a step of the integrator, then moves the supported nodes exactly onto their supports. The kinetic
 * energy that this changes is work of the supports, which jumps at kinks of their motion. */
static drape_status integrate(drape_sim *sim, drape_state *next, double h, drape_step_info *info)
{
    const drape_integrator_ops *integrator = sim->chosen.integrator;
    const drape_motion *motion = drape_system_motion(sim->system);
    const drape_state *now = drape_sim_state(sim);
    const bool instant = !integrator->mean_velocities && integrator->own_steps;
    const drape_state *from = integrator->in_space ? now : drape_system_to_frame(sim->system, now);
    const drape_status status = integrator->step(sim->integrator, from, next, h, info);
    info->law_work = drape_system_take_contact_work(sim->system);
    double *work = drape_system_work(sim->system);
    work[DRAPE_BY_COLLIDERS] += info->law_work;
    drape_system_from_frame(sim->system, status && !info->usable ? NULL : next);
    if (status && !info->usable)
        return status;
    drape_supports_hold(motion, now->t, now->x, next->t, next->x);
    const double span[2] = {integrator->steady_state ? next->t : now->t, next->t};
    drape_supports_hold_velocity(motion, span, instant, next->v);
    work[DRAPE_BY_PINS] += drape_supports_kinetic(motion, next->v) - drape_supports_kinetic(motion, now->v);
    return status;
}

static drape_status compute_next(drape_sim *sim, double t1, double h, drape_step_info *info)
{
    drape_state *next = next_state(sim);
    next->t = t1;
    sim->attempted_known = false;
    drape_system_begin_work(sim->system);
    info->diagnostic =
        (drape_diagnostic){.what = "", .term = "", .element = -1, .node = {-1, -1, -1, -1}, .cloth = -1};
    if (sim->rescue)
        sim->rescue->begin(sim, t1);
    drape_status status = drape_system_begin(sim->system, drape_sim_state(sim));
    drape_sim_add_contact_work(sim);
    if (drape_system_contact(sim->system) &&
        (sim->chosen.integrator->steady_state || !sim->chosen.integrator->own_steps))
        drape_sim_account(sim); /* for the check, or a rejection, while contact is where the step begins */
    if (!status)
        status = integrate(sim, next, h, info);
    if (sim->rescue)
        sim->rescue->solved(sim, info);
    if (status == DRAPE_E_STOPPED)
        info->reason = DRAPE_REASON_CANCELLED;
    if (status && !info->usable)
        return status;
    info->open_work = 0;
    add_outer_work(sim, drape_sim_state(sim), next, drape_system_work(sim->system), &info->open_work,
                   &info->dissipated);
    drape_status refused = check(sim, info);
    if (refused)
        info->usable = false;
    return refused ? refused : status;
}

/* ---- Judge ---- */

static const drape_state *past_state(const drape_sim *sim, int k)
{
    return sim->past[k] >= 0 ? &sim->states[sim->past[k]] : NULL;
}

static drape_trial trial_of(drape_sim *sim, drape_step_info *info, drape_status status)
{
    return (drape_trial){.model = sim->model,
                         .past = {past_state(sim, 0), past_state(sim, 1)},
                         .in = drape_sim_state(sim),
                         .out = next_state(sim),
                         .order = sim->chosen.integrator->order,
                         .scratch = sim->scratch,
                         .h = info->h,
                         .dt = sim->schedule.dt,
                         .integrator = sim->chosen.integrator,
                         .integrator_state = sim->integrator,
                         .info = info,
                         .status = status};
}

/* ---- Accept and reject ---- */

static void measure_strain(drape_sim *sim, const double *x)
{
    const drape_model *m = sim->model;
    drape_statistics *s = &sim->statistics;
    bool first = s->steps_accepted == 0;
    double low = first ? INFINITY : s->strain_min, high = first ? -INFINITY : s->strain_max;
    for (int32_t e = 0; e < m->edge_count; e++) {
        const double *a = x + 3 * (size_t)m->edge[2 * (size_t)e],
                     *b = x + 3 * (size_t)m->edge[2 * (size_t)e + 1];
        double dx = b[0] - a[0], dy = b[1] - a[1], dz = b[2] - a[2];
        double strain = sqrt(dx * dx + dy * dy + dz * dz) / m->edge_length[e] - 1;
        low = strain < low ? strain : low;
        high = strain > high ? strain : high;
    }
    s->strain_min = drape_ranks_least(drape_model_ranks(m), low);
    s->strain_max = drape_ranks_largest(drape_model_ranks(m), high);
}

static void accept(drape_sim *sim, const drape_step_info *info, double h_next)
{
    drape_statistics *s = &sim->statistics;
    if (!info->committed)
        drape_state_commit(sim->model, drape_sim_state(sim), next_state(sim));
    /* what slides or flows leaves the elastic energy, and so stays in the balance */
    sim->audit.dissipated += drape_state_relax(sim->model, drape_sim_state(sim),
                                               sim->chosen.integrator->steady_state, next_state(sim));
    /* The new state becomes the present one. The one before joins the past states that the controller
     * wants; the oldest of these is overwritten next. */
    int history_depth = sim->chosen.controller->history_depth, spare = sim->now;
    for (int k = 0; k < history_depth; k++) {
        int older = sim->past[k];
        sim->past[k] = spare;
        spare = older;
    }
    while (spare < 0 || spare == sim->next || spare == sim->past[0] || spare == sim->past[1])
        spare++; /* not all states are in use yet: take the first free one */
    sim->before = sim->now;
    sim->now = sim->next;
    sim->next = spare;
    drape_sim_add_work(sim, info);
    measure_strain(sim, drape_sim_state(sim)->x);
    s->h_min = s->steps_accepted == 0 ? info->h : fmin(info->h, s->h_min);
    s->h_max = fmax(info->h, s->h_max);
    s->steps_accepted++;
    s->steps_unconverged += info->usable;
    /* Lengths and energies are NaN if the integrator estimates none. */
    s->error_last = info->error;
    s->error_max = fmax(s->error_max, info->error);
    s->steps_above_error += info->error > drape_sim_error_bound(sim);
    sim->left.last = info->left;
    sim->left.largest = fmax(sim->left.largest, info->left);
    sim->left.by_error += info->by_error;
    sim->left.above_own += !info->solved && info->left > info->own;
    drape_schedule_accept(&sim->schedule, drape_sim_state(sim)->t, h_next, !info->laborious);
    if (sim->rescue)
        sim->rescue->accepted(sim);
}

static void count_reason(drape_sim *sim, drape_reason reason)
{
    int i = 0;
    while (i < sim->reason_count && sim->reasons[i].reason != reason)
        i++;
    if (i == sim->reason_count)
        sim->reasons[sim->reason_count++] = (drape_reason_total){.reason = reason};
    sim->reasons[i].count++;
}

/* If the attempt overwrote the state in which the last step began, the sim has no earlier state, as at its
 * start. With a steady-state integrator `before` is kept: drape_sim_emit_frames reads from it that there was
 * a step, after which there are no more frames. */
static void reject(drape_sim *sim, const drape_step_info *info)
{
    const drape_energy before = sim->energy;
    if (info->law_work != 0) /* the laws stay, and give the present state another energy */
        drape_sim_shift_energy(sim, &before, DRAPE_BY_COLLIDERS);
    if (sim->before == sim->next && !sim->chosen.integrator->steady_state)
        sim->before = -1;
    sim->statistics.steps_rejected++;
    count_reason(sim, info->reason);
}

/* Shortens a finished step to the time that the schedule was cut to, by the dense output of the integrator,
 * instead of making it again. False: it has none of its own, or the state does not pass the checks of a step.
 * The work of the step is taken to be done evenly. */
static bool cut_on_dense_output(drape_sim *sim, drape_step_info *info)
{
    const drape_state *now = drape_sim_state(sim);
    drape_state *next = next_state(sim);
    const double t = sim->schedule.cut_end, share = (t - now->t) / (next->t - now->t);
    const size_t count = drape_system_work_count(sim->system);
    double open = 0, lost = 0, *work = drape_system_work(sim->system),
           *outer = memset(sim->work_scratch, 0, count * sizeof *outer);
    add_outer_work(sim, now, next, outer, &open, &lost);
    info->open_work = 0;
    if (!sim->chosen.integrator->interpolate_velocities)
        return false;
    drape_sim_dense_positions(sim, now, next, t, sim->frame);
    drape_sim_dense_velocities(sim, now, next, t, sim->frame_velocity);
    memcpy(next->x, sim->frame, 3 * (size_t)sim->model->node_count * sizeof *next->x);
    memcpy(next->v, sim->frame_velocity, 3 * (size_t)sim->model->node_count * sizeof *next->v);
    next->t = t;
    info->h = t - now->t;
    info->dissipated = share * (info->dissipated - lost);
    for (size_t i = 0; i < count; i++)
        work[i] = share * (work[i] - outer[i]);
    add_outer_work(sim, now, next, work, &info->open_work, &info->dissipated);
    return !check(sim, info);
}

/* The verdict of events on a step that the controller accepted: STOP if an event function failed; REPEAT if
 * the attempt is given up, to be made with another end or because an event acts on the present state. memory:
 * of the controller before it judged. */
static drape_verdict ask_events(drape_sim *sim, const double memory[2], drape_trial *trial)
{
    drape_system_end_step(sim->system); /* what events evaluate leaves no trace in the next step */
    drape_status failure = DRAPE_OK;
    drape_event_verdict found = drape_events_examine(sim, next_state(sim), &failure);
    if (found == DRAPE_EVENTS_REPEAT && cut_on_dense_output(sim, trial->info))
        found = drape_events_examine(sim, next_state(sim), &failure);
    if (found == DRAPE_EVENTS_PASS)
        return DRAPE_ACCEPT;
    trial->stop = failure ? failure : drape_system_status(sim->system);
    memcpy(sim->scratch, memory, sizeof sim->scratch);
    if (sim->chosen.integrator->own_steps) /* it has accepted the step already */
        sim->chosen.integrator->restart(sim->integrator, drape_sim_state(sim));
    trial->info->reason = DRAPE_REASON_EVENT;
    trial->status = DRAPE_RETRY_REJECTED;
    return trial->stop ? DRAPE_STOP : DRAPE_REPEAT;
}

/* ---- Messages ---- */

/* "bend.hinge 37 (nodes 4 5 9 10 of sheet): altitude / rest altitude = 3e-09, limit 1e-06" */
static void describe_diagnostic(const drape_model *model, const drape_diagnostic *diagnostic, char *text,
                                size_t size)
{
    size_t used = 0;
    text[0] = 0;
    if (diagnostic->node[0] < 0) {
        if (*diagnostic->what)
            snprintf(text, size, "; %s = %.4g, limit %.4g", diagnostic->what, diagnostic->value,
                     diagnostic->limit);
        return;
    }
    if (diagnostic->element >= 0)
        used = (size_t)snprintf(text, size, "; %s %d (nodes", diagnostic->term, (int)diagnostic->element);
    else
        used = (size_t)snprintf(text, size, "; worst at (node");
    for (int a = 0; a < 4 && diagnostic->node[a] >= 0 && used < size; a++) {
        const int32_t node = diagnostic->node[a], next = a < 3 ? diagnostic->node[a + 1] : -1;
        int32_t number, unused;
        const int32_t in = drape_model_diagnosed(model, node, &number);
        used += (size_t)snprintf(text + used, size - used, " %d", (int)number);
        if (used < size && (next < 0 || drape_model_diagnosed(model, next, &unused) != in))
            used += (size_t)snprintf(text + used, size - used, " of %s%s", model->cloths[in].name,
                                     next < 0 ? "" : ",");
    }
    if (used < size)
        snprintf(text + used, size - used, "): %s = %.4g, limit %.4g", diagnostic->what, diagnostic->value,
                 diagnostic->limit);
}

/* The pair that may have kept the equations of a step without a solution, unless the diagnostic names an
 * element. */
static void describe_nearest(const drape_sim *sim, const drape_attempt *attempt, char *text, size_t size)
{
    drape_diagnostic nearest;
    text[0] = 0;
    if (attempt->diagnostic.element < 0 && drape_system_nearest(sim->system, &nearest))
        describe_diagnostic(sim->model, &nearest, text, size);
}

static drape_status explain(drape_sim *sim, drape_status stop, const drape_attempt *attempt)
{
    char diagnostic[400], nearest[400], residual[100] = "", distortion[200] = "", advice[200] = "";
    if (stop == DRAPE_E_MEMORY || sim->reason == DRAPE_REASON_EVENT) /* the message is set */
        return stop;
    if (stop == DRAPE_E_STOPPED)
        return drape_sim_check_cancel(sim);
    describe_diagnostic(sim->model, &attempt->diagnostic, diagnostic, sizeof diagnostic);
    describe_nearest(sim, attempt, nearest, sizeof nearest);
    /* a diagnostic that names only a node may not give the cause, which the distortion may */
    if (attempt->diagnostic.element < 0 && !sim->model->part)
        drape_sim_describe_distortion(sim, distortion, sizeof distortion);
    if (stop == DRAPE_E_STEP_TOO_SMALL && drape_realtime_rescue.advise(sim, attempt, advice, sizeof advice))
        return DRAPE_E_MEMORY;
    /* NAN: integrators that bound errors have no residual */
    if (!isnan(attempt->tolerance) && !isnan(attempt->residual))
        snprintf(residual, sizeof residual, ", residual %.4g N for a tolerance of %.4g N", attempt->residual,
                 attempt->tolerance);
    return drape_fail(sim->ctx, stop, "t=%.9g h=%.4g: %s (%s) after %d iterations%s%s%s%s%s", attempt->t,
                      attempt->h, attempt->reason, drape_status_name(attempt->status), attempt->iterations,
                      residual, diagnostic, nearest, distortion, advice);
}

/* An integrator that chooses its own steps has no dt, and a limit of its own. */
drape_status drape_sim_check_attempts(drape_sim *sim, const drape_attempt *last)
{
    char diagnostic[400], nearest[400], advice[200];
    const drape_schedule *s = &sim->schedule;
    if (!(s->dt > 0) || sim->max_attempts == 0 || s->tries < sim->max_attempts)
        return DRAPE_OK;
    describe_diagnostic(sim->model, &last->diagnostic, diagnostic, sizeof diagnostic);
    describe_nearest(sim, last, nearest, sizeof nearest);
    if (drape_realtime_rescue.advise(sim, last, advice, sizeof advice))
        return DRAPE_E_MEMORY;
    return drape_fail(
        sim->ctx, DRAPE_E_STEP_TOO_SMALL,
        "t=%.9g h=%.4g: %s (%s) after %d iterations; %" PRId64
        " attempts since t=%.9g advanced less than one dt, %.4g s; the controller makes at most "
        "%" PRId64 "%s%s%s",
        drape_sim_state(sim)->t, last->h, last->reason, drape_status_name(last->status), last->iterations,
        s->tries, s->tries_from, s->dt, sim->max_attempts, diagnostic, nearest, advice);
}

/* ---- One step, and an advance ---- */

/* Makes one attempt, from proposal to verdict. *stop: the negative status that ends the advance; 0:
 * continue. */
static drape_attempt try_step(drape_sim *sim, double t1, double h, drape_status *stop)
{
    drape_step_info info = {.reason = DRAPE_REASON_CONVERGED, .h = h, .error = NAN, .left = NAN, .own = NAN};
    const double t = drape_sim_state(sim)->t, memory[2] = {sim->scratch[0], sim->scratch[1]};
    const drape_status status = compute_next(sim, t1, h, &info);
    drape_trial trial = trial_of(sim, &info, status);
    drape_verdict verdict = sim->chosen.controller->judge(sim->chosen.controller_values, &trial);
    if (verdict == DRAPE_ACCEPT)
        verdict = ask_events(sim, memory, &trial);
    else if (sim->rescue)
        verdict = sim->rescue->failed(sim, t1, &trial, verdict);
    if (verdict == DRAPE_RETRY && !drape_schedule_retry(&sim->schedule, trial.h_next)) {
        trial.stop = DRAPE_E_STEP_TOO_SMALL;
        verdict = DRAPE_STOP;
    }
    const bool accepted = verdict == DRAPE_ACCEPT || verdict == DRAPE_SUBSTITUTE;
    if (accepted) {
        accept(sim, &info, trial.h_next);
        drape_events_commit(sim);
    } else
        reject(sim, &info);
    if (verdict == DRAPE_SUBSTITUTE)
        sim->chosen.integrator->restart(sim->integrator, drape_sim_state(sim));
    *stop = verdict == DRAPE_STOP ? trial.stop : DRAPE_OK;
    sim->reason = info.reason;
    return (drape_attempt){.index = sim->attempts++,
                           .t = t,
                           .h = info.h,
                           /* refused by the controller alone, an attempt has the status of a success */
                           .status =
                               trial.status || verdict == DRAPE_ACCEPT ? trial.status : DRAPE_RETRY_REJECTED,
                           .reason = drape_system_reason_name(sim->system, info.reason),
                           .accepted = accepted,
                           .iterations = info.iterations,
                           .residual = info.residual,
                           .tolerance = info.tolerance,
                           .diagnostic = info.diagnostic,
                           .error = info.error,
                           .left = info.left};
}

/* Contact time so far, including queries outside steps such as energies for observers. */
static double contact_seconds(const drape_sim *sim)
{
    return sim->chosen.integrator->work(sim->integrator).contact_seconds +
           drape_contact_seconds(drape_system_contact(sim->system));
}

/* Frames inside an accepted step are emitted even if an observer stops the run at the attempt. */
drape_status drape_sim_step(drape_sim *sim, double t1, double h, drape_attempt *attempt)
{
    drape_status stop = DRAPE_OK;
    double start = drape_clock_seconds(), contact = contact_seconds(sim);
    *attempt = try_step(sim, t1, h, &stop);
    drape_system_end_step(sim->system);
    sim->statistics.wall_steps += drape_clock_seconds() - start;
    sim->statistics.wall_contact += contact_seconds(sim) - contact;
    if (!attempt->accepted && sim->reason != DRAPE_REASON_EVENT && sim->ctx->def.log) {
        char diagnostic[400];
        describe_diagnostic(sim->model, &attempt->diagnostic, diagnostic, sizeof diagnostic);
        drape_log(sim->ctx, DRAPE_LOG_INFO, "t=%.9g h=%.4g: step rejected, %s (%s)%s", attempt->t, attempt->h,
                  attempt->reason, drape_status_name(attempt->status), diagnostic);
    }
    drape_status notified =
        drape_sim_notify(sim, &(drape_event){.kind = DRAPE_EVENT_ATTEMPT, .sim = sim, .attempt = attempt});
    drape_status reported = drape_events_report(sim);
    drape_status emitted = attempt->accepted ? drape_sim_emit_frames(sim) : DRAPE_OK;
    if (stop)
        return explain(sim, stop, attempt);
    if (notified || reported || emitted) /* the actions are for the next advance */
        return notified ? notified : reported ? reported : emitted;
    return drape_events_act(sim);
}

static drape_status advance(drape_sim *sim, double t_end)
{
    double t1, h;
    drape_attempt attempt = {.reason = ""};
    drape_status status = drape_sim_untangle_start(sim);
    if (!status)
        status =
            drape_sim_emit_frames(sim); /* the first frame, and those left over when an observer stopped the
                                       run */
    if (!status)
        status = drape_events_resume(sim);
    if (sim->rescue)
        sim->rescue->leave(sim);
    drape_schedule_aim(&sim->schedule, t_end);
    while (!status && drape_schedule_next(&sim->schedule, &t1, &h)) {
        status = drape_sim_check_attempts(sim, &attempt);
        if (!status)
            status = drape_sim_check_cancel(sim);
        if (!status)
            status = drape_sim_step(sim, t1, h, &attempt);
    }
    return status;
}

drape_status drape_sim_advance(drape_sim *sim, double t_end)
{
    drape_status status = drape_sim_guard(sim, "drape_sim_advance");
    if (status)
        return status;
    sim->ctx->message[0] = 0; /* so that after a failure the message belongs to this advance */
    if (!isfinite(t_end))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_advance: t_end is not finite");
    sim->advancing = true;
    status = advance(sim, t_end);
    sim->advancing = false;
    return status;
}
