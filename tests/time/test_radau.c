/*
 * test_radau.c: the integrator "radau": its order, its stability function and its matrices.
 *
 * The sheet is that of test_order.c: stretch waves of at most 260/s, which steps of 5 ms and less resolve.
 */
#include "integrators/radau_matrix.h"
#include "support/scene.h"

#define END 0.2 /* [s] */
#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 4, 'width': 0.4, 'height': "   \
    "0.3},"                                                                                                  \
    "'material': {'young_modulus': 2e4, 'thickness': 1e-3, 'areal_density': 0.2},"                           \
    "'terms': ['stretch.edge', 'bend.hinge', {'type': 'drag.viscous', 'coefficient': 0.3} %s],"              \
    "'velocity': [0.1, 0, 0.2], 'pins': [{'corner': 'top-left'}, {'corner': 'top-right', 'track': [[0.03, "  \
    "[0, 0, 0]], [0.1, [0, 0.03, 0]], [0.15, [-0.02, 0.03, 0.02]], [1, [-0.02, 0, 0]]]}]}],"                 \
    "'integrator': {'method': '%s', %s}, 'frame_rate': 500, 'duration': 1}"
#define DASHPOTS ", {'type': 'damp.kelvin_voigt', 'beta': 2e-3}"
/* Every error test passes, and the iteration converges to rounding: each advance is one step, unless a kink
 * is within it. */
#define FORCED "'rtol': 0.1, 'newton_share': 1e-13"

/* Positions at END, then those of the frames. */
typedef struct run {
    double *x;
    size_t size; /* of one set of positions */
    int frames;
    double numerical; /* [J] */
    long accepted;
} run;

static drape_status note_frame(void *user, const drape_event *event)
{
    run *r = user;
    if (event->kind == DRAPE_EVENT_FRAME)
        memcpy(r->x + (size_t)++r->frames * r->size, event->positions, r->size * sizeof(double));
    return DRAPE_OK;
}

/* To END in n advances. */
static run run_sheet(const char *terms, const char *method, const char *settings, int n)
{
    scoped_scene s = scene_open(SHEET, terms, method, settings);
    run r = {.size = 3 * (size_t)s.model->node_count};
    r.x = calloc(110 * r.size, sizeof(double));
    ck_assert_ptr_nonnull(r.x);
    ck_assert_int_eq(drape_sim_observe(s.sim, note_frame, &r), DRAPE_OK);
    for (int k = 1; k <= n; k++)
        scene_advance(&s, END * k / n);
    memcpy(r.x, drape_sim_positions(s.sim), r.size * sizeof(double));
    r.numerical = drape_sim_energy(s.sim).numerical;
    r.accepted = (long)drape_sim_statistics(s.sim).steps_accepted;
    return r;
}

/* Root mean square over the nodes, of one set of positions. */
static double distance(const run *a, const run *b, int which)
{
    const size_t from = (size_t)which * a->size;
    double sum = 0;
    for (size_t i = from; i < from + a->size; i++)
        sum += pow(a->x[i] - b->x[i], 2);
    return sqrt(3 * sum / (double)a->size);
}

static double worst_frame(const run *a, const run *b)
{
    double worst = 0;
    ck_assert_int_eq(a->frames, b->frames);
    for (int k = 1; k <= a->frames; k++)
        worst = fmax(worst, distance(a, b, k));
    return worst;
}

/* ---- Order ---- */

/* Kinks at multiples of 10 ms are ends of steps. The bound of 0.15 is that of test_order.c. The remainder of
 * the energy account consists of the method's errors and those of the quadrature of powers, of order 5, too.
 * The reference has an error of 3e-13 m, a hundredth of the smallest one here, which changes a slope by 0.02.
 */
TEST(order_5)
{
    static const char *const terms[] = {"", DASHPOTS};
    for (int damped = 0; damped < 2; damped++) {
        run reference = run_sheet(terms[damped], "radau", "'rtol': 1e-12", 1);
        double before = NAN, lost = NAN, slope = NAN, slope_lost = NAN;
        for (int n = 40; n <= 160; n *= 2) {
            run r = run_sheet(terms[damped], "radau", FORCED, n);
            const double error = distance(&r, &reference, 0);
            ck_assert_int_eq(r.accepted, n);
            slope = log2(before / error);
            slope_lost = log2(fabs(lost / r.numerical));
            printf("# %d steps: error %.3g m, slope %.3f; remainder %.3g J, slope %.3f\n", n, error, slope,
                   r.numerical, slope_lost);
            before = error;
            lost = r.numerical;
            free(r.x);
        }
        ck_assert_double_eq_tol(slope, 5, 0.15);
        ck_assert_double_eq_tol(slope_lost, 5, 0.15);
        free(reference.x);
    }
}

