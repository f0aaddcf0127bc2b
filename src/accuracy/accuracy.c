/* accuracy.c: see accuracy.h. */
#include "accuracy/accuracy.h"

#include "accuracy/refinement.h"
#include "base/elementary.h"
#include "geometry/deviation.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define LEAST    1e-8 /* shares of a diagonal: what differs by less is rounding of long sums */
#define ROUNDING 1e-9 /* of the duration */

/* One run of the model. */
typedef struct trial {
    struct accurate *of;
    drape_sim *sim;         /* NULL: there is none */
    double *x;              /* (frames x nodes x 3) [m] */
    int64_t frames, wanted; /* that there are; after which it rests, while it is compared with */
    drape_status status;    /* with which it ended */
    bool compares;          /* with the one before */
    bool rests, given_up, over;
} trial;

typedef struct accurate {
    drape_context *ctx;
    const drape_model *model;
    drape_run_prepare *prepare;
    void *user;
    drape_arena arena;
    drape_deviation apart;
    drape_refinement refinement;
    double end;
    int64_t most;            /* frames */
    double *largest, *times; /* (most) how far apart the last two runs are until each [1], [s] */
    trial trials[2], *now, *before, dropped; /* the last: given up, but the host still has its sim */
    drape_accuracy *report;
} accurate;

static double work_of(const drape_sim *sim)
{
    const drape_statistics s = drape_sim_statistics(sim);
    return (double)s.residuals + 4 * (double)s.factorizations;
}

/* ---- Comparison ---- */

/* How far the runs are apart at most, in units of what is asked of each cloth, times `accuracy` of the
 * refinement. */
static double largest(const accurate *a)
{
    double most = 0;
    for (int32_t c = 0; c < a->model->cloth_count; c++)
        most = fmax(most, a->apart.cloths[c].largest.rms /
                              drape_distance_of(&a->model->accuracy, a->model->cloths[c].diagonal));
    return a->refinement.accuracy * most;
}

static void advance_trial(trial *t, int64_t frames)
{
    t->wanted = frames;
    while (!t->over && t->frames < frames) {
        t->rests = false;
        const drape_status status = drape_sim_advance(t->sim, t->of->end);
        t->over = !t->rests;
        t->status = t->over ? status : DRAPE_OK;
    }
}

/* Takes in frame k of the present run. Whether it may go on. */
static bool compare(accurate *a, double t, int64_t k)
{
    const size_t n = 3 * (size_t)a->model->node_count;
    trial *before = a->before;
    advance_trial(before, k + 1);
    if (before->frames <= k)
        return true;
    drape_deviation_add(&a->apart, t, a->now->x + n * (size_t)k, before->x + n * (size_t)k);
    a->largest[k] = largest(a);
    a->times[k] = t;
    return largest(a) <= drape_refinement_hopeless(&a->refinement);
}

static drape_status watch(void *user, const drape_event *event)
{
    trial *t = user;
    accurate *a = t->of;
    const size_t n = 3 * (size_t)a->model->node_count;
    if (event->kind == DRAPE_EVENT_ATTEMPT && t == a->now && work_of(t->sim) > a->refinement.level.most &&
        !(a->apart.frames > 0 && drape_refinement_goes_on(&a->refinement, largest(a))))
        t->rests = t->given_up = true;
    if (event->kind == DRAPE_EVENT_FRAME && t->frames < a->most) {
        memcpy(t->x + n * (size_t)t->frames, event->positions, n * sizeof *t->x);
        t->frames++;
        if (t == a->now && t->compares)
            t->rests = t->rests || !compare(a, event->time, t->frames - 1);
        else if (t == a->before)
            t->rests = t->frames >= t->wanted;
    }
    return t->rests ? 1 : DRAPE_OK;
}

/* ---- Runs ---- */

static void end_trial(accurate *a, trial *t)
{
    if (t->sim)
        a->report->seconds += drape_sim_statistics(t->sim).wall_steps;
    drape_sim_destroy(&t->sim);
    drape_arena_release(&a->arena, t->x);
    *t = (trial){.of = a};
}

static drape_sim_def def_of(const drape_sim_def *given, const drape_level *level, drape_setting *setting)
{
    drape_sim_def def = *given;
    *setting = (drape_setting){.name = level->key, .number = level->value};
    def.integrator = level->method;
    def.integrator_settings = setting;
    def.integrator_setting_count = 1;
    def.controller = "halving";
    return def;
}

/* Begins the run of the refinement's level, as a->now. */
static drape_status begin_trial(accurate *a, const drape_sim_def *given)
{
    const drape_level *level = &a->refinement.level;
    drape_setting setting;
    const drape_sim_def def = def_of(given, level, &setting);
    trial *t = a->now;
    *t = (trial){.of = a, .compares = a->before->frames > 0};
    t->x = drape_arena_take(&a->arena, 3 * (size_t)a->model->node_count * (size_t)a->most, sizeof *t->x);
    drape_status status = t->x ? drape_sim_create(a->ctx, a->model, &def, &t->sim) : DRAPE_E_MEMORY;
    a->report->runs++;
    snprintf(a->report->method, sizeof a->report->method, "%s, %s %.3g", level->method, level->key,
             level->value);
    drape_deviation_restart(&a->apart);
    if (!status)
        status = a->prepare ? a->prepare(a->user, t->sim, a->report) : DRAPE_OK;
    if (t->sim)
        end_trial(a, &a->dropped);
    a->report->error = a->report->distance = a->report->worst = NAN;
    a->report->until = 0;
    a->report->reached = false;
    return status ? status : drape_sim_observe(t->sim, watch, t);
}

