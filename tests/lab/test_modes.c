/* test_modes.c: drape_sim_modes: eigenvalues that are known to rounding, motions without stiffness, states
 * that are unstable, repeated eigenvalues, what modes of a matrix have in common, refusals; memory
 * that fails, in drape_sim_path too. Loads at which strips buckle are references of `drape validate`. */
#include "drape/lab.h"
#include "lab/eigen.h"
#include "support/failing_allocator.h"
#include "support/scene.h"

#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846

static drape_modes find(scene *s, int32_t count, bool buckling, double load_factor)
{
    drape_modes_def def;
    drape_modes modes;
    drape_modes_def_init(&def, sizeof def);
    def.count = count;
    def.buckling = buckling;
    def.load_factor = load_factor;
    assert_ok(s->ctx, drape_sim_modes(s->sim, &def, &modes));
    ck_assert_int_eq(modes.count, count);
    return modes;
}

static void refuse(scene *s, drape_modes_def def, drape_status status, const char *text)
{
    drape_modes modes;
    memset(&modes, 0xA5, sizeof modes);
    ck_assert_int_eq(drape_sim_modes(s->sim, &def, &modes), status);
    ck_assert_msg(strstr(drape_context_message(s->ctx), text) != NULL, "%s", drape_context_message(s->ctx));
    ck_assert(modes.count == 0 && modes.modes == NULL && modes.own == NULL);
}

/* ---- A membrane of springs under tension ---- */

/* Springs of 10 N/m along both axes, stretched from 0.9/16 m to 1/16 m. */
static scene open_membrane(void)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 17, 'rows': 17, 'width': 1, "
        "'height': 1, 'diagonals': 'parallel'}, "
        "'material': {'young_modulus': 1, 'thickness': 1e-3, 'areal_density': 0.1}, "
        "'terms': [{'type': 'spring.structural', 'stiffness': 10, 'rest_scale': 0.9}], "
        "'pins': [{'edge': 'left'}, {'edge': 'right'}, {'edge': 'top'}, {'edge': 'bottom'}]}], "
        "'gravity': [0, 0, 0], 'integrator': {'method': 'static'}, 'duration': 1}");
}

/* Across the plane omega^2 = 4 T/m (sin^2 + sin^2) with T the tension over the length of a spring, and each
 * mode with m != n is there twice; along either axis of the plane, springs of that axis have k in place
 * of T. Each of some ten operations that make an entry of K rounds, relative to the largest eigenvalue,
 * 8 k/m. */
TEST(a_membrane_has_the_modes_of_its_lattice)
{
    static const struct {
        int m, n;
        bool in_plane;
    } expected[] = {{1, 1, false}, {1, 2, false}, {2, 1, false}, {2, 2, false}, {1, 3, false},
                    {3, 1, false}, {1, 1, true},  {1, 1, true},  {2, 3, false}, {3, 2, false}};
    scoped_scene s = open_membrane();
    drape_modes modes = find(&s, 10, false, 1);
    const double mass = 0.1 / 256, stiffness = 10, tension = stiffness * 0.1;
    for (int k = 0; k < 10; k++) {
        const double a = sin(expected[k].m * PI / 32), b = sin(expected[k].n * PI / 32);
        const double omega2 =
            4 / mass * ((expected[k].in_plane ? stiffness : tension) * a * a + tension * b * b);
        const drape_mode *mode = &modes.modes[k];
        assert_below(fabs(mode->value - omega2), 10 * DBL_EPSILON * 8 * stiffness / mass);
        ck_assert_int_eq(mode->kind, DRAPE_MODE_VIBRATION);
        ck_assert_double_eq_tol(mode->frequency, sqrt(omega2) / (2 * PI), 1e-9);
        assert_below(mode->residual, 1e-12);
        assert_below(mode->error, 1e-10);
    }
    ck_assert_int_ge(modes.below, 10);
    drape_modes_free(&modes);
    ck_assert_ptr_null(modes.modes);
}

