/*
 * test_rejection.c: a rejected step leaves no trace. The state after it is that before it to the bit; the
 * accepted steps are those of a run that never tried the others; and a run that cannot succeed ends. How
 * steps fill their intervals is tested by entries/schedule.
 */
#include <jansson.h>
#include <unistd.h>

#include "base/context.h"
#include "control/control.h"
#include "drape/extend.h"
#include "io/recorder.h"
#include "io/summary.h"
#include "support/bytes.h"
#include "support/scene.h"

#define MAX_STEPS 4000

static const char *const fixed_rows[] = {"be", "bdf2", "midpoint", "trbdf2"};

/* ---- The record of a run ---- */

typedef struct record {
    drape_sim *sim;
    drape_attempt attempt[MAX_STEPS];
    double end[MAX_STEPS]; /* [s] time of the state after the attempt */
    uint64_t hash[MAX_STEPS];
    uint64_t before; /* hash of the state that the next attempt starts from */
    int count, accepted, rejected;
} record;

static drape_status keep_record(void *user, const drape_event *event)
{
    record *r = user;
    if (event->kind != DRAPE_EVENT_ATTEMPT)
        return DRAPE_OK;
    ck_assert(r->count < MAX_STEPS);
    const drape_attempt *a = event->attempt;
    const uint64_t hash = drape_sim_hash(r->sim);
    ck_assert_int_eq(a->index, r->count);
    ck_assert_msg(a->accepted || hash == r->before, "attempt %d, rejected for %s, changed the state",
                  r->count, a->reason);
    ck_assert_msg(!a->accepted || hash != r->before, "attempt %d was accepted and changed nothing", r->count);
    r->attempt[r->count] = *a;
    r->end[r->count] = drape_sim_time(r->sim);
    r->hash[r->count] = r->before = hash;
    r->accepted += a->accepted;
    r->rejected += !a->accepted;
    r->count++;
    return DRAPE_OK;
}

static record *watch(scene *s)
{
    static record r;
    memset(&r, 0, sizeof r);
    r.sim = s->sim;
    r.before = drape_sim_hash(s->sim);
    ck_assert_int_eq(drape_sim_observe(s->sim, keep_record, &r), DRAPE_OK);
    return &r;
}

/* ---- Scenes ---- */

/*
 * A sheet of 7 edges a side that swings on two corners, at a step far too long for plain Newton. All sizes
 * are powers of two, so that parts of a step are exact.
 */
#define STEP 0.125 /* [s] */

static scene swinging(const char *integrator, const char *controller)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 7, 'edge_length': 0.1},"
        "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
        "'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 0.01}],"
        "'pins': [{'nodes': [0, 7]}]}],"
        "'integrator': {'method': '%s', 'dt': %g, 'globalization': 'none'}, 'controller': {%s}, 'duration': "
        "2}",
        integrator, STEP, controller);
}

/* ---- Halving ---- */

/* Repeats the steps that halving accepted with the controller that never halves: the same states, to the
 * bit. */
static void repeat_without_rejections(const char *integrator, const record *r)
{
    scoped_scene s = swinging(integrator, "'type': 'fixed'");
    for (int i = 0; i < r->count; i++)
        if (r->attempt[i].accepted) {
            scene_advance(&s, r->end[i]);
            ck_assert_msg(drape_sim_hash(s.sim) == r->hash[i], "%s: the state at %.9g s", integrator,
                          r->end[i]);
        }
    ck_assert_int_eq(drape_sim_statistics(s.sim).steps_rejected, 0);
}

TEST(a_run_with_rejections_is_the_run_of_its_accepted_steps)
{
    for (size_t k = 0; k < sizeof fixed_rows / sizeof *fixed_rows; k++) {
        scoped_scene s = swinging(fixed_rows[k], "'type': 'halving'");
        record *r = watch(&s);
        scene_advance(&s, 2);
        printf("# %s: %d accepted, %d rejected\n", fixed_rows[k], r->accepted, r->rejected);
        ck_assert_int_gt(r->rejected, 0);
        repeat_without_rejections(fixed_rows[k], r);
    }
}

/*
 * One node is moved onto its neighbour: every step that reaches it is too long, and the message must say
 * when, why and which edge.
 */
