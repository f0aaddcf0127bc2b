/*
 * test_order.c: the order of convergence that each integrator declares, measured on a swinging sheet with
 * dashpots and drag; and the error controller.
 *
 * The sheet is soft: E h = 20 N/m and a node of 0.2 kg/m2 x 0.01 m2 = 2 g. Springs, of sqrt(3)/2 E h = 17
 * N/m at most, give its stretch waves angular frequencies below sqrt(8 x 17/0.002) = 260/s: steps of 2 ms
 * and less resolve them.
 *
 * An error C h^p (1 + c h + ...) has a slope log2(e(h)/e(h/2)) = p + c h/(2 log 2) + ...: it differs from p
 * by an amount that halves with h. c is of the size of the fastest rate, 260/s, times a number below 1. h
 * goes from 1 ms to 0.25 ms: 260 x 0.00025/1.4 = 0.05 at the last pair if that number is 1. The bound is
 * 0.15.
 */
#include "support/scene.h"

#define END   0.2 /* [s] */
#define BOUND 0.15

#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 4, 'width': 0.4, 'height': "   \
    "0.3},"                                                                                                  \
    "'material': {'young_modulus': 2e4, 'thickness': 1e-3, 'areal_density': 0.2},"                           \
    "'terms': ['stretch.edge', 'bend.hinge', {'type': 'drag.viscous', 'coefficient': 0.3} %s],"              \
    "'velocity': [0.1, 0, 0.2], 'pins': [%s]}], 'integrator': {'tolerance': 1e-12}, 'duration': 1}"

#define DASHPOTS ", {'type': 'damp.kelvin_voigt', 'beta': 2e-3}"
#define HUNG     "{'corner': 'top-left'}, {'corner': 'top-right'}"
/* Kinks at multiples of 10 ms. */
#define MOVED                                                                                                \
    "{'corner': 'top-left'}, {'corner': 'top-right', 'track': [[0.03, [0, 0, 0]], [0.1, [0, 0.03, 0]], "     \
    "[0.15, [-0.02, 0.03, 0.02]], [1, [-0.02, 0, 0]]]}"

static scene sheet(const char *terms, const char *pins, const drape_sim_def *def)
{
    scene s = scene_model(SHEET, terms, pins);
    scene_start(&s, def);
    return s;
}

static double distance(const scene *s, const double *reference)
{
    double sum = 0;
    for (size_t i = 0; i < 3 * (size_t)s->model->node_count; i++)
        sum += pow(drape_sim_positions(s->sim)[i] - reference[i], 2);
    return sqrt(sum / s->model->node_count);
}

static double *solution(const char *method, double rtol, const char *terms, const char *pins)
{
    const drape_setting setting = {"rtol", rtol, NULL};
    drape_sim_def def = sim_def();
    def.integrator = method;
    def.integrator_settings = &setting;
    def.integrator_setting_count = 1;
    scoped_scene s = sheet(terms, pins, &def);
    const size_t size = 3 * (size_t)s.model->node_count * sizeof(double);
    double *x = malloc(size);
    ck_assert_ptr_nonnull(x);
    scene_advance(&s, END);
    memcpy(x, drape_sim_positions(s.sim), size);
    return x;
}

/* That of ida at order 5, whose error is 1e-9 m at most (test_ida.c): 1e-3 of the smallest error that is
 * measured with it, which changes a slope by 0.002. It restarts at kinks. */
static double *converged(const char *terms, const char *pins)
{
    return solution("ida", 1e-10, terms, pins);
}

/* The end of step k of n. */
typedef double step_end(int k, int n);

static double equal_steps(int k, int n)
{
    return END * k / n;
}

/* Sizes 1 2 1 2 ...: ratios 2 and 1/2 in every step, as from halving and doubling. */
static double uneven_steps(int k, int n)
{
    return END * (k / 2 * 3 + k % 2) / (n / 2 * 3);
}

/* Error at the end of n steps. dt is larger than any of them: every advance is one step. */
static double error_of(const char *method, const char *terms, const char *pins, const double *reference,
                       int n, step_end *end)
{
    drape_sim_def def = sim_def();
    def.integrator = method;
    def.controller = "fixed";
    def.dt = 1;
    scoped_scene s = sheet(terms, pins, &def);
    scene_watch(&s);
    for (int k = 1; k <= n; k++)
        scene_advance(&s, end(k, n));
    ck_assert_int_eq(s.accepted, n);
    const double error = distance(&s, reference);
    return error;
}

/* The slopes over n = 200, 400, 800; returns the last one. */
static double slope_of(const char *method, const char *terms, const char *pins, step_end *end)
{
    double *reference = converged(terms, pins), before = NAN, slope = NAN;
    for (int n = 200; n <= 800; n *= 2) {
        const double error = error_of(method, terms, pins, reference, n, end);
        slope = log2(before / error);
        printf("# %s, %d steps: error %.3g m, slope %.3f\n", method, n, error, slope);
        before = error;
    }
    free(reference);
    return slope;
}

static void check_slope(const char *method, const char *terms, const char *pins, step_end *end, int order)
{
    const double slope = slope_of(method, terms, pins, end);
    ck_assert_msg(fabs(slope - order) <= BOUND, "%s: slope %g, order %d", method, slope, order);
}

