/*
 * test_one_step.c: the coefficients of `rosenbrock` and its orders, and the error control that one-step
 * methods share.
 */
#include "integrators/local_error.h"
#include "integrators/rosenbrock.h"
#include "support/scene.h"

/* ---- The coefficients of rosenbrock ---- */

#define MAX DRAPE_ROSENBROCK_STAGES

/* The method in the coefficients in which orders are stated: alpha_ij and gamma_ij, with u = Gamma k. */
typedef struct original {
    int n;
    double alpha[MAX][MAX], gamma[MAX][MAX], b[MAX], embedded[MAX];
} original;

/* Gamma is the inverse of I/gamma - c, row by row. */
static original original_of(const drape_rosenbrock_scheme *s)
{
    original o = {.n = s->stages};
    for (int i = 0; i < o.n; i++)
        for (int j = 0; j <= i; j++) {
            double sum = i == j;
            for (int k = j; k < i; k++)
                sum += s->c[i][k] * o.gamma[k][j];
            o.gamma[i][j] = s->gamma * sum;
        }
    for (int j = 0; j < o.n; j++)
        for (int k = j; k < o.n; k++) {
            o.b[j] += s->m[k] * o.gamma[k][j];
            o.embedded[j] += (s->m[k] - s->e[k]) * o.gamma[k][j];
            for (int i = 0; i < o.n; i++)
                o.alpha[i][j] += s->a[i][k] * o.gamma[k][j];
        }
    return o;
}

