/*
 * newton_k: backward Euler by k inexact Newton iterations a step (Dembo, Eisenstat & Steihaug 1982), the rung for
 * real time. be solves the same equations (be.c) to a tolerance; here
 *   - the matrix is one near the Jacobian (quasi.h), which costs less than a residual,
 *   - each correction is found by preconditioned conjugate gradients to linear_tolerance,
 *   - there are k of them, and no factors of the whole matrix: memory and time grow with the number of nodes.
 * Rows like this one share their guess and their checks (rung.h): where the residual has not fallen below that of the
 * guess there are more iterations, up to rescue_iterations, and then the step is refused: the controller halves it.
 * Corrections that go too far are shortened by the work along them, as in newton.c, and where cloth would pass through
 * something.
 */
#include "integrators/quasi.h"
#include "integrators/rung.h"

#include "base/clock.h"

#include <string.h>

enum {
    PARAM_DT,
    PARAM_ITERATIONS,
    PARAM_TOLERANCE,
    PARAM_RESCUE_ITERATIONS,
    PARAM_EXTRAPOLATION,
    PARAM_LINEAR_TOLERANCE,
    PARAM_LINEAR_ITERATIONS,
    PARAM_COARSE_SPACING,
    PARAM_COUNT
};

static const drape_param params[PARAM_COUNT] = {
    [PARAM_DT] = DRAPE_NUMBER("dt", "s", 1.0 / 60, DRAPE_ABOVE(0), 1e6, "nominal step"),
    [PARAM_ITERATIONS] = DRAPE_INTEGER("iterations", "1", 1, 1, 1000, "inexact Newton iterations a step"),
    [PARAM_TOLERANCE] = DRAPE_NUMBER("tolerance", "N", 1e-6, DRAPE_ABOVE(0), 1e12,
                                     "residual of the free nodes, largest component, below which no "
                                     "iteration is made; not a bound on an accepted state"),
    [PARAM_RESCUE_ITERATIONS] = DRAPE_INTEGER("rescue_iterations", "1", 8, 0, 100000,
                                              "more iterations where the residual is not below that of the "
                                              "guess after the others; then the step is rejected"),
    [PARAM_EXTRAPOLATION] = DRAPE_NUMBER("extrapolation", "1", 0.5, 0, 1,
                                         "share of the last change of velocity that the guess takes along"),
    [PARAM_LINEAR_TOLERANCE] = DRAPE_NUMBER("linear_tolerance", "1", 0.1, 1e-14, DRAPE_BELOW(1),
                                            "conjugate gradients reduce the residual of a correction to this "
                                            "share at 1/60 s, in proportion to the step at others"),
    [PARAM_LINEAR_ITERATIONS] =
        DRAPE_INTEGER("max_linear_iterations", "1", 60, 1, 100000, "of conjugate gradients, a correction"),
    [PARAM_COARSE_SPACING] =
        DRAPE_INTEGER("coarse_spacing", "1", 0, 0, 100,
                      "edges between the centres of the coarse functions; 0: by the number of nodes"),
};

#define WORK_SHARE  0.5 /* of the work along a correction: so much may be left on the far side */
#define MOST_TRIALS 6   /* of shorter corrections */
#define SHARE_RATE  60. /* [1/s] linear_tolerance is for steps of its inverse */
#define MOST_LEFT   0.5 /* of a residual, at any step */

/* What a step tries at each effort: iterations, and conjugate gradients an iteration. 0: as the parameters say. */
static const struct {
    int iterations, linear_iterations;
} efforts[] = {{0, 0}, {1, 4}};

typedef struct newton_k {
    drape_rung rung;
    double values[PARAM_COUNT];
    drape_quasi *quasi; /* NULL without free nodes */
    double *p;          /* free DOFs: the correction */
    int effort;
} newton_k;

static void destroy(void **state)
{
    newton_k *s = *state;
    if (!s)
        return;
    drape_context *ctx = s->rung.base.ctx;
    drape_quasi_destroy(&s->quasi);
    drape_free(ctx, s->p);
    drape_rung_free(&s->rung);
    drape_free(ctx, s);
    *state = NULL;
}

static drape_status create(drape_context *ctx, drape_system *system, const double *values, void **state)
{
    newton_k *s = drape_alloc(ctx, 1, sizeof *s);
    *state = s;
    if (!s)
        return DRAPE_E_MEMORY;
    memcpy(s->values, values, sizeof s->values);
    drape_status status = drape_rung_init(ctx, system, &s->rung);
    if (!status && !(s->p = drape_alloc(ctx, s->rung.dofs, sizeof *s->p)))
        status = DRAPE_E_MEMORY;
    if (!status && s->rung.dofs > 0)
        status = drape_quasi_create(ctx, system, (int)values[PARAM_COARSE_SPACING], &s->quasi);
    if (status)
        destroy(state);
    return status;
}

/* The share of the residual that is left. A displacement e that is missing from a step is a velocity e/h, of which a
 * second has 1/h: for these to vanish with h as the method's own error does, e must be of order h^3. The guess is off by
 * h^2, so the share is of order h. */
