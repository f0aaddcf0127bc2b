/*
 * test_ida.c: the integrator "ida": tolerances that bound the error, steps that depend on nothing else,
 * restarts, dense output.
 *
 * The sheet: 0.5 m x 0.4 m, pinned at two corners and pushed, soft enough (E h = 20 N/m) that its stretch
 * waves have periods above sqrt(m/(8 K)) 2 pi = 0.03 s, which steps resolve, and smooth up to rounding.
 */
#include "faults/host.h"
#include "integrators/first_order.h"
#include "support/scene.h"

#define LENGTH 0.6403124237432849 /* [m] diagonal, the length of the default tolerances */
#define END    0.3                /* [s] */

/* The text of a sheet, for printf: translation along x [m], more terms, pins, rtol, more settings after a
 * comma. */
#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 5, 'width': 0.5, 'height': "   \
    "0.4, "                                                                                                  \
    "'transform': {'translate': [%.17g, 0, 0]}},"                                                            \
    "'material': {'young_modulus': 2e4, 'thickness': 1e-3, 'areal_density': 0.2},"                           \
    "'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 1e-3}],"                  \
    "'velocity': [0.1, 0, 0.2], 'pins': [%s]}],"                                                             \
    "'integrator': {'method': 'ida', 'rtol': %g%s}, 'duration': 1}"

#define HUNG "{'corner': 'top-left'}, {'corner': 'top-right'}"
#define MOVED                                                                                                \
    "{'corner': 'top-left'}, {'corner': 'top-right', 'track': [[0.05, [0, 0, 0]], [0.1, [0, 0.03, 0]], "     \
    "[0.17, [-0.02, 0.03, 0.02]], [1, [-0.02, 0, 0]]]}"

static scene sheet(const char *pins, double rtol, const char *more)
{
    return scene_open(SHEET, 0.0, pins, rtol, more);
}

/* Root mean square of the distances over the nodes. */
static double distance(const scene *s, const double *a, const double *b)
{
    double sum = 0;
    for (size_t i = 0; i < 3 * (size_t)s->model->node_count; i++)
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(sum / s->model->node_count);
}

static double *positions_at(const char *pins, double rtol, const char *more, double t)
{
    scoped_scene s = sheet(pins, rtol, more);
    const size_t size = 3 * (size_t)s.model->node_count * sizeof(double);
    double *x = malloc(size);
    ck_assert_ptr_nonnull(x);
    scene_advance(&s, t);
    memcpy(x, drape_sim_positions(s.sim), size);
    return x;
}

/* ---- Tolerances ---- */

/* Over 1e-2 ... 1e-8 the error falls with rtol; no error exceeds twice the one before. BDF of order p takes
 * steps of rtol^(1/(p+1)), and its error at a time is that many local errors: rtol^(p/(p+1)), at least
 * rtol^(2/3) in order 2. Six decades of rtol are at least four of the error; one of these is allowed for
 * the loosest tolerances, where IDA is not yet in its asymptotic range. */
static void falls(const char *pins, int max_order)
{
    char order[40];
    double first = 0, before = INFINITY, *reference = positions_at(pins, 1e-10, ", 'max_order': 5", END);
    snprintf(order, sizeof order, ", 'max_order': %d", max_order);
    for (int k = 2; k <= 8; k++) {
        scoped_scene s = sheet(pins, pow(10, -k), order);
        scene_advance(&s, END);
        const double error = distance(&s, reference, drape_sim_positions(s.sim));
        printf("# max_order %d, rtol 1e-%d: error %.3g m, %lld steps\n", max_order, k, error,
               (long long)drape_sim_statistics(s.sim).steps_accepted);
        ck_assert_msg(error <= 2 * before, "rtol 1e-%d: error %g m, before %g m", k, error, before);
        first = k == 2 ? error : first;
        before = error;
    }
    assert_below(before, 1e-3 * first);
    free(reference);
}

