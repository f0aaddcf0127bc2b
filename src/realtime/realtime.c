/*
 * realtime.c: an advance with a budget. The time owed, which is the frame and what earlier frames left
 * over, is covered by equal steps no longer than dt, so that at any frame rate a step is the same equations
 * with its own h. If the steps are not expected to fit into the budget, judged by the cost of recent steps,
 * the integrator takes a cheaper level of effort; then steps become longer than dt; then time is left over
 * for the next call. Left-over time above one longest step is dropped, so that late frames do not delay
 * later ones more and more.
 *
 * The work of a call is bounded: after its first attempt, accepted or rejected, it begins another only if
 * that one is expected to end in time. So the halvings of a step that is rejected again and again are spread
 * over calls. A step that takes longer than a frame is made once in several frames; the frames between show
 * the state before it.
 */
#include "base/clock.h"
#include "base/reason.h"
#include "base/vec3.h"
#include "realtime/catch_up.h"
#include "realtime/relaxed_report.h"
#include "sim/untangle.h"

#include <math.h>
#include <string.h>

#define KEEP 0.9 /* fraction of the budget: a level of effort that is expected to take more is abandoned */
/* Fraction of the budget in which a further iteration must be expected to end: some take longer than the one
 * before. With 0.9 of 3270 frames of three capes 142 and 186 were late, with this 94 and 147. */
#define IN_TIME 0.8
#define RECOVER 0.6 /* fraction of the budget: a better level that is expected to take less is resumed */
#define LEARN   0.3 /* weight of the last attempt in the expected cost */
#define CHEAPER 0.7 /* assumed cost of a cheap step, in that of another one, until it is measured */
#define STRETCH 4   /* longest step, in dt, unless the def sets it */
#define SWEEPS  8   /* of untangling, in a call */

static int lowest_effort(const drape_sim *sim)
{
    return sim->chosen.integrator->set_cheap ? 1 : 0;
}

void drape_realtime_set_effort(drape_sim *sim, int effort)
{
    if (sim->chosen.integrator->set_cheap)
        sim->chosen.integrator->set_cheap(sim->integrator, effort > 0);
    sim->realtime->effort = effort;
}

/* ---- What steps cost ---- */

/* Expected seconds of an attempt; 0: no attempt was made yet. */
static double expected(const drape_sim *sim, int effort)
{
    const double *cost = sim->realtime->cost;
    return effort > 0 && cost[1] == 0 ? CHEAPER * cost[0] : cost[effort];
}

/* ---- The level of effort ---- */

typedef struct plan {
    int effort;
    int64_t steps;
    double h; /* [s] */
} plan;

static int64_t steps_of(double owed, double h)
{
    return (int64_t)fmax(1, ceil(owed / h - DRAPE_SAME));
}

/* Finds the best level whose steps fit into the budget. */
static bool plan_effort(const drape_sim *sim, double owed, double budget, plan *out)
{
    int now = sim->realtime->effort;
    int64_t steps = steps_of(owed, fmin(sim->realtime->dt, sim->realtime->cap));
    for (int e = 0; e <= lowest_effort(sim); e++) {
        double share = e < now || sim->realtime->stretched ? RECOVER : KEEP;
        if ((double)steps * expected(sim, e) > share * budget)
            continue;
        *out = (plan){.effort = e, .steps = steps, .h = owed / (double)steps};
        return true;
    }
    return false;
}

/* The longest step to keep up with. Not above dt in contact, or where a longer step might lead to it: bodies
 * move farther, which costs more iterations and rejected steps than it saves (docs/realtime.md). */
static double longest_step(const drape_realtime_memory *m)
{
    return m->touches || m->meets ? m->dt : m->longest;
}

/* Steps at the lowest level of effort, longer than dt: as many as fit into the budget. If one step costs the
 * budgets of n frames, it is made when n frames are owed. */