TEST(a_step_that_gets_too_small_names_time_reason_and_element)
{
    char expected[200];
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 4, 'edge_length': 0.1},"
        "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge'],"
        "'pins': [{'nodes': [0]}, {'nodes': [1], 'track': [[0, [0, 0, 0]], [0.25, [-0.1, 0, 0]]]}]}],"
        "'integrator': {'method': 'midpoint', 'dt': 0.0625}, 'controller': {'dt_min': 1e-4}, 'duration': 1}");
    record *r = watch(&s);
    ck_assert_int_eq(drape_sim_advance(s.sim, 1), DRAPE_E_STEP_TOO_SMALL);
    const drape_attempt *last = &r->attempt[r->count - 1];
    /* The halves of the interval are 2^-4 2^-k; 2^-13 is the last one that is not below dt_min. */
    ck_assert(last->h == ldexp(1, -13) && drape_sim_time(s.sim) == 0.25 - last->h);
    snprintf(expected, sizeof expected, "t=%.9g h=%.4g: edge_collapse (retry_degenerate) after ",
             drape_sim_time(s.sim), last->h);
    const char *message = drape_context_message(s.ctx);
    ck_assert_msg(strncmp(message, expected, strlen(expected)) == 0, "%s", message);
    ck_assert_msg(strstr(message, "; stretch.edge 0 (nodes 0 1 of cloth0): edge length / rest length = "),
                  "%s", message);
}

/* ---- A bound on attempts ---- */

#define MAX_ATTEMPTS 2 /* within one dt */

/* Checks the message; the sim is in the state of the last accepted attempt. */
static void check_bound(const scene *s, const record *r, drape_status status)
{
    double t, since;
    char expected[200];
    const drape_attempt *last = &r->attempt[r->count - 1];
    const char *message = drape_context_message(s->ctx);
    ck_assert_msg(status == DRAPE_E_STEP_TOO_SMALL, "%s", message);
    snprintf(expected, sizeof expected, " h=%.4g: %s (%s) after %d iterations; 2 attempts since t=", last->h,
             last->reason, drape_status_name(last->status), last->iterations);
    const char *found = strstr(message, expected);
    ck_assert_msg(found && !strchr(message, '\n'), "%s, not %s", message, expected);
    ck_assert_int_eq(sscanf(message, "t=%lf", &t), 1);
    ck_assert_int_eq(sscanf(found + strlen(expected), "%lf did not", &since), 1);
    ck_assert_double_le(since, t);
    ck_assert_double_lt(t - since, STEP);
    ck_assert_double_le(fabs(t - drape_sim_time(s->sim)), 1e-8);
    ck_assert(drape_sim_hash(s->sim) == r->before);
}

/* Advances to `end`, however often the bound stops it. After every second stop, s is restored from its own
 * checkpoint; `other` continues from that of the last stop. */
static int advance_bounded(scene *s, scene *other, double end)
{
    record *r = watch(s);
    int stops = 0;
    for (drape_status status = drape_sim_advance(s->sim, end); status;
         status = drape_sim_advance(s->sim, end)) {
        const int count = r->count;
        check_bound(s, r, status);
        bytes saved = bytes_save(s->sim);
        ck_assert_msg(!drape_sim_restore_from(other->sim, saved.data, saved.size), "%s",
                      drape_context_message(other->ctx));
        if (++stops % 2)
            ck_assert_msg(!drape_sim_restore_from(s->sim, saved.data, saved.size), "%s",
                          drape_context_message(s->ctx));
        free(saved.data);
        ck_assert_msg(count > 0 && stops < 1000, "%s", drape_context_message(s->ctx));
    }
    for (int left = stops + 1000; drape_sim_advance(other->sim, end); left--)
        ck_assert_int_gt(left, 0);
    return stops;
}

/* Each advance tries at most max_attempts steps within one dt; a host that advances again and again, or
 * continues from a checkpoint, gets the bits of a run without a bound. */