TEST(error_falls_with_rtol_in_order_2)
{
    falls(HUNG, 2);
}

TEST(error_falls_with_rtol_in_order_5)
{
    falls(HUNG, 5);
}

static scene after(const char *more, double rtol)
{
    scene s = sheet(HUNG, rtol, more);
    scene_advance(&s, END);
    return s;
}

static uint64_t hash_after(const char *more, double rtol)
{
    scoped_scene s = after(more, rtol);
    const uint64_t hash = drape_sim_hash(s.sim);
    return hash;
}

static long long steps_after(const char *more, double rtol)
{
    scoped_scene s = after(more, rtol);
    const long long steps = drape_sim_statistics(s.sim).steps_accepted;
    return steps;
}

/* rtol stands for two weights and an order, and nothing else: with all three given, it has no effect; and
 * each of them has an effect of its own. */
TEST(atol_x_and_atol_v_are_the_weights)
{
    char all[160];
    snprintf(all, sizeof all, ", 'max_order': 2, 'atol_x': %.17g, 'atol_v': %.17g", 1e-4 * LENGTH,
             1e-4 * sqrt(9.81 * LENGTH));
    ck_assert(hash_after(all, 1e-4) == hash_after("", 1e-4));
    ck_assert(hash_after(all, 1e-6) == hash_after(all, 1e-2));
    const long long neither = steps_after(", 'max_order': 2, 'atol_x': 1e2, 'atol_v': 1e2", 1e-3),
                    tight_x = steps_after(", 'max_order': 2, 'atol_x': 1e-5, 'atol_v': 1e2", 1e-3),
                    tight_v = steps_after(", 'max_order': 2, 'atol_x': 1e2, 'atol_v': 1e-3", 1e-3);
    printf("# steps without bounds %lld, with one on positions %lld, with one on velocities %lld\n", neither,
           tight_x, tight_v);
    ck_assert_int_gt(tight_x, 2 * neither);
    ck_assert_int_gt(tight_v, 2 * neither);
}

/* Tolerances do not depend on the position of the scene. At 1000 m positions are rounded to 2^-44 = 5.7e-14
 * m, at the origin to 1e-16 m; that noise grows by the divergence of neighbouring runs (test_ida_full.c),
 * here by less than 1e4. Decisions to accept a step compare numbers that differ by as much: they are the
 * same except by accident. */
TEST(a_scene_far_away_takes_the_same_steps)
{
    const double far = 1000;
    static const int orders[] = {2, 5};
    for (int k = 0; k < 2; k++) {
        char order[40];
        double worst = 0;
        snprintf(order, sizeof order, ", 'max_order': %d", orders[k]);
        scoped_scene here = scene_open(SHEET, 0.0, HUNG, 1e-4, order),
                     there = scene_open(SHEET, far, HUNG, 1e-4, order);
        scene_watch(&here);
        scene_watch(&there);
        scene_advance(&here, END);
        scene_advance(&there, END);
        ck_assert_int_eq(here.accepted, there.accepted);
        ck_assert_int_eq(here.rejected, there.rejected);
        ck_assert_int_eq(drape_sim_statistics(here.sim).residuals, drape_sim_statistics(there.sim).residuals);
        ck_assert_int_eq(drape_sim_statistics(here.sim).jacobians, drape_sim_statistics(there.sim).jacobians);
        for (size_t i = 0; i < 3 * (size_t)here.model->node_count; i++)
            worst = fmax(worst, fabs(drape_sim_positions(there.sim)[i] - (i % 3 == 0 ? far : 0) -
                                     drape_sim_positions(here.sim)[i]));
        assert_below(worst, 1e4 * 5.7e-14);
    }
}

/* ---- Steps ---- */

/* Steps that an observer was notified of. */
typedef struct step_log {
    double t[4096], h[4096];
    int count;
} step_log;