static plan plan_stretched(drape_sim *sim, double owed, double frame, double budget)
{
    drape_realtime_memory *m = sim->realtime;
    const drape_state *now = drape_sim_state(sim);
    drape_contact *contact = drape_system_contact(sim->system);
    const int effort = lowest_effort(sim);
    const double fit = KEEP * budget / expected(sim, effort),
                 enough = fit < 1 ? fmax(owed, ceil(1 / fit) * frame) : owed;
    m->meets = !m->touches && m->longest > m->dt && contact &&
               drape_contact_may_meet(contact, now->x, now->v, now->t, fmin(enough, m->longest));
    const double longest = fmin(longest_step(m), m->cap);
    int64_t most = steps_of(owed, m->dt);
    if (fit < 1 && owed < (1 - DRAPE_SAME) * fmin(longest, enough))
        return (plan){.effort = effort};
    int64_t steps = fit < 1 ? 1 : fit < (double)most ? (int64_t)fit : most;
    return (plan){.effort = effort, .steps = steps, .h = fmin(owed / (double)steps, longest)};
}

/* ---- A call ---- */

/* Further iterations in a step leave enough of the budget for its end, and for the least work of the steps
 * after it. */
static void set_deadline(drape_sim *sim, const plan *p, const drape_realtime *report, double until)
{
    const double after = fmax(0, (double)(p->steps - 1 - report->attempts));
    if (sim->chosen.integrator->set_deadline)
        sim->chosen.integrator->set_deadline(
            sim->integrator, until - sim->realtime->ending - after * expected(sim, sim->realtime->effort));
}

/* Whether pins have moved relative to each other in the last step: pairs of pinned pieces alone are not
 * checked either. */
static bool pins_move_apart(const drape_sim *sim)
{
    const drape_model *m = sim->model;
    if (!m->contact.self || sim->before < 0)
        return false;
    const double *from = sim->states[sim->before].x, *to = drape_sim_state(sim)->x, *first = NULL;
    double path[3], other[3], apart = 0;
    for (int32_t i = 0; i < m->node_count; i++) {
        const size_t at = 3 * (size_t)i;
        if (!m->pinned[i])
            continue;
        vec3_sub(to + at, from + at, other);
        if (!first)
            memcpy(path, other, sizeof path);
        first = to + at;
        vec3_sub(other, path, other);
        apart = fmax(apart, vec3_norm(other));
    }
    return apart > DRAPE_SAME * m->length;
}

static drape_status take_steps(drape_sim *sim, const plan *p, double begun, double budget,
                               drape_realtime *report)
{
    const double deadline = begun + budget;
    drape_status status = drape_sim_emit_frames(sim);
    if (!status)
        status = drape_events_resume(sim);
    double t1, h;
    drape_attempt attempt = {.reason = ""};
    while (!status && drape_schedule_next(&sim->schedule, &t1, &h)) {
        double start = drape_clock_seconds();
        /* a step that is to end at an event ends there in this call: the next one would begin anew */
        if (report->attempts > 0 && !sim->schedule.cut &&
            start + expected(sim, sim->realtime->effort) > deadline)
            break;
        status = drape_sim_check_attempts(sim, &attempt);
        if (!status)
            status = drape_sim_check_cancel(sim);
        if (status)
            break;
        set_deadline(sim, p, report, begun + IN_TIME * budget);
        status = drape_sim_step(sim, t1, h, &attempt);
        const double end = drape_clock_seconds();
        drape_realtime_memory *m = sim->realtime;
        /* The machine makes both levels of effort slower or faster alike: their ratio is kept. */
        double *own = &m->cost[m->effort];
        const double before = *own, seconds = end - start - m->further_seconds, ending = end - m->solved_at;
        *own = before == 0 ? seconds : (1 - LEARN) * before + LEARN * seconds;
        if (before > 0)
            m->cost[!m->effort] *= *own / before;
        /* The checks at the end of an attempt, the energies and what observers do. Their time rises at
         * once, because a frame that is late is worse than one with an iteration less. */
        m->ending = fmax(ending, (1 - LEARN) * m->ending + LEARN * ending);
        m->touches = drape_system_touches(sim->system);
        m->unchecked |= attempt.accepted && pins_move_apart(sim);
        report->attempts++;
        report->rejected += !attempt.accepted;
        report->held += attempt.accepted && sim->reason == DRAPE_REASON_HELD;
        if (!attempt.accepted && !sim->schedule.cut)
            m->cap = m->relaxed_again ? INFINITY : fmin(m->cap, attempt.h / 2);
        report->h = attempt.accepted ? fmax(report->h, attempt.h) : report->h;
        report->residual = attempt.accepted ? fmax(report->residual, attempt.residual) : report->residual;
        report->error = attempt.accepted ? fmax(report->error, attempt.error) : report->error;
    }
    return status;
}