/* What the sim's observers of the host have seen is of a run that is not the last. */
static void leave_trial(trial *t)
{
    t->sim->observers[0] = watch;
    t->sim->observer_users[0] = t;
    t->sim->observer_count = 1;
}

/* What the runs that were made say of the last one; whole: it was not cut short. */
static void fill_report(accurate *a, bool whole)
{
    const int32_t c = drape_deviation_worst(&a->apart);
    const drape_deviation_cloth *cloth = &a->apart.cloths[c];
    const drape_apart *most = &cloth->largest;
    const double apart = largest(a),
                 share = apart > 0 ? drape_refinement_error(&a->refinement, apart, whole) / apart : 1;
    drape_accuracy *r = a->report;
    r->error = a->apart.frames > 0 ? share * most->rms / cloth->diagonal : NAN;
    r->distance = a->apart.frames > 0 ? share * most->rms : NAN;
    r->worst = a->apart.frames > 0 ? share * most->distance : NAN;
    r->cloth = c;
    r->node = most->node - a->model->cloths[c].first_node;
    r->time = most->time;
    memcpy(r->place, most->place[0], sizeof r->place);
    r->until = 0;
    for (int64_t k = 0; k < a->apart.frames && share * a->largest[k] <= a->refinement.accuracy; k++)
        r->until = a->times[k];
    r->reached = whole && a->apart.frames > 0 && share * apart <= a->refinement.accuracy;
    if (r->reached)
        r->until = a->end;
}

/* The last run has parted from the one before: nothing says any more where the cloth is, and what follows is
 * as good by the cheapest method that was tried. */
static drape_status go_on_cheaply(accurate *a, const drape_sim_def *given)
{
    const drape_level *fixed = &a->refinement.fixed;
    trial *t = a->now;
    drape_setting setting;
    drape_status status = DRAPE_OK;
    t->compares = t->rests = false;
    a->refinement.level.most = INFINITY;
    a->report->error = a->report->distance = a->report->worst = NAN; /* of the whole run */
    if (a->refinement.level.controlled) {
        const size_t used = strlen(a->report->method);
        const drape_sim_def def = def_of(given, fixed, &setting);
        status = drape_sim_advance(t->sim, drape_sim_time(t->sim)); /* frames of the last step */
        if (!status)
            status = drape_sim_continue_by(t->sim, &def);
        snprintf(a->report->method + used, sizeof a->report->method - used, "; from %.3g s on %s, dt %.3g",
                 drape_sim_time(t->sim), fixed->method, fixed->value);
    }
    return status ? status : drape_sim_advance(t->sim, a->end);
}

/* How far the runs would be apart at the end, if their distance grows on by the factor that it took on over
 * the last doubling: as where small differences grow exponentially. */
static double expect(const accurate *a, bool whole)
{
    const int64_t last = a->apart.frames - 1;
    int64_t k = last;
    if (last < 0)
        return NAN;
    if (whole || !(a->largest[last] > 0))
        return a->largest[last];
    while (k > 0 && 2 * a->largest[k] > a->largest[last])
        k--;
    const double doubling = fmax(a->times[last] - a->times[k], ROUNDING * a->end);
    return a->largest[last] * drape_pow(2, (a->end - a->times[last]) / doubling);
}

/* Compares the ends of both runs; false: one has not reached its end. */
static bool compare_ends(accurate *a)
{
    trial *before = a->before, *t = a->now;
    if (!t->compares || !t->over || t->status)
        return false;
    advance_trial(before, INT64_MAX);
    if (!before->over || before->status)
        return false;
    drape_deviation_add(&a->apart, a->end, drape_sim_positions(t->sim), drape_sim_positions(before->sim));
    a->largest[a->apart.frames - 1] = largest(a);
    a->times[a->apart.frames - 1] = a->end;
    return true;
}