static drape_status note_step(void *user, const drape_event *event)
{
    step_log *log = user;
    if (event->kind != DRAPE_EVENT_ATTEMPT || !event->attempt->accepted)
        return DRAPE_OK;
    ck_assert_int_lt(log->count, 4096);
    log->t[log->count] = event->attempt->t;
    log->h[log->count++] = event->attempt->h;
    return DRAPE_OK;
}

static step_log steps_of(scene *s, double end)
{
    step_log log = {.count = 0};
    ck_assert_int_eq(drape_sim_observe(s->sim, note_step, &log), DRAPE_OK);
    scene_advance(s, end);
    return log;
}

TEST(max_step_is_kept)
{
    const double limit = 7e-4;
    scoped_scene free_run = sheet(HUNG, 1e-2, ""), s = sheet(HUNG, 1e-2, ", 'max_step': 7e-4");
    const step_log log = steps_of(&s, 0.1), free_log = steps_of(&free_run, 0.1);
    ck_assert_double_gt(free_log.h[free_log.count / 2], 2 * limit); /* free steps are longer */
    for (int i = 0; i < log.count; i++) /* a step is the difference of two times of at most 0.1 s */
        ck_assert_double_le(log.h[i], limit + 0.1 * DBL_EPSILON);
    ck_assert_double_eq(drape_sim_time(s.sim), 0.1);
}

/* Two thousand steps of 1e-4 s end within their rounding errors of 0.2 s, but not there. */
TEST(an_advance_ends_at_its_end)
{
    scoped_scene s = sheet(HUNG, 1e-2, ", 'max_step': 1e-4");
    for (double end = 0.2; end < 0.4; end += 0.1) {
        scene_advance(&s, end);
        ck_assert_double_eq(drape_sim_time(s.sim), end);
    }
}

/* A step ends at every key within it, to the last bit, and the next one starts small: IDA has no history
 * there. Its first step is at most a thousandth of the time left, or 1/2 over the norm of the rates; here
 * less than a fifth of the step before. */
TEST(steps_end_at_kinks_and_start_anew)
{
    static const double kinks[] = {0.05, 0.1, 0.17};
    scoped_scene s = sheet(MOVED, 1e-4, "");
    step_log log = steps_of(&s, END);
    for (int k = 0; k < 3; k++) {
        int at = 0;
        while (at < log.count && log.t[at] != kinks[k])
            at++;
        ck_assert_msg(at < log.count, "no step begins at %g s", kinks[k]);
        printf("# kink at %g s: steps %g, %g before and %g after it\n", kinks[k], log.h[at - 2],
               log.h[at - 1], log.h[at]);
        ck_assert_double_lt(log.h[at], 0.2 * fmax(log.h[at - 2], log.h[at - 1]));
    }
}

/* ---- Ends and frames ---- */

typedef struct frame_log {
    double *x; /* (count x node_count x 3) */
    size_t size;
    int count;
} frame_log;

static drape_status note_frame(void *user, const drape_event *event)
{
    frame_log *log = user;
    if (event->kind != DRAPE_EVENT_FRAME)
        return DRAPE_OK;
    ck_assert_int_lt(log->count, 64);
    memcpy(log->x + (size_t)log->count++ * log->size, event->positions, log->size * sizeof(double));
    return DRAPE_OK;
}

/* Frames at 60/s, from dense output or from a run that stops at every frame. */
static frame_log frames(double rtol, const char *more, bool stop)
{
    scoped_scene s = sheet(MOVED, rtol, more);
    frame_log log = {.size = 3 * (size_t)s.model->node_count};
    log.x = malloc(64 * log.size * sizeof *log.x);
    ck_assert_ptr_nonnull(log.x);
    ck_assert_int_eq(drape_sim_observe(s.sim, note_frame, &log), DRAPE_OK);
    for (int k = 1; stop && k <= 60 * END; k++) {
        scene_advance(&s, k / 60.0);
        ck_assert(drape_sim_time(s.sim) == k / 60.0);
    }
    scene_advance(&s, END);
    ck_assert_int_eq(log.count, (int)(60 * END + 0.5) + 1);
    return log;
}