TEST(a_bound_on_attempts_ends_the_advance_and_changes_no_bit)
{
    static const char *const controllers[] = {"'type': 'halving'", "'type': 'strain', 'max_stretch': 0.05",
                                              "'type': 'error', 'rtol': 1e-4"};
    for (size_t k = 0; k < sizeof controllers / sizeof *controllers; k++) {
        scoped_scene plain = swinging("be", controllers[k]), s = swinging("be", controllers[k]),
                     other = swinging("be", controllers[k]);
        s.sim->max_attempts = other.sim->max_attempts = MAX_ATTEMPTS;
        scene_advance(&plain, 1);
        const int stops = advance_bounded(&s, &other, 1);
        printf("# %s: %d stops\n", controllers[k], stops);
        ck_assert_int_gt(stops, 0);
        ck_assert(drape_sim_hash(s.sim) == drape_sim_hash(plain.sim));
        ck_assert(drape_sim_hash(other.sim) == drape_sim_hash(plain.sim));
    }
}

/*
 * Flight at 1 m/s, and a last step of 0.17 us at a tolerance of 1e-13 N: the inertia M v/h of a node, about
 * 1e4 N, is rounded to 1e-12. A residual of that size is not a failure, and half the step would double it.
 */
TEST(a_residual_of_rounding_is_converged)
{
    int rounded = 0;
    for (size_t k = 0; k < sizeof fixed_rows / sizeof *fixed_rows; k++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 4, 'edge_length': 0.1},"
            "'material': {'young_modulus': 1e3, 'thickness': 1e-3, 'density': 200}, 'terms': "
            "['stretch.edge'],"
            "'velocity': [1, 0.7, -0.3]}], 'controller': {'type': 'fixed'}, 'duration': 1,"
            "'integrator': {'method': '%s', 'dt': 0.0625, 'tolerance': 1e-13}}",
            fixed_rows[k]);
        record *r = watch(&s);
        scene_advance(&s, 0.0625);
        scene_advance(&s, 0.0625 + 1.7e-7);
        for (int i = 0; i < r->count; i++) {
            const drape_attempt *a = &r->attempt[i];
            const bool rounding = strcmp(a->reason, "rounding") == 0;
            rounded += rounding;
            ck_assert(rounding || strcmp(a->reason, "converged") == 0);
            ck_assert(a->residual <= a->tolerance && (a->tolerance == 1e-13) == !rounding);
            ck_assert(a->tolerance < 1e-9);
        }
    }
    ck_assert_int_gt(rounded, 0);
}

/* Two nodes in one place: the residual is NaN, and the message does not print it as a number. */
TEST(a_nan_residual_is_not_printed)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 4, 'edge_length': 0.1},"
        "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge'],"
        "'pins': [{'nodes': [0]}, {'nodes': [1], 'track': [[0, [0, 0, 0]], [0.25, [-0.1, 0, 0]]]}]}],"
        "'integrator': {'method': 'be', 'dt': 0.0625, 'tolerance': 1e-6}, 'controller': {'type': 'fixed'}, "
        "'duration': 1}");
    ck_assert_int_eq(drape_sim_advance(s.sim, 1), DRAPE_E_SOLVER);
    const char *message = drape_context_message(s.ctx);
    ck_assert_msg(strstr(message, "edge_collapse") && !strstr(message, "nan"), "%s", message);
}

static drape_status stop_at_once(void *user, const drape_event *event)
{
    (void)user, (void)event;
    return DRAPE_E_STOPPED;
}

/* An observer may stop without a message; then the message of an earlier failure must not appear. */
TEST(the_message_of_an_earlier_failure_is_not_repeated)
{
    scoped_scene s = swinging("be", "'type': 'halving'");
    ck_assert_int_eq(drape_sim_advance(s.sim, NAN), DRAPE_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(drape_context_message(s.ctx), "not finite"));
    ck_assert_int_eq(drape_sim_observe(s.sim, stop_at_once, NULL), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(s.sim, 1), DRAPE_E_STOPPED);
    ck_assert_str_eq(drape_context_message(s.ctx), "t=0: an observer stopped the run with e_stopped");
}

/* There is nothing to solve, and pins follow their tracks: node 3 rises by 0.05 m in 0.5 s. */
TEST(without_free_nodes_pins_move)
{
    for (int i = 0; drape_integrators[i]; i++) {
        if (drape_integrators[i]->steady_state)
            continue;
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 1, 'edge_length': 0.1},"
            "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': "
            "['stretch.edge'],"
            "'pins': [{'nodes': [0, 1, 2]}, {'nodes': [3], 'track': [[0, [0, 0, 0]], [0.5, [0, 0.05, 0]],"
            "[1, [0, 0.01, 0]]]}]}], 'integrator': {'method': '%s'}, 'duration': 2}",
            drape_integrators[i]->entry.name);
        const double before = drape_sim_positions(s.sim)[10];
        scene_advance(&s, 0.5);
        ck_assert_double_lt(fabs(drape_sim_positions(s.sim)[10] - before - 0.05), 1e-15);
    }
}