static double forcing(const newton_k *s)
{
    double share = s->values[PARAM_LINEAR_TOLERANCE] * SHARE_RATE / s->rung.point.weight;
    return share < MOST_LEFT ? share : MOST_LEFT;
}

/* s->p with A p = -F. */
static drape_status correct(newton_k *s)
{
    drape_rung *r = &s->rung;
    int most = efforts[s->effort].linear_iterations;
    double start = drape_system_clock(r->base.system), w = r->point.weight;
    drape_status status = drape_quasi_update(s->quasi, &r->point, w * w);
    r->work.jacobians++;
    r->work.jacobian_seconds += drape_system_clock(r->base.system) - start;
    if (status)
        return status;
    start = drape_clock_seconds();
    for (size_t i = 0; i < r->dofs; i++)
        r->trial[i] = -r->f[i];
    r->work.linear_iterations += drape_quasi_solve(s->quasi, r->trial, s->p, forcing(s),
                                                   most ? most : (int)s->values[PARAM_LINEAR_ITERATIONS]);
    r->work.solve_seconds += drape_clock_seconds() - start;
    return DRAPE_OK;
}

/* d += a p with a share a at which the work along p has not turned too far, found by bisection; the residual is
 * that of the new d then. */
static bool advance(newton_k *s, double *d)
{
    drape_rung *r = &s->rung;
    double start = drape_rung_dot(r->f, s->p, r->dofs), a = 1;
    for (int k = 0; k <= MOST_TRIALS; k++, a /= 2) {
        for (size_t i = 0; i < r->dofs; i++)
            r->trial[i] = d[i] + a * s->p[i];
        bool finite = drape_rung_evaluate(r, r->trial);
        if (finite && (k == MOST_TRIALS || !(drape_rung_dot(r->f, s->p, r->dofs) > -WORK_SHARE * start))) {
            memcpy(d, r->trial, r->dofs * sizeof *d);
            return true;
        }
    }
    return false;
}

static drape_status iterate(newton_k *s, drape_step_info *info)
{
    drape_rung *r = &s->rung;
    double *d = r->base.d;
    int wanted =
        efforts[s->effort].iterations ? efforts[s->effort].iterations : (int)s->values[PARAM_ITERATIONS];
    for (;; info->iterations++) {
        bool converged = drape_rung_residual(r) <= s->values[PARAM_TOLERANCE];
        info->reason = converged ? "converged" : "iterations";
        if (converged || (info->iterations >= wanted && drape_rung_fell(r)))
            return DRAPE_OK;
        if (info->iterations >= wanted + (int)s->values[PARAM_RESCUE_ITERATIONS])
            return drape_rung_fail(r, DRAPE_RETRY_NONLINEAR, "residual", info);
        drape_status status = correct(s);
        if (status)
            return drape_rung_fail(r, status, status < 0 ? "memory" : "singular", info);
        drape_rung_stay_free(r, r->x, s->p);
        if (!advance(s, d))
            return drape_rung_fail(r, DRAPE_RETRY_NONFINITE, "nonfinite", info);
        r->work.newton_iterations++;
    }
}

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    newton_k *s = state;
    drape_status status = drape_rung_begin(&s->rung, in, out->t, h, s->values[PARAM_EXTRAPOLATION], info);
    if (!status)
        status = iterate(s, info);
    return drape_rung_finish(&s->rung, status, in, out, s->values[PARAM_TOLERANCE], info);
}

static void set_effort(void *state, int effort)
{
    ((newton_k *)state)->effort = effort;
}

static drape_work work(const void *state)
{
    const newton_k *s = state;
    drape_work work = s->rung.work;
    if (s->quasi) {
        work.factorizations = drape_quasi_factorizations(s->quasi);
        work.factor_seconds = drape_quasi_factor_seconds(s->quasi);
        work.jacobian_seconds -= work.factor_seconds;
    }
    return work;
}

static void archive(void *state, drape_archive *a)
{
    newton_k *s = state;
    drape_rung_archive(&s->rung, a);
    if (s->quasi)
        drape_quasi_archive(s->quasi, a);
}

static size_t bytes(const void *state)
{
    const newton_k *s = state;
    return sizeof *s + drape_rung_bytes(&s->rung) + s->rung.dofs * sizeof(double) +
           (s->quasi ? drape_quasi_bytes(s->quasi) : 0);
}

const drape_integrator_ops drape_integrator_newton_k = {
    .name = "newton_k",
    .summary = "backward Euler by k inexact Newton iterations: for real time, checked, not to a tolerance",
    .reference = "Dembo, Eisenstat & Steihaug 1982; Baraff & Witkin 1998 for k = 1",
    .order = 1,
    .params = params,
    .param_count = PARAM_COUNT,
    .create = create,
    .step = step,
    .restart = drape_rung_restart,
    .efforts = sizeof efforts / sizeof *efforts,
    .set_effort = set_effort,
    .work = work,
    .archive = archive,
    .bytes = bytes,
    .destroy = destroy,
};