static double worst_frame(const frame_log *a, const frame_log *b)
{
    double worst = 0;
    for (int k = 0; k < a->count; k++) {
        double sum = 0;
        for (size_t i = 0; i < a->size; i++)
            sum += pow(a->x[(size_t)k * a->size + i] - b->x[(size_t)k * a->size + i], 2);
        worst = fmax(worst, sqrt(3 * sum / (double)a->size));
    }
    return worst;
}

/* Frames between steps are as accurate as steps that end there: both are within their errors of the
 * converged run. The dense output is the polynomial of the step, whose error is of the size of the local
 * error, atol_x, and is added. So an advance in pieces gives the same result within the tolerance, frame by
 * frame, and ends at the requested time. */
TEST(frames_are_what_a_run_that_stops_there_has)
{
    static const double rtols[] = {1e-3, 1e-4, 1e-6};
    frame_log converged = frames(1e-9, ", 'max_order': 5", true);
    for (int k = 0; k < 3; k++) {
        frame_log dense = frames(rtols[k], "", false), stopped = frames(rtols[k], "", true);
        const double error = worst_frame(&stopped, &converged);
        printf("# rtol %g: error of a run that stops at frames %.3g m, of one that does not %.3g m, "
               "difference %.3g m\n",
               rtols[k], error, worst_frame(&dense, &converged), worst_frame(&dense, &stopped));
        assert_below(worst_frame(&dense, &converged), 2 * error + rtols[k] * LENGTH);
        free(dense.x);
        free(stopped.x);
    }
    free(converged.x);
}

/* ---- Faults ---- */

static host_sim host_with_ida(double rtol)
{
    const drape_setting setting = {"rtol", rtol, NULL};
    drape_sim_def def = sim_def();
    host_sim s = host_open("", "'type': 'halving', 'dt_min': 1e-6", true);
    drape_sim_destroy(&s.sim);
    def.integrator = "ida";
    def.integrator_settings = &setting;
    def.integrator_setting_count = 1;
    ck_assert_int_eq(drape_sim_create(s.ctx, s.model, &def, &s.sim), DRAPE_OK);
    return s;
}

static double host_distance(const host_sim *s, const host_copy *from)
{
    double sum = 0;
    const int32_t nodes = drape_model_node_count(s->model);
    for (int32_t i = 0; i < 3 * nodes; i++)
        sum += pow(drape_sim_positions(s->sim)[i] - from->x[i], 2);
    return sqrt(sum / nodes);
}

/* One force or Hessian that is not finite, at the nth evaluation for every n except the first force, which
 * is that of the initial state, where no smaller step helps. IDA retries with a quarter of the step, or the
 * controller restarts it. The run completes with finite states, and its error is at most twice that of a
 * run with the same tolerance without the fault. */
TEST(one_fault_is_recovered_from)
{
    host_sim tight = host_with_ida(1e-9), good = host_with_ida(1e-4);
    ck_assert_int_eq(drape_sim_advance(tight.sim, 0.2), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(good.sim, 0.2), DRAPE_OK);
    const host_copy truth = host_copy_state(&tight);
    for (int kind = HOST_NAN_FORCE; kind <= HOST_INFINITE_HESSIAN; kind++) {
        double worst = 0;
        for (long n = 2; n <= 60; n++) {
            host_sim s = host_with_ida(1e-4);
            host_watch(&s);
            host_break((host_fault)kind, n, false);
            drape_status status = drape_sim_advance(s.sim, 0.2);
            ck_assert_msg(status == DRAPE_OK, "fault %d at %ld: %s", kind, n, drape_context_message(s.ctx));
            ck_assert(drape_sim_time(s.sim) == 0.2);
            ck_assert_int_eq(s.nonfinite, 0);
            worst = fmax(worst, host_distance(&s, &truth));
            host_close(&s);
        }
        assert_below(worst, 2 * host_distance(&good, &truth));
    }
    host_close(&good);
    host_close(&tight);
}