/* Without free nodes ida has no equations to solve, but still stops at the keys of the tracks: steps that
 * could be longer end there. */
TEST(ida_without_free_nodes_stops_at_kinks)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 1, 'edge_length': 0.1},"
        "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge'],"
        "'pins': [{'nodes': [0, 1, 2]}, {'nodes': [3], 'track': [[0, [0, 0, 0]], [0.5, [0, 0.05, 0]],"
        "[1, [0, 0.01, 0]]]}]}], 'integrator': {'method': 'ida', 'max_step': 10}, 'duration': 2}");
    record *r = watch(&s);
    scene_advance(&s, 2);
    ck_assert_int_eq(r->count, 3);
    ck_assert(r->end[0] == 0.5 && r->end[1] == 1 && r->end[2] == 2);
}

/* ---- Strain ---- */

/*
 * The largest change of an edge's length over its rest length, and the largest displacement of a node over
 * its shortest edge (here all edges are alike).
 */
static void largest(const scene *s, const double *from, double *stretch, double *move)
{
    const drape_model *m = s->model;
    const double *to = drape_sim_positions(s->sim);
    *stretch = *move = 0;
    for (int32_t e = 0; e < m->edge_count; e++) {
        const size_t a = 3 * (size_t)m->edge[2 * e], b = 3 * (size_t)m->edge[2 * e + 1];
        double length[2] = {0, 0};
        for (size_t k = 0; k < 3; k++) {
            length[0] += pow(from[b + k] - from[a + k], 2);
            length[1] += pow(to[b + k] - to[a + k], 2);
        }
        *stretch = fmax(*stretch, fabs(sqrt(length[1]) - sqrt(length[0])) / m->edge_length[e]);
    }
    for (int32_t i = 0; i < m->node_count; i++)
        *move = fmax(*move, sqrt(pow(to[3 * i] - from[3 * i], 2) + pow(to[3 * i + 1] - from[3 * i + 1], 2) +
                                 pow(to[3 * i + 2] - from[3 * i + 2], 2)) /
                                m->edge_length[0]);
}

static void run_strain(const char *settings, double max_stretch, double max_move, const char *reason,
                       int nodes)
{
    char controller[100];
    double from[3 * 64], stretch, move;
    int refused = 0;
    snprintf(controller, sizeof controller, "'type': 'strain', %s", settings);
    scoped_scene s = swinging("be", controller);
    record *r = watch(&s);
    for (int k = 1; k <= 8; k++) { /* one nominal step at a time */
        const int before = r->count;
        memcpy(from, drape_sim_positions(s.sim), sizeof from);
        scene_advance(&s, k * STEP);
        if (r->count != before + 1)
            continue;
        largest(&s, from, &stretch, &move);
        ck_assert(stretch <= max_stretch && move <= max_move);
    }
    for (int i = 0; i < r->count; i++) {
        const drape_attempt *a = &r->attempt[i];
        if (a->accepted || a->status != DRAPE_RETRY_REJECTED)
            continue;
        refused++;
        ck_assert_str_eq(a->reason, reason);
        ck_assert(a->diagnostic.value > a->diagnostic.limit && a->diagnostic.cloth == 0 &&
                  a->diagnostic.element == -1);
        for (int n = 0; n < 4; n++)
            ck_assert((a->diagnostic.node[n] >= 0) == (n < nodes));
    }
    ck_assert_int_gt(refused, 0);
}

TEST(strain_names_the_edge_or_the_node_that_went_too_far)
{
    run_strain("'max_stretch': 0.002, 'max_move': 1e6", 0.002, 1e6, "stretch", 2);
    run_strain("'max_stretch': 1e6, 'max_move': 0.5", 1e6, 0.5, "move", 1);
}

/* ---- Error ---- */