/* u_i'M u_j = 0, also of equal eigenvalues, and K u = value M u, with K by differences of forces. */
TEST(modes_are_orthogonal_and_satisfy_the_equation)
{
    scoped_scene s = open_membrane();
    drape_modes modes = find(&s, 6, false, 1);
    const size_t n = 3 * (size_t)s.model->node_count;
    for (int a = 0; a < 6; a++)
        for (int b = 0; b < 6; b++) {
            double sum = 0;
            for (size_t i = 0; i < n; i++)
                sum += s.model->mass[i / 3] * modes.modes[a].shape[i] * modes.modes[b].shape[i];
            const double scale = sqrt(modes.modes[a].mass * modes.modes[b].mass);
            ck_assert_double_eq_tol(sum / scale, a == b, 1e-10);
        }
    double *x = malloc(n * sizeof *x), *g = malloc(2 * n * sizeof *g), *v = calloc(n, sizeof *v);
    const double h = 1e-4; /* of the length of a spring 2e-3: the difference errs by its square */
    for (int a = 0; a < 6; a++) {
        const drape_mode *mode = &modes.modes[a];
        double largest = 0;
        for (int side = 0; side < 2; side++) {
            for (size_t i = 0; i < n; i++)
                x[i] = s.model->rest[i] + (side ? h : -h) * mode->shape[i];
            const drape_point point = {.x = x, .v = v, .internal = scene_state(&s)->internal};
            drape_system_force(s.sim->system, &point, g + (size_t)side * n);
        }
        for (size_t i = 0; i < n; i++) {
            const double force = s.model->pinned[i / 3] ? 0 : (g[n + i] - g[i]) / (2 * h);
            largest = fmax(largest, fabs(force - mode->value * s.model->mass[i / 3] * mode->shape[i]));
        }
        assert_below(largest, 1e-4 * mode->value * 0.1 / 256);
    }
    free(x);
    free(g);
    free(v);
    drape_modes_free(&modes);
}

/* A search may find an eigenvector of an equal pair only; the next finds the other. Of diag(1, 2, 2, 3 ...)
 * with known vectors e_0 and e_1, e_2 must be among the largest of 1/diag that are left. */
static drape_status invert(void *user, const double *x, double *y)
{
    const double *diagonal = user;
    for (int i = 0; i < 60; i++)
        y[i] = x[i] / diagonal[i];
    return DRAPE_OK;
}

static void same(void *user, const double *x, double *y)
{
    (void)user;
    memcpy(y, x, 60 * sizeof *y);
}

TEST(what_is_known_is_not_found_again)
{
    double diagonal[60], known[2 * 60] = {0}, value[4], vector[4 * 60];
    int32_t found;
    scoped_scene s = scene_empty();
    for (int i = 0; i < 60; i++)
        diagonal[i] = i < 2 ? 1 + i : i;
    known[0] = known[60 + 1] = 1;
    const lab_operator op = {60, diagonal, invert, same};
    const lab_known before = {2, known, known};
    ck_assert_int_eq(lab_eigen(s.ctx, &op, &before, 4, &found, value, vector), DRAPE_OK);
    ck_assert_int_eq(found, 4);
    for (int k = 0; k < 4; k++) {
        ck_assert_double_eq_tol(value[k], 1.0 / (k + 2), 1e-12);
        ck_assert_double_eq_tol(fabs(vector[60 * k + k + 2]), 1, 1e-6);
        ck_assert_double_eq_tol(vector[60 * k] + vector[60 * k + 1], 0, 1e-12);
    }
}

/* ---- Without stiffness, and unstable ---- */

TEST(a_free_sheet_has_six_motions_without_stiffness)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 9, 'rows': 9, 'width': 1, "
        "'height': 1}, 'material': {'young_modulus': 1e5, 'poisson_ratio': 0.3, 'thickness': 0.005, "
        "'areal_density': 0.1}, 'terms': ['stretch.cst', 'bend.midedge']}], 'gravity': [0, 0, 0], "
        "'integrator': {'method': 'static'}, 'duration': 1}");
    drape_modes modes = find(&s, 8, false, 1);
    for (int k = 0; k < 8; k++) {
        ck_assert_int_eq(modes.modes[k].kind, k < 6 ? DRAPE_MODE_ZERO : DRAPE_MODE_VIBRATION);
        ck_assert((modes.modes[k].frequency > 0) == (k >= 6));
        ck_assert(isinf(modes.modes[k].error) == (k < 6));
    }
    drape_modes_free(&modes);
}