/* One level after the other. */
static drape_status refine(accurate *a, const drape_sim_def *given)
{
    drape_status status = DRAPE_OK;
    for (bool more = true; more && !status;) {
        trial *t = a->now;
        status = begin_trial(a, given);
        if (status)
            return status;
        const drape_status ended = drape_sim_advance(t->sim, a->end), failure = t->rests ? DRAPE_OK : ended;
        t->over = !t->rests;
        t->status = failure;
        if (failure == DRAPE_E_STOPPED || failure == DRAPE_E_MEMORY || failure == DRAPE_E_FILE)
            return failure;
        const bool whole = compare_ends(a);
        if (a->before->status == DRAPE_E_STOPPED || a->before->status == DRAPE_E_MEMORY)
            return a->before->status;
        fill_report(a, whole);
        const double time =
            t->compares && a->apart.frames > 0 ? a->times[a->apart.frames - 1] : drape_sim_time(t->sim);
        const drape_level_result result = {.apart = a->apart.frames > 0 ? largest(a) : NAN,
                                           .expected = expect(a, whole),
                                           .fraction =
                                               whole || (!t->compares && !failure && t->over)
                                                   ? 1
                                                   : fmin(fmax(time / a->end, ROUNDING), 1 - ROUNDING),
                                           .work = work_of(t->sim),
                                           .failed = failure != DRAPE_OK,
                                           .given_up = t->given_up};
        more = drape_refinement_next(&a->refinement, &result);
        status = more ? DRAPE_OK : failure;
        if (more && (failure || t->given_up)) {
            a->dropped = *t;
            t->sim = NULL;
            t->x = NULL;
        } else if (more) {
            trial *old = a->before;
            leave_trial(t);
            end_trial(a, old);
            a->before = t;
            a->now = old;
        } else if (!status && t->rests)
            status = go_on_cheaply(a, given);
    }
    return status;
}

drape_status drape_accuracy_check_runs(drape_context *ctx, const drape_model *m)
{
    drape_chosen chosen;
    DRAPE_TRY(drape_choose(ctx, m, NULL, &chosen));
    const drape_integrator_ops *method = chosen.integrator;
    if (method->projects_contact || method->steady_state)
        return drape_fail_at(
            ctx, DRAPE_E_ARGUMENT, "/integrator/method",
            "\"%s\" does not converge to the motion of the model, so it has no accuracy; leave "
            "it out, and a method is chosen",
            method->entry.name);
    for (int32_t i = 0; i < m->event_count; i++)
        if (m->events[i].action == DRAPE_ACTION_STOP)
            return drape_fail_at(
                ctx, DRAPE_E_ARGUMENT, DRAPE_FORMAT("/events/%d/action", (int)i),
                "runs that an event stops have no common end to be compared at; leave \"stop\" "
                "out, and find the event in the results");
    if (m->part)
        return drape_fail_at(ctx, DRAPE_E_ARGUMENT, "/accuracy", "runs on several ranks are not repeated");
    return DRAPE_OK;
}

drape_status drape_accuracy_check(drape_context *ctx, const drape_model *m)
{
    const drape_distance *asked = &m->accuracy;
    if (!(asked->value > 0))
        return drape_fail_at(ctx, DRAPE_E_ARGUMENT, "/accuracy", "the scene asks for no accuracy");
    if (asked->value / (asked->is_share ? 1 : m->length) < LEAST)
        return drape_fail_at(
            ctx, DRAPE_E_ARGUMENT, "/accuracy",
            "%.3g%s is below what double precision gives: at least %.0e of a cloth's diagonal", asked->value,
            asked->is_share ? "" : " m", LEAST);
    return drape_accuracy_check_runs(ctx, m);
}

drape_status drape_run_accurately(drape_context *ctx, const drape_model *model, const drape_sim_def *def,
                                  drape_run_prepare *prepare, void *user, drape_sim **out,
                                  drape_accuracy *report)
{
    drape_sim_def own;
    if (!ctx || !model || !out || !report)
        return DRAPE_E_ARGUMENT;
    *out = NULL;
    *report = (drape_accuracy){.error = NAN, .distance = NAN, .worst = NAN};
    accurate a = {.ctx = ctx, .model = model, .prepare = prepare, .user = user, .report = report};
    a.end = model->duration;
    a.arena = drape_arena_of(ctx);
    a.now = &a.trials[0];
    a.before = &a.trials[1];
    a.most = (int64_t)floor(a.end * model->frame_rate * (1 + ROUNDING)) + 2; /* and the end */
    a.trials[0].of = a.trials[1].of = a.dropped.of = &a;
    drape_sim_def_init(&own, sizeof own);
    drape_status status = drape_accuracy_check(ctx, model);
    if (!status)
        status = drape_deviation_create(&a.arena, model, model, &a.apart);
    a.largest = drape_arena_take(&a.arena, (size_t)a.most + 1, sizeof *a.largest);
    a.times = drape_arena_take(&a.arena, (size_t)a.most + 1, sizeof *a.times);
    status = status ? status : drape_arena_status(&a.arena);
    if (!status) {
        const double size = drape_model_least_diagonal(model);
        drape_refinement_init(&a.refinement, model, size, drape_distance_of(&model->accuracy, size) / size);
        report->asked = a.refinement.accuracy;
        status = refine(&a, def ? def : &own);
    }
    /* where there is no other, the host has that of the run before, or one that was given up */
    trial *last = a.now->sim ? a.now : a.dropped.sim ? &a.dropped : a.before;
    *out = last->sim;
    last->sim = NULL;
    if (*out && (*out)->observer_count > 0 && (*out)->observers[(*out)->observer_count - 1] == watch)
        (*out)->observer_count--;
    end_trial(&a, &a.dropped);
    end_trial(&a, a.before);
    drape_arena_free(&a.arena);
    return status;
}