/* Frames between steps come from the integral of the velocities' cubic: its error within a step of size h is
 * O(h^5), as that of the steps: at h = 5 ms and 2.5 ms the slope is within 0.5 of 5, since which fractions
 * of the steps the frames are at changes with h. */
TEST(frames_have_the_order_of_the_steps)
{
    run reference = run_sheet("", "radau", "'rtol': 1e-12", 1);
    run coarse = run_sheet("", "radau", FORCED, 40), fine = run_sheet("", "radau", FORCED, 80);
    const double error = worst_frame(&coarse, &reference), smaller = worst_frame(&fine, &reference);
    printf("# worst frame: %.3g m, %.3g m; at the end %.3g m, %.3g m\n", error, smaller,
           distance(&coarse, &reference, 0), distance(&fine, &reference, 0));
    ck_assert_double_eq_tol(log2(error / smaller), 5, 0.5);
    free(reference.x);
    free(coarse.x);
    free(fine.x);
}

/* A step of 1 ns, which ends an advance, is followed by steps as long as without it: neither its polynomial
 * nor its error says anything about those. One more step and one more failure may follow from where steps
 * end. */
TEST(a_tiny_step_leaves_no_trace)
{
    long accepted[2], rejected[2];
    for (int k = 0; k < 2; k++) {
        scoped_scene s = scene_open(SHEET, "", "radau", "'rtol': 1e-5");
        scene_watch(&s);
        scene_advance(&s, 0.07);
        if (k == 1)
            scene_advance(&s, 0.07 + 1e-9);
        scene_advance(&s, END);
        accepted[k] = s.accepted;
        rejected[k] = s.rejected;
    }
    printf("# %ld steps, %ld rejected; with one of 1 ns %ld, %ld\n", accepted[0], rejected[0], accepted[1],
           rejected[1]);
    ck_assert_int_le(accepted[1], accepted[0] + 2);
    ck_assert_int_le(rejected[1], rejected[0] + 1);
}

/* ---- Stability function ---- */

/* One node between springs (test_oscillator.c): x'' = -w^2 (x + beta x') up to e^2, e = 1e-5 its amplitude
 * relative to the springs. A step of size h multiplies (x, x') by R(h J), J = [0 1; -w^2, -w^2 beta],
 *     R(z) = (1 + 2 z/5 + z^2/20) / (1 - 3 z/5 + 3 z^2/20 - z^3/60)      [Hairer & Wanner, IV.3]
 */
typedef struct matrix {
    double a[4]; /* rows of 2 */
} matrix;

static matrix times(matrix p, matrix q)
{
    return (matrix){{p.a[0] * q.a[0] + p.a[1] * q.a[2], p.a[0] * q.a[1] + p.a[1] * q.a[3],
                     p.a[2] * q.a[0] + p.a[3] * q.a[2], p.a[2] * q.a[1] + p.a[3] * q.a[3]}};
}

/* c0 + c1 z + c2 z^2 + c3 z^3 */
static matrix polynomial_of(matrix z, double c0, double c1, double c2, double c3)
{
    const matrix square = times(z, z), cube = times(square, z);
    matrix sum;
    for (int i = 0; i < 4; i++)
        sum.a[i] = (i % 3 == 0 ? c0 : 0) + c1 * z.a[i] + c2 * square.a[i] + c3 * cube.a[i];
    return sum;
}

static matrix stability_function(matrix z)
{
    const matrix q = polynomial_of(z, 1, -0.6, 0.15, -1.0 / 60);
    const double d = q.a[0] * q.a[3] - q.a[1] * q.a[2];
    const matrix inverse = {{q.a[3] / d, -q.a[1] / d, -q.a[2] / d, q.a[0] / d}};
    return times(inverse, polynomial_of(z, 1, 0.4, 0.05, 0));
}