/* The sim is as it was: its bits after a further step are those without the reading. */
TEST(reading_modes_changes_nothing)
{
    static const char text[] =
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 6, 'width': 0.5, 'height': "
        "0.5, 'transform': {'translate': [0, 0.004, 0]}}, 'material': {'young_modulus': 1e4, 'thickness': "
        "1e-3, 'areal_density': 0.2}, 'terms': ['stretch.edge', 'bend.hinge']}], "
        "'colliders': [{'type': 'sphere', 'center': [0.25, -0.3, 0.25], 'radius': 0.3, 'friction': 0.3}], "
        "'integrator': {'method': 'be', 'dt': 0.01}, 'duration': 1}";
    uint64_t hash[2];
    for (int reads = 0; reads < 2; reads++) {
        scoped_scene s = scene_open("%s", text);
        scene_advance(&s, 0.1);
        if (reads) {
            drape_modes modes = find(&s, 3, false, 1);
            ck_assert(isfinite(modes.modes[0].value));
            drape_modes_free(&modes);
        }
        scene_advance(&s, 0.2);
        hash[reads] = drape_sim_hash(s.sim);
    }
    ck_assert(hash[0] == hash[1]);
}

/* ---- Refusals ---- */

TEST(wrong_requests_are_refused)
{
    scoped_scene s = open_membrane();
    drape_modes_def def, good;
    drape_modes modes;
    drape_modes_def_init(&good, sizeof good);
    drape_modes_def_init(NULL, sizeof good);
    drape_modes_free(NULL);
    ck_assert_int_eq(drape_sim_modes(NULL, &good, &modes), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_sim_modes(s.sim, &good, NULL), DRAPE_E_ARGUMENT);
    def = good;
    def.count = 0;
    refuse(&s, def, DRAPE_E_ARGUMENT, "count = 0");
    def.count = 3 * s.model->free_count;
    refuse(&s, def, DRAPE_E_ARGUMENT, "at most 674 modes");
    def = good;
    def.load_factor = -1;
    refuse(&s, def, DRAPE_E_ARGUMENT, "load_factor = -1");
    def = good;
    def.buckling = true;
    refuse(&s, def, DRAPE_E_ARGUMENT, "no load deforms the cloth");
    scene_close(&s);
    s = scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 2, 'rows': 2, 'width': 1, "
                   "'height': 1}, 'material': {'young_modulus': 1, 'thickness': 1e-3, 'areal_density': 1}, "
                   "'terms': ['stretch.edge'], 'pins': [{'edge': 'top'}, {'edge': 'bottom'}]}], "
                   "'duration': 1}");
    refuse(&s, good, DRAPE_E_ARGUMENT, "all nodes are pinned");
    scene_close(&s);
    s = scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': 1, "
                   "'height': 1}, 'material': {'young_modulus': 1, 'thickness': 1e-3, 'areal_density': 1}, "
                   "'terms': ['stretch.edge', {'type': 'air.added_mass', 'span': 1}], 'pins': [{'edge': "
                   "'top'}]}], 'duration': 1}");
    refuse(&s, good, DRAPE_E_ARGUMENT, "the mass matrix depends on the shape");
}

/* Slack cloth without bending has no stiffness across its plane: more equal modes than can be separated
 * are not reported as found. */
TEST(too_many_equal_modes_are_a_failure)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 12, 'rows': 12, 'width': 1, "
        "'height': 1}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.1}, "
        "'terms': ['stretch.cst'], 'pins': [{'edge': 'top'}]}], 'gravity': [0, 0, 0], 'duration': 1}");
    drape_modes_def def;
    drape_modes_def_init(&def, sizeof def);
    refuse(&s, def, DRAPE_E_SOLVER, "is not known");
}