/* Sizes fall after every rejection, and no refused state occurs again. */
TEST(the_error_controller_never_tries_a_refused_size_again)
{
    for (size_t k = 0; k < sizeof fixed_rows / sizeof *fixed_rows; k++) {
        scoped_scene s = swinging(fixed_rows[k], "'type': 'error', 'rtol': 1e-3");
        record *r = watch(&s);
        scene_advance(&s, 0.5);
        printf("# %s: %d accepted, %d rejected\n", fixed_rows[k], r->accepted, r->rejected);
        ck_assert_int_gt(r->rejected, 0);
        for (int i = 0; i + 1 < r->count; i++)
            if (!r->attempt[i].accepted)
                ck_assert(r->attempt[i + 1].h <= 0.9 * r->attempt[i].h &&
                          r->attempt[i + 1].t == r->attempt[i].t);
    }
}

/* For the first step there is no estimate of the error in velocities; at tight tolerances the run must
 * still start and continue. At rtol 1e-10 be needs about 0.5 us a step. */
TEST(the_error_controller_starts_at_tight_tolerances)
{
    for (size_t k = 0; k < sizeof fixed_rows / sizeof *fixed_rows; k++)
        for (int digits = 7; digits <= 10; digits += 3) {
            scoped_scene s = swinging(fixed_rows[k], "'type': 'error'");
            drape_sim_destroy(&s.sim);
            drape_sim_def def = sim_def();
            const drape_setting rtol = {"rtol", pow(10, -digits), NULL};
            def.controller = "error";
            def.controller_settings = &rtol;
            def.controller_setting_count = 1;
            scene_start(&s, &def);
            scene_advance(&s, 2e-4);
        }
}

static const drape_controller_ops *controller_named(const char *name)
{
    return drape_controllers[drape_registry_find(&drape_controller_registry, NULL, name)];
}

/*
 * A solution with NaN has an estimate of NaN: it is refused whenever it occurs, until the step is too small.
 */
TEST(an_estimate_that_is_not_a_number_is_refused_until_it_ends)
{
    static const double wrongs[] = {NAN, INFINITY, -INFINITY};
    const drape_controller_ops *ops = controller_named("error");
    scoped_scene s = swinging("be", "");
    double values[DRAPE_MAX_PARAMS];
    for (int i = 0; i < ops->entry.param_count; i++)
        values[i] = ops->entry.params[i].default_value;
    for (size_t k = 0; k < 3; k++) {
        drape_state *out = &s.sim->states[s.sim->next];
        double scratch[2] = {0, 0}, h = 1;
        int attempts = 0;
        memcpy(out->x, drape_sim_positions(s.sim), 3 * (size_t)s.model->node_count * sizeof *out->x);
        memset(out->v, 0, 3 * (size_t)s.model->node_count * sizeof *out->v);
        out->v[3 * 20 + 1] = wrongs[k];
        for (;;) {
            drape_step_info info = {.reason = DRAPE_REASON_CONVERGED, .h = h};
            drape_trial trial = {.model = s.model,
                                 .in = scene_state(&s),
                                 .out = out,
                                 .order = 1,
                                 .scratch = scratch,
                                 .h = h,
                                 .info = &info};
            out->t = h;
            attempts++;
            const drape_verdict verdict = ops->judge(values, &trial);
            ck_assert_int_eq(info.reason, DRAPE_REASON_ERROR_TEST);
            ck_assert(verdict != DRAPE_ACCEPT);
            if (verdict == DRAPE_STOP) {
                ck_assert_int_eq(trial.stop, DRAPE_E_STEP_TOO_SMALL);
                break;
            }
            ck_assert(trial.h_next <= h / 2);
            h = trial.h_next;
        }
        /* from 1 s to dt_min = 1e-7 s at least by halves */
        ck_assert_int_le(attempts, 24);
        ck_assert(scratch[0] == 0); /* a refused estimate does not change the controller's memory */
    }
}

/* ---- Runaway ---- */

/* A force on every node without an energy: per mass, a [m/s2] along y, or -c v. */
static double push, negative_drag;

static drape_status build(const drape_cloth_view *cloth, const double *params, drape_term_builder *builder)
{
    (void)params;
    drape_status status = drape_term_reserve(builder, cloth->node_count, 1);
    for (int32_t i = 0; !status && i < cloth->node_count; i++)
        drape_term_set(builder, i, &i, &cloth->node_mass[i]);
    return status;
}