/* The node's displacement and velocity by the formula, step by step. */
typedef struct oscillator {
    double w, beta, x, v;
    int steps;
} oscillator;

static drape_status follow(void *user, const drape_event *event)
{
    oscillator *o = user;
    if (event->kind != DRAPE_EVENT_ATTEMPT || !event->attempt->accepted)
        return DRAPE_OK;
    const double h = event->attempt->h, x = o->x;
    const matrix r = stability_function((matrix){{0, h, -h * o->w * o->w, -h * o->w * o->w * o->beta}});
    o->x = r.a[0] * x + r.a[1] * o->v;
    o->v = r.a[2] * x + r.a[3] * o->v;
    o->steps++;
    return DRAPE_OK;
}

TEST(oscillator_follows_the_stability_function)
{
    enum { CENTRE = 4, STEPS = 5 };
    const double length = 0.1, w = sqrt(3 * sqrt(3.0) / 2 * 1e3 / (0.2 * sqrt(3.0) / 2 * length * length));
    static const double phases[] = {0.1, 1, 10}, ratios[] = {0, 0.3, 2.5}; /* w h, w beta */
    for (int k = 0; k < 9; k++) {
        const double h = phases[k / 3] / w, beta = ratios[k % 3] / w, amplitude = 1e-5 * length;
        char term[96] = "";
        if (beta > 0)
            snprintf(term, sizeof term, "{'type': 'damp.kelvin_voigt', 'beta': %.17g},", beta);
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 2, 'edge_length': "
            "%g, 'transform': {'translate': [%.17g, 0, %.17g]}},"
            "'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.2},"
            "'terms': [%s 'stretch.edge'], 'velocity': [%.17g, 0, %.17g],"
            "'pins': [{'nodes': [0, 1, 2, 3, 5, 6, 7, 8]}]}],"
            "'gravity': [0, 0, 0], 'integrator': {'method': 'radau', 'rtol': 1e-4, 'atol_v': 1, "
            "'newton_share': 1e-11}, 'duration': 1}",
            length, -1.5 * length, sqrt(3.0) / 2 * length, term, 0.8 * amplitude * w, 0.6 * amplitude * w);
        oscillator o = {.w = w, .beta = beta, .v = amplitude * w};
        double worst = 0;
        ck_assert_int_eq(drape_sim_observe(s.sim, follow, &o), DRAPE_OK);
        for (int n = 1; n <= STEPS; n++) {
            scene_advance(&s, n * h);
            const double *now = scene_state(&s)->x + 3 * CENTRE, *rate = scene_state(&s)->v + 3 * CENTRE;
            worst = fmax(worst, hypot(now[0] - 0.8 * o.x, now[2] - 0.6 * o.x) / amplitude);
            worst = fmax(worst, hypot(rate[0] - 0.8 * o.v, rate[2] - 0.6 * o.v) / (amplitude * w));
        }
        printf("# w h %g, w beta %g: error %.3g after %d steps\n", phases[k / 3], ratios[k % 3], worst,
               o.steps);
        ck_assert_int_le(o.steps, 2 * STEPS);
        /* In each step: the nonlinearity, e^2; strains of size e, rounded by 4 DBL_EPSILON; and the
         * iteration, 1e-11 of a bound of 0.1 rtol^(2/3) of the size 0.3 m, relative to the amplitude.
         * Dashpots and short steps multiply the last two by up to 1 + beta/h. */
        const double bound = 1e-10 + 4 * DBL_EPSILON / 1e-5 + 1e-11 * 0.1 * 2.2e-3 * 0.3 / amplitude;
        assert_below(worst, o.steps * (1 + 2 * beta / h) * bound);
    }
}

/* ---- Matrices ---- */