/* ---- Cloth that passes through itself ---- */

/* Whether steps may pass through pinned cloth, and that is why they are not checked there. */
static bool lets_cloth_pass(const drape_sim *sim)
{
    return drape_sim_relaxed_at(sim, -1) > 0;
}

/* Counted where a step may have let some pass, or begun with some: all others are checked. */
static void count_crossings(drape_sim *sim, bool unchecked)
{
    drape_realtime_memory *m = sim->realtime;
    if (!sim->model->contact.self || (m->crossings == 0 && !unchecked))
        return;
    m->crossings = drape_sim_intersections(sim, -1);
    m->most_crossings = m->crossings > m->most_crossings ? m->crossings : m->most_crossings;
}

/* What passes through the cloth stays there, because contact keeps each side where it is. Once bodies and
 * pins leave it room, it is taken apart, as far as possible. Where that does not help, it is tried again
 * after twice as long. */
static drape_status take_apart(drape_sim *sim)
{
    drape_realtime_memory *m = sim->realtime;
    const int64_t before = m->crossings;
    const double now = drape_sim_time(sim);
    if (before == 0 || lets_cloth_pass(sim) || now < m->apart_at)
        return DRAPE_OK;
    const drape_status status = drape_sim_untangle_some(sim, SWEEPS);
    if (status)
        return status;
    count_crossings(sim, false);
    m->apart_wait = m->crossings < before ? 0 : fmax(m->dt, 2 * m->apart_wait);
    m->apart_at = now + m->apart_wait;
    return DRAPE_OK;
}

/* ---- The end of a call ---- */

/* What is so whether or not the call made a step. */
static void report_present(const drape_sim *sim, drape_realtime *report)
{
    const drape_realtime_memory *m = sim->realtime;
    report->time = drape_sim_state(sim)->t;
    report->error_bound = drape_sim_error_bound(sim);
    if (!m)
        return;
    report->debt = m->debt;
    report->behind = m->behind;
    report->inaccurate_total = m->inaccurate;
    report->dropped_total = m->dropped;
}

/* Time that was not covered is owed to the next call, or dropped. */
static void settle(drape_sim *sim, double goal, const drape_catch_up *rates, drape_realtime *report)
{
    drape_realtime_memory *m = sim->realtime;
    double left = goal - drape_sim_state(sim)->t;
    const double most = longest_step(sim->realtime);
    m->debt = left > DRAPE_SAME * m->dt ? fmin(left, most) : 0;
    report->dropped = left > most ? left - most : 0;
    m->dropped += report->dropped;
    drape_sim_fall_behind(sim, rates, left, report->dropped);
    m->stretched = report->h > (1 + DRAPE_SAME) * m->dt || m->debt > 0;
    /* After a rejection the cap is the largest step that was accepted in the call or, if none was, half of
     * the rejected one. It doubles after each call without rejections. */
    if (report->rejected == 0)
        m->cap = m->cap < m->longest ? 2 * m->cap : INFINITY;
    else if (report->h > 0)
        m->cap = report->h;
    count_crossings(sim, m->unchecked || lets_cloth_pass(sim));
    m->crossed += m->crossings > 0;
    report->crossings = m->crossings;
    report->accurate = report->h > 0 && report->held == 0 && report->crossings == 0 &&
                       !(report->error > report->error_bound);
    m->inaccurate += !report->accurate;
    report_present(sim, report);
}