static void lie(const drape_elements *el, int32_t first, int32_t count, const double *x,
                const double *internal, double *e, double *g, double *hess)
{
    (void)x, (void)internal, (void)hess;
    for (int32_t i = 0; i < count; i++) {
        if (e)
            e[i] = 0;
        if (g) {
            memset(g + 3 * i, 0, 3 * sizeof *g);
            g[3 * i + 1] = -el->rest[first + i] * push;
        }
    }
}

static void spur(const drape_elements *el, int32_t first, int32_t count, const double *x, const double *v,
                 double *g, double *dg_dx, double *dg_dv)
{
    (void)x;
    for (int32_t i = 0; i < count; i++) {
        const double c = -negative_drag * el->rest[first + i];
        for (int k = 0; g && k < 3; k++)
            g[3 * i + k] = c * v[3 * (size_t)el->node[first + i] + (size_t)k];
        if (dg_dx)
            memset(dg_dx + 9 * i, 0, 9 * sizeof *dg_dx);
        for (int k = 0; dg_dv && k < 9; k++)
            dg_dv[9 * i + k] = k % 4 == 0 ? c : 0;
    }
}

static const drape_term_ops liar = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "host.lie", .summary = "a force that is not the slope of its energy", .reference = "-"},
    .element_name = "node",
    .nodes = 1,
    .linear = true,
    .build = build,
    .energy = lie};
static const drape_term_ops spurs = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "host.spur", .summary = "drag of the wrong sign", .reference = "-"},
    .element_name = "node",
    .nodes = 1,
    .build = build,
    .dissipation = spur};

static scene flying(const drape_term_ops *term, const char *integrator, double speed)
{
    char text[600];
    scene s = scene_empty();
    drape_scene *parsed = NULL;
    ck_assert_int_eq(drape_context_add_term(s.ctx, term), DRAPE_OK);
    snprintf(text, sizeof text,
             "{\"drape\": 1, \"cloth\": [{\"mesh\": {\"grid\": \"equilateral\", \"edges\": 2, "
             "\"edge_length\": 0.1},"
             "\"material\": {\"young_modulus\": 1e5, \"thickness\": 1e-3, \"density\": 200},"
             "\"terms\": [\"%s\"], \"velocity\": [%g, 0, 0]}], \"gravity\": [0, 0, 0],"
             "\"integrator\": {\"method\": \"%s\", \"dt\": 0.0625}, \"duration\": 1}",
             term->entry.name, speed, integrator);
    drape_status status = drape_scene_parse(s.ctx, text, "test", &parsed);
    if (!status)
        status = drape_scene_compile(parsed, &s.model);
    assert_ok(s.ctx, status);
    drape_scene_destroy(&parsed);
    scene_start(&s, NULL);
    return s;
}

/*
 * From rest, all the kinetic energy from a force without an energy is from nowhere, at any step size: the
 * check must refuse it, and the run must end.
 */
TEST(kinetic_energy_from_nowhere_is_refused)
{
    for (size_t k = 0; k < sizeof fixed_rows / sizeof *fixed_rows; k++) {
        push = 5;
        scoped_scene s = flying(&liar, fixed_rows[k], 0);
        record *r = watch(&s);
        ck_assert_int_eq(drape_sim_advance(s.sim, 1), DRAPE_E_STEP_TOO_SMALL);
        ck_assert_int_eq(r->accepted, 0);
        /* 2^-4 s 2^-k >= 1e-7 s: k to 19, and the first attempt */
        ck_assert_int_eq(r->rejected, 20);
        for (int i = 0; i < r->count; i++) {
            ck_assert_str_eq(r->attempt[i].reason, "energy");
            ck_assert_int_eq(r->attempt[i].status, DRAPE_RETRY_REJECTED);
            ck_assert_double_eq_tol(r->attempt[i].diagnostic.value, 1, 1e-12); /* all of the energy */
        }
        ck_assert_msg(strstr(drape_context_message(s.ctx), ": energy (retry_rejected) after "), "%s",
                      drape_context_message(s.ctx));
    }
}

/*
 * A smaller force on a sheet in flight at 10 m/s adds 2 m/s2 x 1/16 s to it a step, in a second 1/2 m (2
 * m/s)^2, a 25th of its energy: it is not a runaway, and the audit has it as a gain.
 */