/* r = b - C x, from K, D and M; complex vectors have their real parts first. */
static void residual_of(drape_radau_matrix *m, double h, const double *b, const double *x, double *r)
{
    const drape_pattern *p = m->linear->pattern;
    const double mu[2] = {DRAPE_RADAU_ALPHA / h, DRAPE_RADAU_BETA / h};
    const double square[2] = {mu[0] * mu[0] - mu[1] * mu[1], 2 * mu[0] * mu[1]};
    const int64_t n = p->n;
    memcpy(r, b, 2 * (size_t)n * sizeof *r);
    for (int64_t j = 0; j < n; j++) {
        const double re = x[j], im = x[n + j];
        for (int64_t k = p->column[j]; k < p->column[j + 1]; k++) {
            const double stiff = m->linear->more[0][k], damp = m->linear->more[1] ? m->linear->more[1][k] : 0;
            r[drape_pattern_row(p, j, k)] -= stiff * re + damp * (mu[0] * re - mu[1] * im);
            r[n + drape_pattern_row(p, j, k)] -= stiff * im + damp * (mu[0] * im + mu[1] * re);
        }
        r[j] -= m->mass[j] * (square[0] * re - square[1] * im);
        r[n + j] -= m->mass[j] * (square[0] * im + square[1] * re);
    }
}

static double norm(int64_t n, const double *a)
{
    double sum = 0;
    for (int64_t i = 0; i < n; i++)
        sum += a[i] * a[i];
    return sqrt(sum);
}

/* The solution has the residual that was asked for, measured behind P^-1, and rounding. Without damping, and
 * with K positive definite, as at rest, the residual falls by .46 in each iteration at least, at any
 * stiffness, mesh and step (radau_matrix.h), and with damping it takes not many more. */
TEST(complex_systems_are_solved_at_a_rate_that_no_mesh_changes)
{
    static const double steps[] = {1e-4, 1e-2, 1};
    const double tolerance = 1e-7;
    for (int k = 0; k < 12; k++) {
        const int side = k % 2 ? 12 : 6;
        const bool damped = k / 2 % 2;
        const double h = steps[k / 4];
        scoped_scene s =
            scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': %d, 'rows': %d, "
                       "'width': 1, 'height': 1}, 'material': {'young_modulus': 1e6, 'thickness': 1e-3, "
                       "'areal_density': 0.2}, 'terms': ['stretch.edge', 'bend.hinge' %s],"
                       "'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]}], 'duration': 1}",
                       side, side, damped ? DASHPOTS : "");
        const drape_state *at = scene_state(&s);
        drape_radau_matrix m;
        drape_arena arena = drape_arena_of(s.ctx);
        ck_assert_int_eq(drape_radau_matrix_create(&arena, s.sim->system,
                                                   drape_linear_best(3 * (int64_t)s.sim->model->free_count),
                                                   &m),
                         DRAPE_OK);
        ck_assert_int_eq(
            drape_radau_matrix_evaluate(&m, &(drape_point){.x = at->x, .v = at->v, .internal = at->internal}),
            DRAPE_OK);
        ck_assert_int_eq(drape_radau_matrix_factor(&m, h), DRAPE_OK);
        const size_t n = (size_t)m.n;
        double *b = calloc(6 * n, sizeof *b), *x = b + 2 * n, *r = b + 4 * n, first, left;
        ck_assert_ptr_nonnull(b);
        for (size_t i = 0; i < 2 * n; i++)
            b[i] = sin(1 + 2.7 * (double)i);
        const int64_t before = m.linear->iterations;
        ck_assert_int_eq(drape_radau_matrix_solve_complex(&m, b, tolerance, x), DRAPE_OK);
        const int iterations = (int)(m.linear->iterations - before) / 2 - 1;
        residual_of(&m, h, b, x, r);
        for (int part = 0; part < 2; part++) {
            ck_assert_int_eq(drape_radau_matrix_solve(&m, r + (size_t)part * n, r + (size_t)part * n),
                             DRAPE_OK);
            ck_assert_int_eq(drape_radau_matrix_solve(&m, b + (size_t)part * n, b + (size_t)part * n),
                             DRAPE_OK);
        }
        left = norm(2 * m.n, r);
        first = norm(2 * m.n, b);
        printf("# %d x %d, h %g s%s: %d iterations, residual %.3g\n", side, side, h, damped ? ", damped" : "",
               iterations, left / first);
        /* 3: the masses, by which the norm of GMRES weighs nodes, differ by at most 10. */
        assert_below(left, (3.2 * tolerance + 1e-10) * first);
        ck_assert_int_le(iterations, (int)ceil(log(tolerance / 2) / log(0.46)));
        free(b);
        drape_radau_matrix_destroy(&m);
        drape_arena_free(&arena);
    }
}