static double dot(int n, const double *a, const double *b)
{
    double sum = 0;
    for (int i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

/* The largest violation of the conditions up to an order, Hairer & Wanner 1996, Table IV.7.1, by weights b
 * that lead from 0 to s. */
static double violation(const original *o, const double *b, double s, int order)
{
    double a[MAX], beta[MAX], aa[MAX], aaa[MAX], by_beta[MAX], a_by_beta[MAX], by_aa[MAX], twice[MAX];
    const double one[MAX] = {1, 1, 1, 1, 1, 1};
    const int n = o->n;
    for (int i = 0; i < n; i++) {
        a[i] = dot(n, o->alpha[i], one);
        beta[i] = a[i] + dot(n, o->gamma[i], one);
        aa[i] = a[i] * a[i];
        aaa[i] = a[i] * aa[i];
    }
    for (int i = 0; i < n; i++) {
        by_beta[i] = dot(n, o->alpha[i], beta) + dot(n, o->gamma[i], beta);
        by_aa[i] = dot(n, o->alpha[i], aa) + dot(n, o->gamma[i], aa);
        a_by_beta[i] = a[i] * dot(n, o->alpha[i], beta);
    }
    for (int i = 0; i < n; i++)
        twice[i] = dot(n, o->alpha[i], by_beta) + dot(n, o->gamma[i], by_beta);
    const struct {
        int order;
        double left, right;
    } conditions[] = {{1, dot(n, b, one), 1},          {2, dot(n, b, beta), 1.0 / 2},
                      {3, dot(n, b, aa), 1.0 / 3},     {3, dot(n, b, by_beta), 1.0 / 6},
                      {4, dot(n, b, aaa), 1.0 / 4},    {4, dot(n, b, a_by_beta), 1.0 / 8},
                      {4, dot(n, b, by_aa), 1.0 / 12}, {4, dot(n, b, twice), 1.0 / 24}};
    double worst = 0;
    for (size_t k = 0; k < sizeof conditions / sizeof *conditions; k++)
        if (conditions[k].order <= order)
            worst = fmax(worst, fabs(conditions[k].left - conditions[k].right * pow(s, conditions[k].order)));
    return worst;
}

/* |R(i y)|, the factor of an undamped oscillation in a step with w h = y. */
static double growth(const original *o, double y)
{
    double re[MAX], im[MAX], sum_re = 0, sum_im = 0;
    for (int i = 0; i < o->n; i++) {
        double pr = 0, pi = 0; /* sum beta_ij k_j */
        for (int j = 0; j < i; j++) {
            pr += (o->alpha[i][j] + o->gamma[i][j]) * re[j];
            pi += (o->alpha[i][j] + o->gamma[i][j]) * im[j];
        }
        /* k_i = z (1 + p)/(1 - z gamma), z = i y */
        const double ar = -y * pi, ai = y * (1 + pr), d = -y * o->gamma[i][i], size = 1 + d * d;
        re[i] = (ar + ai * d) / size;
        im[i] = (ai - ar * d) / size;
        sum_re += o->b[i] * re[i];
        sum_im += o->b[i] * im[i];
    }
    return hypot(1 + sum_re, sum_im);
}

/* The weights of the interpolation at s. */
static double violation_within(const original *o, const drape_rosenbrock_scheme *scheme, double s)
{
    double b[MAX] = {0};
    for (int j = 0; j < o->n; j++)
        for (int k = j; k < o->n; k++)
            b[j] += (s * scheme->m[k] + s * (1 - s) * (scheme->d2[k] + s * scheme->d3[k])) * o->gamma[k][j];
    return violation(o, b, s, 3);
}

/* The published coefficients have 16 digits, of size up to 34. */
TEST(rodas_has_its_orders_and_is_l_stable)
{
    const drape_rosenbrock_scheme *s = &drape_rosenbrock_rodas;
    const original o = original_of(s);
    assert_below(violation(&o, o.b, 1, s->order), 1e-13);
    assert_below(violation(&o, o.embedded, 1, s->order - 1), 1e-13);
    ck_assert_double_gt(violation(&o, o.embedded, 1, s->order), 1e-3);
    for (double x = 0.1; x < 1; x += 0.2)
        assert_below(violation_within(&o, s, x), 1e-13);
    for (int i = 0; i < o.n; i++) {
        double row = 0, gammas = 0;
        for (int j = 0; j < o.n; j++) {
            row += o.alpha[i][j];
            gammas += o.gamma[i][j];
        }
        assert_below(fabs(row - s->alpha[i]), 1e-13);
        assert_below(fabs(gammas - s->gammas[i]), 1e-13);
        assert_below(fabs(o.b[i] - s->b[i]), 1e-13);
        assert_below(fabs(o.b[i] - o.alpha[o.n - 1][i] - o.gamma[o.n - 1][i]), 1e-13); /* stiffly accurate */
    }
    for (double y = 1e-3; y < 1e8; y *= 1.01)
        assert_below(growth(&o, y), 1 + 1e-13);
    assert_below(growth(&o, 1e9), 1e-6);
}

/* ---- Orders ---- */

#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 4, 'width': 0.4, 'height': "   \
    "0.3},"                                                                                                  \
    "'material': {'young_modulus': 2e4, 'thickness': 1e-3, 'areal_density': 0.2},"                           \
    "'terms': ['stretch.edge', 'bend.hinge', {'type': 'drag.viscous', 'coefficient': 0.3}, "                 \
    "{'type': 'damp.kelvin_voigt', 'beta': 2e-3}],"                                                          \
    "'velocity': [0.1, 0, 0.2], 'pins': [%s]}], 'duration': 1}"
#define HUNG "{'corner': 'top-left'}, {'corner': 'top-right'}"
#define MOVED                                                                                                \
    "{'corner': 'top-left'}, {'corner': 'top-right', 'track': [[0.03, [0, 0, 0]], [0.1, [0, 0.03, 0]], "     \
    "[0.15, [-0.02, 0.03, 0.02]], [1, [-0.02, 0, 0]]]}"
#define END 0.2

static double *advance(const char *pins, const char *method, const drape_setting *settings, size_t count)
{
    drape_sim_def def = sim_def();
    def.integrator = method;
    def.integrator_settings = settings;
    def.integrator_setting_count = count;
    scoped_scene s = scene_model(SHEET, pins);
    scene_start(&s, &def);
    scene_advance(&s, END);
    const size_t size = 3 * (size_t)s.model->node_count * sizeof(double);
    double *x = malloc(size);
    ck_assert_ptr_nonnull(x);
    memcpy(x, drape_sim_positions(s.sim), size);
    return x;
}

/* Steps of 4 to 1 ms. At the last pair the slope of an error C h^p (1 + c h) is off by c h/1.4, which is 0.19
 * if c is the fastest rate, 260/s (test_order.c). The reference, ida at rtol 1e-12, is off by 1e-11 m. */
TEST(rosenbrock_has_its_order)
{
    static const char *const pins[] = {HUNG, MOVED};
    for (size_t k = 0; k < 2; k++) {
        const drape_setting tight[] = {{"rtol", 1e-12, NULL}, {"max_steps", 1e6, NULL}};
        double *reference = advance(pins[k], "ida", tight, 2), before = NAN, slope = NAN;
        for (int n = 50; n <= 200; n *= 2) {
            const drape_setting settings[] = {{"rtol", 1, NULL}, {"max_step", END / n, NULL}};
            double *x = advance(pins[k], "rosenbrock", settings, 2), sum = 0;
            for (int i = 0; i < 60; i++)
                sum += (x[i] - reference[i]) * (x[i] - reference[i]);
            slope = log2(before / sqrt(sum / 20));
            before = sqrt(sum / 20);
            printf("# %d steps: error %.3g m, slope %.3f\n", n, before, slope);
            free(x);
        }
        free(reference);
        assert_below(fabs(slope - drape_rosenbrock_rodas.order), 0.2);
    }
}

/* ---- The error control ---- */

#define POWER 4

typedef struct control {
    scene s;
    drape_local_error c;
    drape_state in;
    double *ex, *ev;
    size_t n;
    double usual; /* [s] if > 0: errors are those at this size, times (h/usual)^POWER */
} control;

/* rtol 1e-3 of a sheet of 0.5 m. */
static control open_control(const char *pins)
{
    const double values[DRAPE_LOCAL_ERROR_PARAM_COUNT] = {1e-3, NAN, NAN, INFINITY, 1e6};
    control k = {.s = scene_model(SHEET, pins)};
    scene_start(&k.s, NULL);
    drape_local_error_init(k.s.sim->system, values, POWER, &k.c);
    k.in = *scene_state(&k.s);
    k.n = 3 * (size_t)k.s.model->free_count;
    k.ex = calloc(k.n, sizeof *k.ex);
    k.ev = calloc(k.n, sizeof *k.ev);
    return k;
}

static void close_control(control *k)
{
    free(k->ex);
    free(k->ev);
    scene_close(&k->s);
}

#define scoped_control SCOPED(close_control) control

/* An attempt with this error; if it passes, the state moves on. */
static drape_status try_with(control *k, double end, double bound, double error, drape_local_attempt *a,
                             drape_step_info *info)
{
    *info = (drape_step_info){.reason = DRAPE_REASON_OTHER};
    *a =
        (drape_local_attempt){.stop = drape_local_error_stop(&k->c, &k->in, end), .end = end, .bound = bound};
    drape_status status = drape_local_error_begin(&k->c, &k->in, NULL, a, info);
    if (k->usual > 0)
        error *= pow(a->h / k->usual, POWER);
    for (size_t i = 0; i < k->n; i++) {
        k->ex[i] = error * k->c.atol_x;
        k->ev[i] = -error * k->c.atol_v;
    }
    if (!status)
        status = drape_local_error_test(&k->c, a, k->ex, k->ev, info);
    if (!status)
        k->in.t = a->t1;
    return status;
}

TEST(the_norm_is_the_weighted_root_mean_square)
{
    scoped_control k = open_control(HUNG);
    int32_t worst;
    const double length = 0.5;
    assert_below(fabs(k.c.atol_x / (1e-3 * length) - 1), 1e-14);
    assert_below(fabs(k.c.atol_v / (1e-3 * sqrt(9.81 * length)) - 1), 1e-14);
    k.ex[7] = 3 * k.c.atol_x;
    k.ev[8] = 4 * k.c.atol_v;
    assert_below(fabs(drape_local_error_norm(&k.c, k.ex, k.ev, &worst) - 5 / sqrt(2.0 * (double)k.n)), 1e-14);
    ck_assert_int_eq(worst, k.s.model->node_of_free[2]);
    k.ev[0] = NAN;
    ck_assert(isnan(drape_local_error_norm(&k.c, k.ex, k.ev, &worst)));
    ck_assert_int_eq(worst, k.s.model->node_of_free[0]);
}

/* Growth at most by 5, cuts at most to a fifth; a failed test; no growth after it; the predictive formula. */
TEST(sizes_follow_the_errors)
{
    scoped_control k = open_control(HUNG);
    drape_local_attempt a;
    drape_step_info info;
    const double end = 1e6;
    ck_assert_int_eq(try_with(&k, end, end, 1e-9, &a, &info), DRAPE_OK);
    const double first = a.h;
    ck_assert(first > 0 && first < 0.1);
    ck_assert_int_eq(try_with(&k, end, end, 0.5, &a, &info), DRAPE_OK);
    assert_below(fabs(a.h / (5 * first) - 1), 1e-14);
    const double second = a.h, simple = 0.8 * second * pow(0.5, -0.25),
                 predicted = simple * (second / first) * pow(1e-2 / 0.5, 0.25); /* errors count from 1e-2 */
    ck_assert_int_eq(try_with(&k, end, end, 40, &a, &info), DRAPE_RETRY_REJECTED);
    assert_below(fabs(a.h / fmin(simple, predicted) - 1), 1e-14);
    ck_assert_int_eq(info.reason, DRAPE_REASON_ERROR_TEST);
    ck_assert(info.h == a.h && info.diagnostic.node[0] >= 0);
    assert_below(fabs(info.diagnostic.value - 40), 1e-12);
    assert_below(fabs(info.retry / (0.8 * a.h * pow(40, -0.25)) - 1), 1e-14);
    const double retry = info.retry;
    ck_assert_int_eq(try_with(&k, end, retry, 1e-6, &a, &info), DRAPE_OK);
    ck_assert(a.h == retry);
    ck_assert_int_eq(try_with(&k, end, end, 1e-6, &a, &info), DRAPE_OK);
    ck_assert(a.h == retry); /* it did not grow */
    ck_assert_int_eq(try_with(&k, end, end, 1e12, &a, &info), DRAPE_RETRY_REJECTED);
    ck_assert_double_gt(a.h, retry);
    assert_below(fabs(info.retry / (0.2 * a.h) - 1), 1e-14);
    ck_assert_int_eq(try_with(&k, end, end, NAN, &a, &info), DRAPE_RETRY_NONFINITE);
    ck_assert(info.retry == 0);
}

/* Ends of advances, kinks of pins at 0.03, 0.1, 0.15 s. No step is shorter than half of what was proposed,
 * except where an advance itself is. */
TEST(steps_end_at_kinks_and_at_the_end_without_slivers)
{
    const double kinks[] = {0.03, 0.1, 0.15};
    for (int m = 1; m < 40; m++) {
        scoped_control k = open_control(MOVED);
        drape_local_attempt a;
        drape_step_info info;
        const double step = 1.7e-4 * m * m / 10;
        int met = 0, steps = 0;
        k.c.max_step = k.usual = step;
        while (k.in.t < END && steps++ < 20000) {
            const double from = k.in.t;
            ck_assert_int_eq(try_with(&k, END, INFINITY, 0.4, &a, &info), DRAPE_OK);
            for (int i = 0; i < 3; i++) {
                ck_assert(!(from < kinks[i] && a.t1 > kinks[i]));
                met += a.t1 == kinks[i];
            }
            const double wanted = fmin(step, k.c.past.proposed);
            ck_assert(a.h <= wanted * (1 + 1e-14));
            ck_assert(a.h > 0.499 * wanted || a.h == a.stop - from || a.h == (a.stop - from) / 2);
        }
        ck_assert(k.in.t == END);
        ck_assert_int_eq(met, 3);
    }
}

/* A cut that the end of an advance makes is forgotten in the next one. */
TEST(a_cut_step_keeps_the_proposal)
{
    scoped_control k = open_control(HUNG);
    drape_local_attempt a;
    drape_step_info info;
    for (int i = 0; i < 8; i++)
        ck_assert_int_eq(try_with(&k, 1e6, 1e6, 0.4, &a, &info), DRAPE_OK);
    const double steady = a.h;
    ck_assert_int_eq(try_with(&k, k.in.t + steady / 1000, 1e6, 1e-7, &a, &info), DRAPE_OK);
    assert_below(fabs(a.h / (steady / 1000) - 1), 1e-9);
    ck_assert_int_eq(try_with(&k, 1e6, 1e6, 0.4, &a, &info), DRAPE_OK);
    ck_assert_double_gt(a.h, 0.5 * steady);
}

/* 1000 steps a second at most, in this control; steps that move nothing. */
TEST(the_work_is_bounded)
{
    scoped_control k = open_control(HUNG);
    drape_local_attempt a;
    drape_step_info info;
    drape_status status = DRAPE_OK;
    int steps = 0;
    k.c.max_steps = 1000;
    k.c.max_step = k.usual = 1e-5;
    while (!status && steps++ < 5000)
        status = try_with(&k, 1e6, 1e6, 0.4, &a, &info);
    ck_assert_int_eq(status, DRAPE_E_STEP_TOO_SMALL);
    ck_assert_int_eq(info.reason, DRAPE_REASON_MAX_STEPS);
    ck_assert_int_eq(steps, 1001);
    k.c.max_step = k.usual = 1e-13;
    for (steps = 0, status = DRAPE_OK; !status && steps < 100; steps++)
        status = try_with(&k, 1e6, 1e6, 0.4, &a, &info);
    ck_assert_int_eq(status, DRAPE_E_STEP_TOO_SMALL);
    ck_assert_int_eq(info.reason, DRAPE_REASON_ERROR_TEST);
    ck_assert_int_le(steps, 22);
}