static drape_status check_arguments(drape_sim *sim, double frame_dt, double budget)
{
    if (!(frame_dt > 0 && frame_dt <= 1e6))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_advance_realtime: frame_dt = %g s; it is in (0, 1e6]", frame_dt);
    if (!(budget >= 0 && budget <= 1e9))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_advance_realtime: budget = %g s; it is 0 to 1e9", budget);
    if (sim->chosen.integrator->steady_state)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_advance_realtime: the integrator \"%s\" makes no steps in time",
                          sim->chosen.integrator->entry.name);
    return DRAPE_OK;
}

drape_status drape_sim_advance_realtime(drape_sim *sim, double frame_dt, double budget, drape_realtime *out)
{
    drape_realtime report = {.level = "full", .residual = NAN, .error = NAN, .error_bound = NAN};
    double start = drape_clock_seconds();
    if (sim)
        report_present(sim, &report);
    if (out)
        *out = report; /* of a call that is refused */
    drape_status guarded = drape_sim_guard(sim, "drape_sim_advance_realtime");
    if (guarded)
        return guarded;
    sim->ctx->message[0] = 0;
    drape_status status = check_arguments(sim, frame_dt, budget);
    sim->advancing = true;
    if (!status)
        status = drape_sim_untangle_start(sim);
    if (!status)
        status = drape_realtime_rescue.open(sim);
    double owed = frame_dt;
    drape_catch_up rates = {false, 1, 1};
    if (!status) {
        drape_realtime_memory *m = sim->realtime;
        if (!m->active) {
            m->active = true;
            m->cap = INFINITY;
            m->crossings = sim->model->contact.self ? drape_sim_intersections(sim, -1) : 0;
            m->dt = drape_chosen_integrator_value(&sim->chosen, "dt", 1 / sim->frame_rate);
            m->longest = sim->realtime_step > 0 ? fmax(sim->realtime_step, m->dt) : STRETCH * m->dt;
        }
        owed += sim->realtime->debt;
        status = drape_sim_catch_up(sim, owed, &rates);
    }
    if (!status)
        status = take_apart(sim);
    if (!status) {
        const double goal = drape_sim_state(sim)->t + owed;
        sim->realtime->unchecked = false;
        sim->realtime->meets = false;
        plan p;
        if (!plan_effort(sim, owed, budget, &p))
            p = plan_stretched(sim, owed, frame_dt, budget);
        drape_realtime_set_effort(sim, p.effort);
        if (p.steps > 0) {
            /* The end of the call and, if the sim counts steps, their size h; integrators and controllers
             * that choose their own steps continue to do so. */
            drape_schedule *s = &sim->schedule;
            if (s->stepping == DRAPE_STEPS_COUNTED)
                drape_schedule_init(s, s->stepping, p.h, drape_sim_state(sim)->t);
            drape_schedule_aim(s, goal);
            status = take_steps(sim, &p, start, budget, &report);
        }
        settle(sim, goal, &rates, &report);
        report.level = sim->realtime->stretched    ? "larger steps"
                       : sim->realtime->effort > 0 ? "fewer iterations"
                                                   : "full";
        report.effort = sim->realtime->effort;
        report.relaxed = drape_sim_relaxed_now(sim, &report.deepest_relaxed);
        report.seconds = drape_clock_seconds() - start;
        report.kept = report.seconds <= budget;
    }
    sim->advancing = false;
    if (out)
        *out = report;
    return status;
}

void drape_realtime_leave(drape_sim *sim)
{
    drape_realtime_memory *m = sim->realtime;
    if (!m->active)
        return;
    m->active = m->stretched = false;
    m->debt = m->behind = m->pins_behind = 0;
    drape_realtime_set_effort(sim, 0);
    if (sim->chosen.integrator->set_deadline)
        sim->chosen.integrator->set_deadline(sim->integrator, INFINITY);
    if (sim->schedule.stepping == DRAPE_STEPS_COUNTED)
        drape_schedule_init(&sim->schedule, sim->schedule.stepping, m->dt, drape_sim_state(sim)->t);
}