static bool has_fixed_steps(const drape_integrator_ops *method)
{
    return !method->own_steps && !method->steady_state;
}

TEST(every_integrator_converges_with_the_order_it_declares)
{
    for (int i = 0; drape_integrators[i]; i++)
        if (has_fixed_steps(drape_integrators[i]))
            check_slope(drape_integrators[i]->entry.name, DASHPOTS, HUNG, equal_steps,
                        drape_integrators[i]->order);
}

/* Error of dirk at the end of n steps of equal size. Its Newton iterations leave 0.1 x 1e-12 of the size of
 * the scene in each stage. */
static double error_of_dirk(int order, const double *reference, int n)
{
    const drape_setting settings[] = {
        {"order", order, NULL}, {"fixed_step", END / n, NULL}, {"rtol", 1e-12, NULL}};
    drape_sim_def def = sim_def();
    def.integrator = "dirk";
    def.integrator_settings = settings;
    def.integrator_setting_count = 3;
    scoped_scene s = sheet(DASHPOTS, HUNG, &def);
    scene_watch(&s);
    scene_advance(&s, END);
    ck_assert_int_eq(s.accepted, n);
    const double error = distance(&s, reference);
    return error;
}

/* Steps of 4 to 1 ms, at order 3 down to 0.5 ms. The reference is radau's, of another family, at rtol 1e-12.
 * The smallest error, 7e-12 m of order 5, is 10 times that at which halving the steps again no longer lowers
 * it. */
TEST(dirk_converges_with_each_of_its_orders)
{
    scoped_memory double *reference = solution("radau", 1e-12, DASHPOTS, HUNG);
    for (int order = 2; order <= 5; order++) {
        double before = NAN, slope = NAN;
        for (int n = 50; n <= (order == 3 ? 400 : 200); n *= 2) {
            const double error = error_of_dirk(order, reference, n);
            slope = log2(before / error);
            printf("# dirk of order %d, %d steps: error %.3g m, slope %.3f\n", order, n, error, slope);
            before = error;
        }
        ck_assert_msg(fabs(slope - order) <= 0.1, "dirk of order %d: slope %g", order, slope);
    }
}

/* bdf2 uses the size of the step before; one-step methods use no history. */
TEST(steps_of_changing_size_keep_the_order)
{
    for (int i = 0; drape_integrators[i]; i++)
        if (has_fixed_steps(drape_integrators[i]))
            check_slope(drape_integrators[i]->entry.name, DASHPOTS, HUNG, uneven_steps,
                        drape_integrators[i]->order);
}

/* At a kink of a track the velocity of the pin jumps. Then the force of springs has a kink in time, and
 * that of dashpots jumps. One-step methods have no history, and with kinks at the ends of steps every step
 * is smooth: they keep their order. The history of bdf2 reaches over the kink. Where the acceleration jumps
 * from f to f + j it has v1 = v0 + h f/3 + 2 h f1/3 with f1 the force of the step. With the exact rate of
 * the dashpot that would be f + j, and v1 off by h j/3: order 1. But the rate is the same formula of q: 3/2
 * of the new slope less 1/2 of the old, so f1 = f + 3/2 j and v1 = v0 + h (f + j): the impulse is right and
 * the order is kept. */
TEST(kinks_at_ends_of_steps_leave_the_order)
{
    for (int i = 0; drape_integrators[i]; i++)
        if (has_fixed_steps(drape_integrators[i]))
            check_slope(drape_integrators[i]->entry.name, DASHPOTS, MOVED, equal_steps,
                        drape_integrators[i]->order);
}

/* ---- The error controller ---- */

typedef struct step_log {
    double t[40000], h[40000];
    int count, rejected;
} step_log;

static drape_sim_def controlled(const char *method, const drape_setting *settings, size_t count)
{
    drape_sim_def def = sim_def();
    def.integrator = method;
    def.controller = "error";
    def.controller_settings = settings;
    def.controller_setting_count = count;
    def.dt = 1e-4;
    return def;
}

/* Local errors are bounded by rtol: steps go with rtol^(1/(p+1)), the error at a time with rtol^(p/(p+1)):
 * a decade of rtol gains 10^(1/2) in order 1 and 10^(2/3) in order 2. Over the three decades one quarter of
 * the exponent is left for the start, where the first steps differ in size from later ones. An integrator
 * with a stability limit takes substeps if the error would allow a larger step, and then its errors are far
 * below: it is checked only over the last decade, where a step is a single substep. */