/* A fault that persists ends the run in the state before it, with the reason. */
TEST(a_fault_that_stays_ends_the_run)
{
    for (int kind = HOST_NAN_FORCE; kind <= HOST_INFINITE_FORCE; kind++) {
        host_sim s = host_with_ida(1e-3);
        host_watch(&s);
        ck_assert_int_eq(drape_sim_advance(s.sim, 0.05), DRAPE_OK);
        host_copy before = host_copy_state(&s);
        host_break((host_fault)kind, 1, true);
        ck_assert_int_eq(drape_sim_advance(s.sim, 1), DRAPE_E_STEP_TOO_SMALL);
        host_check_state(&s, &before);
        host_check_message(&s, "nonfinite");
        host_close(&s);
    }
}

/* ---- Work is bounded ---- */

/* The state after the last accepted attempt. */
typedef struct last_state {
    double t, h;
    uint64_t hash;
    long accepted;
} last_state;

static drape_status note_last(void *user, const drape_event *event)
{
    last_state *last = user;
    if (event->kind == DRAPE_EVENT_ATTEMPT && event->attempt->accepted)
        *last = (last_state){.t = drape_sim_time(event->sim),
                             .h = event->attempt->h,
                             .hash = drape_sim_hash(event->sim),
                             .accepted = last->accepted + 1};
    return DRAPE_OK;
}

#define MAX_STEPS 40 /* far fewer steps than the sheet needs for END at rtol 1e-6 */

/* One step too many ends the run with its reason, time, step size and largest error, in the last accepted
 * state. Each further advance may take as many steps again, and they are those of a run without the bound. */
TEST(too_many_steps_end_the_run)
{
    char message[100];
    int ends = 0;
    int64_t count = 0;
    last_state last = {0};
    scoped_scene s = sheet(HUNG, 1e-6, ", 'max_steps': 40");
    ck_assert_int_eq(drape_sim_observe(s.sim, note_last, &last), DRAPE_OK);
    while (drape_sim_advance(s.sim, END)) {
        ends++;
        ck_assert_int_lt(ends, 100);
        snprintf(message, sizeof message,
                 "t=%.9g h=%.4g: max_steps (e_step_too_small) after 0 iterations; worst "
                 "at (node ",
                 last.t, last.h);
        ck_assert_msg(!strncmp(drape_context_message(s.ctx), message, strlen(message)), "%s",
                      drape_context_message(s.ctx));
        ck_assert_ptr_nonnull(
            strstr(drape_context_message(s.ctx), " of cloth0): local error / tolerance = "));
        ck_assert_double_eq(drape_sim_time(s.sim), last.t);
        ck_assert_uint_eq(drape_sim_hash(s.sim), last.hash);
        ck_assert_int_eq(last.accepted, MAX_STEPS * ends);
        ck_assert_int_eq(drape_sim_statistics(s.sim).steps_rejected, ends);
    }
    printf("# %ld steps, ended %d times\n", last.accepted, ends);
    ck_assert_int_ge(ends, 2);
    ck_assert_str_eq(drape_sim_reason(s.sim, 0, &count), "max_steps");
    ck_assert_int_eq(count, ends);
    ck_assert_double_eq(drape_sim_time(s.sim), END);
    ck_assert_uint_eq(drape_sim_hash(s.sim), hash_after("", 1e-6));
}

/* The bound is on the steps that IDA chooses: a host may end more advances than that in a second of
 * simulated time, and the next second has a new count. */
