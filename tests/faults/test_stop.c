/* test_stop.c: an observer stops an advance at a step or at a frame. The state is that of the last accepted
 * step, the sim continues from there, and no frame is lost, repeated or out of order. */
#include "support/scene.h"

#define STEPS 40

static const char falling[] =
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 3, 'edge_length': 0.1},"
    " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge'],"
    " 'pins': [{'corner': 'top-left'}]}],"
    " 'integrator': {'dt': %g%s}, 'controller': {'type': '%s'}, 'frame_rate': %g, 'duration': 1}";

/* What an observer has seen, and when it stops the advance. */
typedef struct watcher {
    drape_event_kind kind;
    long at, events; /* stops at the event of this kind and number, counted from 1 */
    drape_status answer;
    const char *message;
    drape_context *ctx;
    long attempts, frames;
    double frame_time[256], frame_y[256]; /* frame_y: height of the last node */
    uint64_t hash;                        /* hash of the state at the last attempt */
} watcher;

static drape_status watch(void *user, const drape_event *event)
{
    watcher *w = user;
    if (event->kind == DRAPE_EVENT_FRAME) {
        ck_assert_int_eq(event->frame, w->frames);
        ck_assert_int_lt(w->frames, 256);
        w->frame_time[w->frames] = event->time;
        w->frame_y[w->frames++] = event->positions[3 * 15 + 1];
    } else {
        w->attempts++;
        w->hash = drape_sim_hash(event->sim);
    }
    if (event->kind != w->kind || ++w->events != w->at)
        return DRAPE_OK;
    if (w->message)
        drape_context_set_message(w->ctx, "%s", w->message);
    return w->answer;
}

static scene open_watched(double dt, double rate, watcher *w)
{
    scene s = scene_open(falling, dt, "", "halving", rate);
    w->ctx = s.ctx;
    ck_assert_int_eq(drape_sim_observe(s.sim, watch, w), DRAPE_OK);
    return s;
}

/* The run without a stop. */
static watcher reference(double dt, double rate, uint64_t *hash)
{
    watcher w = {.at = -1};
    scoped_scene s = open_watched(dt, rate, &w);
    scene_advance(&s, STEPS * dt);
    *hash = drape_sim_hash(s.sim);
    return w;
}

/* Stops at every event of a kind in turn, and continues. */
static void check_stops(drape_event_kind kind, double dt, double rate)
{
    uint64_t hash;
    watcher whole = reference(dt, rate, &hash);
    long events = kind == DRAPE_EVENT_ATTEMPT ? whole.attempts : whole.frames;
    ck_assert_int_gt(events, 3);
    for (long at = 1; at <= events; at++) {
        watcher w = {.kind = kind, .at = at, .answer = DRAPE_RETRY_REJECTED};
        scoped_scene s = open_watched(dt, rate, &w);
        ck_assert_int_eq(drape_sim_advance(s.sim, STEPS * dt), DRAPE_E_STOPPED);
        ck_assert_msg(strstr(drape_context_message(s.ctx), "an observer asked to stop"), "%s",
                      drape_context_message(s.ctx));
        ck_assert_int_ge(w.events, at); /* further frames of the step in which it stopped may follow */
        if (w.attempts > 0)
            ck_assert_uint_eq(drape_sim_hash(s.sim), w.hash);
        ck_assert_int_eq(drape_sim_statistics(s.sim).steps_accepted, w.attempts);
        scene_advance(&s, STEPS * dt);
        ck_assert_uint_eq(drape_sim_hash(s.sim), hash);
        ck_assert_int_eq(w.attempts, whole.attempts);
        ck_assert_int_eq(w.frames, whole.frames);
        for (long f = 0; f < w.frames; f++) {
            ck_assert_double_eq(w.frame_time[f], whole.frame_time[f]);
            ck_assert_msg(w.frame_y[f] == whole.frame_y[f],
                          "stopped at %s %ld: frame %ld (t=%g) is at %.17g, without a stop at %.17g",
                          kind == DRAPE_EVENT_ATTEMPT ? "attempt" : "frame", at, f, w.frame_time[f],
                          w.frame_y[f], whole.frame_y[f]);
        }
    }
}

TEST(stops_at_a_step_and_goes_on)
{
    check_stops(DRAPE_EVENT_ATTEMPT, 0.01, 60);
    check_stops(DRAPE_EVENT_ATTEMPT, 0.01, 100);
}

TEST(stops_at_a_frame_and_goes_on)
{
    check_stops(DRAPE_EVENT_FRAME, 0.01, 60);
    check_stops(DRAPE_EVENT_FRAME, 0.01, 100);
    check_stops(DRAPE_EVENT_FRAME, 0.01, 370);
}

TEST(a_negative_answer_is_returned_with_its_message)
{
    for (int kind = 0; kind < 2; kind++) {
        watcher w = {
            .kind = (drape_event_kind)kind, .at = 3, .answer = DRAPE_E_FILE, .message = "the disk\nis full"};
        scoped_scene s = open_watched(0.01, 60, &w);
        ck_assert_int_eq(drape_sim_advance(s.sim, 1), DRAPE_E_FILE);
        ck_assert_str_eq(drape_context_message(s.ctx), "the disk is full");
        ck_assert_double_eq_tol(drape_sim_time(s.sim), kind == DRAPE_EVENT_ATTEMPT ? 0.03 : 0.04, 1e-15);
    }
}