TEST(error_falls_with_the_controllers_rtol)
{
    scoped_memory double *reference = converged(DASHPOTS, HUNG);
    for (int i = 0; drape_integrators[i]; i++) {
        const drape_integrator_ops *method = drape_integrators[i];
        double first = 0, before = INFINITY;
        const int from = method->stability ? 4 : 2;
        for (int k = 2; has_fixed_steps(method) && k <= 5; k++) {
            const drape_setting rtol = {"rtol", pow(10, -k), NULL};
            const drape_sim_def def = controlled(method->entry.name, &rtol, 1);
            scoped_scene s = sheet(DASHPOTS, HUNG, &def);
            scene_advance(&s, END);
            const double error = distance(&s, reference);
            printf("# %s, rtol 1e-%d: error %.3g m, %lld steps, %lld rejected\n", method->entry.name, k,
                   error, (long long)drape_sim_statistics(s.sim).steps_accepted,
                   (long long)drape_sim_statistics(s.sim).steps_rejected);
            ck_assert_msg(error <= 2 * before, "%s, rtol 1e-%d: error %g m, before %g m", method->entry.name,
                          k, error, before);
            first = k == from ? error : first;
            before = error;
        }
        if (has_fixed_steps(method))
            assert_below(before, first * pow(10, -0.75 * (5 - from) * method->order / (method->order + 1)));
    }
}

/* A scene with one free node, for the estimate. */
static scene node(void)
{
    return scene_model(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 2, 'edge_length': 0.1},"
        "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.2}, 'terms': "
        "['stretch.edge'],"
        "'pins': [{'nodes': [0, 1, 2, 3, 5, 6, 7, 8]}]}], 'duration': 1}");
}

/* The controller's estimate of the local error in x or in v, from its report of a rejected step: root mean
 * square over the six components of x and v of the node. Only the first component of the node differs from
 * 0. */
static double estimate(const scene *s, bool velocity, double h, const double past[2], const double in[2],
                       const double out[2], double *values)
{
    double x[3][27] = {{0}}, v[3][27] = {{0}}, scratch[2] = {0};
    const double *given[3] = {past, in, out};
    const size_t at = 3 * (size_t)s->model->node_of_free[0];
    drape_step_info info = {.reason = DRAPE_REASON_CONVERGED, .h = h};
    drape_state state[3];
    for (int k = 0; k < 3; k++) {
        x[k][at] = given[k][0];
        v[k][at] = given[k][1];
        state[k] = (drape_state){.t = (k - 1) * h, .x = x[k], .v = v[k]};
    }
    const drape_controller_ops *error =
        drape_controllers[drape_registry_find(&drape_controller_registry, NULL, "error")];
    for (int p = 0; p < error->entry.param_count; p++)
        values[p] = error->entry.params[p].default_value;
    values[drape_param_find(error->entry.params, error->entry.param_count, "dt_min")] = 1e-300;
    values[drape_param_find(error->entry.params, error->entry.param_count, "atol_x")] =
        velocity ? 1e9 : 1e-15;
    values[drape_param_find(error->entry.params, error->entry.param_count, "atol_v")] =
        velocity ? 1e-15 : 1e9;
    drape_trial trial = {.model = s->model,
                         .past = {&state[0], NULL},
                         .in = &state[1],
                         .out = &state[2],
                         .order = 1,
                         .scratch = scratch,
                         .h = h,
                         .info = &info,
                         .status = DRAPE_OK};
    ck_assert_int_eq(error->judge(values, &trial), DRAPE_RETRY);
    ck_assert_int_eq(info.reason, DRAPE_REASON_ERROR_TEST);
    return info.diagnostic.value * 1e-15 * sqrt(6);
}

/* Two steps of backward Euler on x'' = -w^2 x: x1 = (x0 + h v0)/(1 + (w h)^2), v1 = (x1 - x0)/h. The second
 * differences of its x and v are h^2 times the second derivatives by the equation, which is twice its local
 * error y1 - y(h) = h^2/2 y'' + O(h^3), y(h) the exact solution from the state in the middle: the estimate
 * equals that up to some w h. The terms of third order are 1/2 h^3 y''' from the second difference and 1/3
 * h^3 y''' from the local error, and y''' < 1.5 w y'' at this phase for both: less than 2.5 w h in all. */
TEST(the_estimate_for_backward_euler_is_its_local_error)
{
    static const double phases[] = {0.1, 0.03, 0.01, 0.001}; /* w h */
    const double w = 50;                                     /* [1/s] */
    double values[DRAPE_MAX_PARAMS], y[3][2];
    scoped_scene s = node();
    ck_assert_int_eq(s.model->free_count, 1);
    for (int k = 0; k < 4; k++) {
        const double z = phases[k], h = z / w;
        y[0][0] = cos(0.8);
        y[0][1] = -w * sin(0.8);
        for (int n = 1; n < 3; n++) {
            y[n][0] = (y[n - 1][0] + h * y[n - 1][1]) / (1 + z * z);
            y[n][1] = (y[n][0] - y[n - 1][0]) / h;
        }
        const double exact[2] = {y[1][0] * cos(z) + y[1][1] / w * sin(z),
                                 y[1][1] * cos(z) - w * y[1][0] * sin(z)};
        for (int c = 0; c < 2; c++) {
            const double guess = estimate(&s, c == 1, h, y[0], y[1], y[2], values),
                         truth = fabs(y[2][c] - exact[c]);
            printf("# w h = %g, %s: estimate / local error = %.5f\n", z, c ? "v" : "x", guess / truth);
            fflush(stdout);
            ck_assert_double_le(fabs(guess / truth - 1), 2.5 * z);
        }
    }
}