TEST(steps_that_a_host_asks_for_are_not_counted)
{
    scene s = sheet(HUNG, 1e-2, ", 'max_steps': 100");
    for (int k = 1; k <= 300; k++)
        scene_advance(&s, 1e-4 * k);
    ck_assert_int_ge(drape_sim_statistics(s.sim).steps_accepted, 300);
    scene_close(&s);
    scoped_scene slow = sheet(HUNG, 1e-1, ", 'max_steps': 250, 'max_step': 0.01");
    scene_advance(&slow, 3);
    ck_assert_int_gt(drape_sim_statistics(slow.sim).steps_accepted, 250);
}

/* A host that adds up its times may request an advance by a rounding error, also where IDA restarts. IDA
 * would refuse that as too close; here it is not a step. */
TEST(an_advance_by_one_ulp_is_no_failure)
{
    scoped_scene s = sheet(MOVED, 1e-3, "");
    static const double times[] = {0.02, 0.05, 0.06};
    for (int k = 0; k < 3; k++) {
        scene_advance(&s, times[k]);
        scene_advance(&s, nextafter(times[k], 1));
        scene_advance(&s, times[k] + 1e-15);
    }
    scene_advance(&s, 0.1);
    ck_assert_double_eq(drape_sim_time(s.sim), 0.1);
}

/* ---- Predictions and effort ---- */

static int held_back;

/* Retreats, and looks at where it stands then. */
static bool retreat_and_look(void *user, N_Vector y)
{
    drape_first_order *f = user;
    drape_reason reason;
    drape_diagnostic pair;
    ck_assert(drape_system_crosses(f->system, f->x, f->t, &reason, &pair));
    ck_assert(drape_first_order_retreat(f, y));
    ck_assert(!drape_system_crosses(f->system, f->x, f->t, &reason, &pair));
    held_back++;
    return true;
}

/* A sheet that meets a floor, and a ball that meets the sheet, with a tolerance that allows steps many gaps
 * long. */
TEST(a_prediction_inside_a_collider_is_held_back)
{
    scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 6, 'width': 0.3, 'height': "
        "0.3, 'orientation': 'horizontal'}, 'material': {'young_modulus': 2e4, 'thickness': 1e-3, "
        "'areal_density': 0.2}, 'terms': ['stretch.edge', 'bend.hinge'], 'velocity': [0, -0.5, 0]}], "
        "'colliders': [{'type': 'plane', 'point': [0, -0.02, 0], 'normal': [0, 1, 0]}, {'type': 'sphere', "
        "'center': [0.15, 0.4, -0.15], 'radius': 0.05, 'track': [[0.2, [0, 0, 0]], [0.5, [0, -0.36, 0]]]}], "
        "'integrator': {'method': 'ida', 'rtol': 0.3}, 'duration': 1}");
    held_back = 0;
    ((drape_first_order *)s.sim->integrator)->newton.retreat = retreat_and_look;
    scene_advance(&s, 0.4);
    printf("# held back %d times\n", held_back);
    ck_assert_int_gt(held_back, 0);
    scene_close(&s);
}

/* A stiff hung sheet, whose longest steps need several matrices: at 1e-2 it took 1.6 times those of 1e-3. */
TEST(a_looser_tolerance_takes_no_more_matrices)
{
    long long matrices[2];
    for (int k = 0; k < 2; k++) {
        scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 13, 'rows': 13, 'width': 5, "
            "'height': 5, 'jitter': 0.25, 'seed': 1, 'orientation': 'horizontal'}, 'material': "
            "{'fabric': 'feng2022_6'}, 'terms': ['stretch.cst', "
            "'bend.midedge'], 'pins': [{'nodes': [0, 12]}]}], 'integrator': {'method': 'ida', 'rtol': %g}, "
            "'duration': 1}",
            k ? 1e-3 : 1e-2);
        scene_advance(&s, 0.7);
        matrices[k] = drape_sim_statistics(s.sim).factorizations;
        scene_close(&s);
    }
    printf("# %lld matrices at 1e-2, %lld at 1e-3\n", matrices[0], matrices[1]);
    ck_assert_int_le(matrices[0], 1.2 * matrices[1]);
}