TEST(a_slow_gain_is_no_runaway)
{
    push = 2;
    scoped_scene s = flying(&liar, "be", 10);
    record *r = watch(&s);
    const double before = drape_sim_energy(s.sim).kinetic;
    scene_advance(&s, 1);
    const drape_energy e = drape_sim_energy(s.sim);
    ck_assert_int_eq(r->rejected, 0);
    ck_assert_double_eq_tol(-e.numerical, e.kinetic - before, 1e-12 * e.kinetic);
}

/*
 * After a longer time it is one: the run may gain a tenth of its available energy, which is the initial 1/2
 * m v0^2 and, in a scene without gravity, 1/2 m L^2/s^2, L the diagonal. 1/2 m (a t)^2 reaches that at t,
 * which halving finds to dt_min.
 */
TEST(a_slow_gain_ends_the_run_when_it_is_large)
{
    push = 5;
    scoped_scene s = flying(&liar, "be", 10);
    record *r = watch(&s);
    const double length = s.model->length, at = sqrt(0.1 * (100 + length * length)) / push;
    ck_assert_int_eq(drape_sim_advance(s.sim, 3), DRAPE_E_STEP_TOO_SMALL);
    ck_assert_double_eq_tol(drape_sim_time(s.sim), at, 1e-6);
    for (int i = 0; i < r->count; i++)
        ck_assert(r->attempt[i].accepted || strcmp(r->attempt[i].reason, "energy") == 0);
    const char *message = drape_context_message(s.ctx);
    ck_assert_msg(strstr(message, "energy gained since its minimum / energy available to the run = 0.1"),
                  "%s", message);
}

/*
 * midpoint on a sheet whose stretch waves the step does not resolve: a converged step may add far more
 * elastic energy than the sheet, which falls by less than its diagonal L, can have had. No state is
 * accepted that gains more than half of the available energy in all: m g L and the 1/2 m g L of the scene.
 */
TEST(elastic_energy_from_nowhere_is_refused)
{
    int64_t count = 0, refused = 0;
    const char *reason;
    double lowest = 0, mass = 0;
    scoped_scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 8, 'edge_length': 0.1},"
                   "'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'density': 200},"
                   "'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'nodes': [0, 8]}]}],"
                   "'integrator': {'method': 'midpoint'}, 'duration': 3}");
    for (int32_t i = 0; i < s.model->node_count; i++)
        mass += s.model->mass[i];
    for (int k = 1; k <= 90; k++) { /* the run may end before */
        const drape_status status = drape_sim_advance(s.sim, k / 60.0);
        ck_assert(status == DRAPE_OK || status == DRAPE_E_STEP_TOO_SMALL);
        lowest = fmin(lowest, drape_sim_energy(s.sim).numerical);
        if (status)
            break;
    }
    for (int i = 0; (reason = drape_sim_reason(s.sim, i, &count)); i++)
        refused += strcmp(reason, "energy") == 0 ? count : 0;
    printf("# %.3g J gained, %lld steps refused for it\n", -lowest, (long long)refused);
    ck_assert_int_gt(refused, 0);
    ck_assert(-lowest <= 0.5 * 1.5 * mass * 9.81 * s.model->length);
}

/* A pin that jumps in 1 ps has, for that time, a kinetic energy of its own of 1e20 J. It is not part of the
 * audit, in which all other energies would be lost by rounding. */
TEST(a_jump_of_a_pin_is_no_energy_of_the_sheet)
{
    scoped_scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 4, 'edge_length': 0.1},"
                   "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
                   "'terms': ['stretch.edge'], 'pins': [{'nodes': [0]},"
                   "{'nodes': [4], 'track': [[0.1, [0, 0, 0]], [0.100000000001, [0.01, 0, 0]]]}]}],"
                   "'integrator': {'method': 'ida'}, 'duration': 1}");
    scene_advance(&s, 0.1);
    const drape_energy before = drape_sim_energy(s.sim);
    scene_advance(&s, 0.1000000000005);
    const drape_energy e = drape_sim_energy(s.sim);
    /* in the middle of the jump the pin has stretched its springs; the sheet has not moved. The work of the
     * pin, summed by the trapezoidal rule, is exact for springs that start without stretch. */
    ck_assert_double_eq_tol(e.kinetic, before.kinetic, 1e-6 * before.kinetic);
    assert_below(fabs(e.numerical - before.numerical), 0.01 * e.elastic);
}