/* A stop at a rejected attempt leaves the state before it. */
TEST(stops_at_a_rejected_step)
{
    watcher w = {.kind = DRAPE_EVENT_ATTEMPT, .at = 1, .answer = DRAPE_RETRY_REJECTED};
    scoped_scene s = scene_open(falling, 0.05, ", 'max_iterations': 1", "halving", 60.0);
    w.ctx = s.ctx;
    ck_assert_int_eq(drape_sim_observe(s.sim, watch, &w), DRAPE_OK);
    uint64_t start = drape_sim_hash(s.sim);
    ck_assert_int_eq(drape_sim_advance(s.sim, 0.2), DRAPE_E_STOPPED);
    ck_assert_int_eq(drape_sim_statistics(s.sim).steps_accepted, 0);
    ck_assert_int_eq(drape_sim_statistics(s.sim).steps_rejected, 1);
    ck_assert_uint_eq(drape_sim_hash(s.sim), start);
    ck_assert_double_eq(drape_sim_time(s.sim), 0);
}

/* Observers registered before the one that stops are notified, later ones are not. */
TEST(observers_are_notified_in_order)
{
    watcher before = {.at = -1},
            stops = {.kind = DRAPE_EVENT_ATTEMPT, .at = 4, .answer = DRAPE_RETRY_REJECTED},
            after = {.at = -1};
    scoped_scene s = scene_open(falling, 0.01, "", "halving", 60.0);
    ck_assert_int_eq(drape_sim_observe(s.sim, watch, &before), DRAPE_OK);
    ck_assert_int_eq(drape_sim_observe(s.sim, watch, &stops), DRAPE_OK);
    ck_assert_int_eq(drape_sim_observe(s.sim, watch, &after), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(s.sim, 1), DRAPE_E_STOPPED);
    ck_assert_int_eq(before.attempts, 4);
    ck_assert_int_eq(stops.attempts, 4);
    ck_assert_int_eq(after.attempts, 3);
}

/* ---- Stops at a time, in every integrator ---- */

#define END 0.4 /* [s] */

typedef struct timer {
    double stop;   /* [s] stops after the first accepted step that ends at it or later; NaN: never */
    double before; /* [s] end of the step before that */
    uint64_t hash; /* hash of the state where it stopped */
    bool stopped;
} timer;

static drape_status stop_at_time(void *user, const drape_event *event)
{
    timer *w = user;
    if (event->kind != DRAPE_EVENT_ATTEMPT || !event->attempt->accepted || w->stopped)
        return DRAPE_OK;
    w->hash = drape_sim_hash(event->sim);
    if (!(drape_sim_time(event->sim) >= w->stop)) {
        w->before = drape_sim_time(event->sim);
        return DRAPE_OK;
    }
    w->stopped = true;
    return DRAPE_RETRY_REJECTED;
}

static scene open_integrator(const char *integrator, const char *controller, const char *more, timer *w)
{
    scene s = scene_model(falling, 0.025, more, controller, 60.0);
    drape_sim_def def = sim_def();
    def.integrator = integrator;
    scene_start(&s, &def);
    ck_assert_int_eq(drape_sim_observe(s.sim, stop_at_time, w), DRAPE_OK);
    return s;
}

/* After a stop at a time the state is that of the last accepted step and does not change. Advancing to the
 * same end gives the bits of the run without a stop, even if it stopped between two halves of an interval. */
static void check_time_stops(const char *integrator, const char *controller, const char *more)
{
    timer never = {.stop = NAN};
    scoped_scene whole = open_integrator(integrator, controller, more, &never);
    scene_advance(&whole, END);
    const uint64_t end = drape_sim_hash(whole.sim);
    const int64_t rejected = drape_sim_statistics(whole.sim).steps_rejected;
    for (double t = 0.01; t < END; t += 0.013) {
        timer w = {.stop = t};
        scoped_scene s = open_integrator(integrator, controller, more, &w);
        ck_assert_int_eq(drape_sim_advance(s.sim, END), DRAPE_E_STOPPED);
        ck_assert(w.before < t && drape_sim_time(s.sim) >= t);
        ck_assert_uint_eq(drape_sim_hash(s.sim), w.hash);
        scene_advance(&s, drape_sim_time(s.sim)); /* no time to advance */
        ck_assert_uint_eq(drape_sim_hash(s.sim), w.hash);
        scene_close(&s);
        w = (timer){.stop = t};
        s = open_integrator(integrator, controller, more, &w);
        ck_assert_int_eq(drape_sim_advance(s.sim, END), DRAPE_E_STOPPED);
        scene_advance(&s, END);
        ck_assert_msg(drape_sim_hash(s.sim) == end, "%s, %s, stopped at %g s", integrator, controller, t);
        ck_assert_int_eq(drape_sim_statistics(s.sim).steps_rejected, rejected);
    }
    ck_assert(!*more || rejected > 0);
}

TEST(every_integrator_stops_at_a_time_and_continues)
{
    for (int i = 0; drape_integrators[i]; i++) {
        const drape_integrator_ops *ops = drape_integrators[i];
        if (ops->steady_state)
            continue;
        check_time_stops(ops->entry.name, "halving", "");
        if (ops->own_steps)
            continue;
        if (drape_param_find(ops->entry.params, ops->entry.param_count, "max_iterations") >=
            0) /* so that steps are rejected */
            check_time_stops(ops->entry.name, "halving", ", 'max_iterations': 3, 'globalization': 'none'");
        check_time_stops(ops->entry.name, "error", "");
    }
}