static drape_status vibrations(drape_sim *sim)
{
    drape_modes_def def;
    drape_modes modes;
    drape_modes_def_init(&def, sizeof def);
    def.count = 2;
    const drape_status status = drape_sim_modes(sim, &def, &modes);
    drape_modes_free(&modes);
    return status;
}

static drape_status buckling_loads(drape_sim *sim)
{
    drape_modes_def def;
    drape_modes modes;
    drape_modes_def_init(&def, sizeof def);
    def.count = 2;
    def.buckling = true;
    def.load_factor = 0;
    const drape_status status = drape_sim_modes(sim, &def, &modes);
    drape_modes_free(&modes);
    return status;
}

static drape_status path(drape_sim *sim)
{
    drape_path_def def;
    drape_path_def_init(&def, sizeof def);
    def.max_points = 3;
    return drape_sim_path(sim, &def);
}

/* Every allocation fails once: each failure is reported, and nothing leaks. */
TEST(memory_that_fails_is_reported)
{
    static const struct {
        drape_status (*run)(drape_sim *sim);
        double gravity; /* [m/s2] along y: upwards, the sheet buckles */
    } runs[] = {{vibrations, 1e-6}, {buckling_loads, 1e-6}, {path, -1e-3}};
    for (size_t r = 0; r < sizeof runs / sizeof *runs; r++)
        for (long at = 1, done = 0; !done; at++) {
            failing_allocator memory = {0};
            drape_context *ctx = failing_context(&memory);
            drape_scene *parsed = NULL;
            drape_model *model = NULL;
            drape_sim *sim = NULL;
            char text[500];
            snprintf(
                text, sizeof text,
                "{\"drape\": 1, \"cloth\": [{\"mesh\": {\"grid\": \"square\", \"columns\": 4, \"rows\": 4, "
                "\"width\": 1, \"height\": 1}, \"material\": {\"young_modulus\": 1e4, \"thickness\": "
                "1e-2, \"areal_density\": 0.1}, \"terms\": [\"stretch.cst\", \"bend.midedge\"], "
                "\"pins\": [{\"edge\": \"top\", \"clamp\": true}]}], \"gravity\": [0, %g, 0], "
                "\"duration\": 1}",
                runs[r].gravity);
            ck_assert_int_eq(drape_scene_parse(ctx, text, "test", &parsed), DRAPE_OK);
            ck_assert_int_eq(drape_scene_compile(parsed, &model), DRAPE_OK);
            ck_assert_int_eq(drape_sim_create(ctx, model, NULL, &sim), DRAPE_OK);
            const long live = memory.live;
            memory.calls = 0;
            memory.fail_at = at;
            const drape_status status = runs[r].run(sim);
            done = memory.calls < at;
            memory.fail_at = 0;
            ck_assert_msg(status == (done ? DRAPE_OK : DRAPE_E_MEMORY), "allocation %ld: %s", at,
                          drape_context_message(ctx));
            ck_assert_int_eq(memory.live, live);
            drape_sim_destroy(&sim);
            drape_model_destroy(&model);
            drape_scene_destroy(&parsed);
            drape_context_destroy(&ctx);
            ck_assert_int_eq(memory.live, 0);
        }
}

static bool stop(void *user)
{
    return ++*(int *)user > 0;
}

TEST(a_search_can_be_cancelled)
{
    int calls = -1000000;
    drape_context_def context = context_def();
    context.cancel = stop;
    context.cancel_user = &calls;
    scene s = {0}, like = open_membrane();
    ck_assert_int_eq(drape_context_create(&context, &s.ctx), DRAPE_OK);
    drape_sim_def def = sim_def();
    ck_assert_int_eq(drape_sim_create(s.ctx, like.model, &def, &s.sim), DRAPE_OK);
    calls = -2; /* in the third product with the operator */
    drape_modes_def modes;
    drape_modes_def_init(&modes, sizeof modes);
    refuse(&s, modes, DRAPE_E_STOPPED, "cancelled");
    drape_sim_destroy(&s.sim);
    drape_context_destroy(&s.ctx);
    scene_close(&like);
}