/*
 * Drag of the wrong sign: v1 = v0/(1 - c h). With c h = 5/8 the kinetic energy grows 7 times in every step
 * of backward Euler. Its work is accounted as negative dissipation: no energy is from nowhere.
 */
TEST(energy_that_a_term_answers_for_is_no_runaway)
{
    negative_drag = 10;
    scoped_scene s = flying(&spurs, "be", 1);
    record *r = watch(&s);
    scene_advance(&s, 0.25);
    const drape_energy e = drape_sim_energy(s.sim);
    ck_assert_int_eq(r->accepted, 4);
    ck_assert_int_eq(r->rejected, 0);
    ck_assert_double_eq_tol(drape_sim_velocities(s.sim)[0], pow(1 - 0.625, -4), 1e-9 * pow(1 - 0.625, -4));
    ck_assert(e.dissipated < 0 && e.numerical > 0);
}

/* Without gravity a sheet at rest has only forces of rounding, whose 1e-30 J are not a runaway. */
TEST(a_sheet_at_rest_stays_at_rest)
{
    static const char *const methods[] = {"be", "bdf2", "midpoint", "ida"};
    for (size_t k = 0; k < 4; k++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 8, 'edge_length': 0.1},"
            "'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'density': 200},"
            "'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'nodes': [0, 8]}]}],"
            "'gravity': [0, 0, 0], 'integrator': {'method': '%s'}, 'duration': 3}",
            methods[k]);
        record *r = watch(&s);
        scene_advance(&s, 3);
        ck_assert_int_eq(r->rejected, 0);
    }
}

/* ---- What is written ---- */

static void count_line(void *user, drape_log_level level, const char *text)
{
    (void)level;
    ck_assert_ptr_nonnull(strstr(text, "step rejected, "));
    ck_assert_ptr_null(strchr(text, '\n'));
    ++*(int *)user;
}

TEST(a_rejection_is_one_line_of_the_hosts_log)
{
    int lines = 0;
    scoped_scene s = swinging("be", "'type': 'halving'");
    s.ctx->def.log = count_line;
    s.ctx->def.log_user = &lines;
    scene_advance(&s, 2);
    ck_assert_int_gt(lines, 0);
    ck_assert_int_eq(lines, drape_sim_statistics(s.sim).steps_rejected);
}

/*
 * A start below min_length can be left. An edge at 1e-7 of its length pushes its nodes apart with the force
 * k/L^2 (1 - 1e-7) L: in steps of 1e-7 s it grows by about 1e-8 of its length in the first one, so it is
 * below the limit of 1e-6 for several steps. With "fixed", the first rejected one would end the run.
 */
TEST(a_start_below_the_limit_is_left)
{
    for (size_t k = 0; k < sizeof fixed_rows / sizeof *fixed_rows; k++) {
        int below = 0;
        double ratio = 0;
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 3, 'edge_length': 0.1},"
            "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
            "'terms': ['stretch.edge'], 'pins': [{'nodes': [0]}]}],"
            "'integrator': {'method': '%s', 'dt': 1e-7}, 'controller': {'type': 'fixed'}, 'duration': 1}",
            fixed_rows[k]);
        double x[48];
        memcpy(x, drape_sim_positions(s.sim), sizeof x);
        for (int i = 0; i < 3; i++)
            x[3 * 5 + i] = x[3 * 6 + i] + 1e-7 * (x[3 * 5 + i] - x[3 * 6 + i]);
        ck_assert_int_eq(drape_sim_set_state(s.sim, 0, x, drape_sim_velocities(s.sim)), DRAPE_OK);
        for (int n = 1; ratio < 1e-3; n++) {
            double d = 0;
            ck_assert_int_lt(n, 10000);
            scene_advance(&s, 1e-7 * n);
            for (int i = 0; i < 3; i++)
                d += pow(drape_sim_positions(s.sim)[3 * 5 + i] - drape_sim_positions(s.sim)[3 * 6 + i], 2);
            ratio = sqrt(d) / 0.1;
            below += ratio < 1e-6;
        }
        printf("# %s: %d steps below the limit\n", fixed_rows[k], below);
        ck_assert_int_ge(below, 2);
    }
}
