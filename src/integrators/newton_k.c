/*
 * newton_k: backward Euler by k inexact Newton iterations a step (Dembo, Eisenstat & Steihaug 1982), the rung for
 * real time. be solves the same equations (be.c) to a tolerance; here
 *   - the matrix is one near the Jacobian (quasi.h), which costs less than a residual,
 *   - each correction is found by preconditioned conjugate gradients to linear_tolerance,
 *   - there are k of them, and no factors of the whole matrix: memory and time grow with the number of nodes.
 * With a good guess few are needed. The nodes fly on, and a share s of the last change of velocity acts again:
 *     d = h v0 + s h^2 (v0 - v-1)/h0
 * s = 1/2 halves the error of one iteration on a swinging sheet; s = 1 feeds on its own noise and diverges.
 *
 * A step is never taken on faith. The residual of its end is evaluated and reported; where it has not fallen below
 * that of the guess there are more iterations, up to rescue_iterations, and then the step is refused: the
 * controller halves it. Corrections that go too far are shortened by the work along them, as in newton.c, and where cloth would
 * pass through something.
 */
#include "integrators/implicit.h"
#include "integrators/quasi.h"

#include "base/clock.h"
#include "base/finite.h"

#include <math.h>
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
    [PARAM_DT] = {.name = "dt",
                  .unit = "s",
                  .default_value = 1.0 / 60,
                  .min = 0,
                  .max = 1e6,
                  .open_min = true,
                  .help = "nominal step"},
    [PARAM_ITERATIONS] = {.name = "iterations",
                          .kind = DRAPE_PARAM_INTEGER,
                          .unit = "1",
                          .default_value = 2,
                          .min = 1,
                          .max = 1000,
                          .help = "inexact Newton iterations a step"},
    [PARAM_TOLERANCE] = {.name = "tolerance",
                         .unit = "N",
                         .default_value = 1e-6,
                         .min = 0,
                         .max = 1e12,
                         .open_min = true,
                         .help = "residual of the free nodes, largest component, below which no iteration is "
                                 "made; not a bound on an accepted state"},
    [PARAM_RESCUE_ITERATIONS] = {.name = "rescue_iterations",
                                 .kind = DRAPE_PARAM_INTEGER,
                                 .unit = "1",
                                 .default_value = 8,
                                 .min = 0,
                                 .max = 100000,
                                 .help = "more iterations where the residual is not below that of the guess "
                                         "after the others; then the step is rejected"},
    [PARAM_EXTRAPOLATION] = {.name = "extrapolation",
                             .unit = "1",
                             .default_value = 0.5,
                             .min = 0,
                             .max = 1,
                             .help = "share of the last change of velocity that the guess takes along"},
    [PARAM_LINEAR_TOLERANCE] = {.name = "linear_tolerance",
                                .unit = "1",
                                .default_value = 0.1,
                                .min = 1e-14,
                                .max = 1,
                                .open_max = true,
                                .help =
                                    "conjugate gradients reduce the residual of a correction to this share"},
    [PARAM_LINEAR_ITERATIONS] = {.name = "max_linear_iterations",
                                 .kind = DRAPE_PARAM_INTEGER,
                                 .unit = "1",
                                 .default_value = 60,
                                 .min = 1,
                                 .max = 100000,
                                 .help = "of conjugate gradients, a correction"},
    [PARAM_COARSE_SPACING] = {.name = "coarse_spacing",
                              .kind = DRAPE_PARAM_INTEGER,
                              .unit = "1",
                              .default_value = 0,
                              .min = 0,
                              .max = 100,
                              .help =
                                  "edges between the centres of the coarse functions; 0: by the number of "
                                  "nodes"},
};

#define WORK_SHARE  0.5 /* of the work along a correction: so much may be left on the far side */
#define MOST_TRIALS 6   /* of shorter corrections */

/* What a step tries at each effort: iterations, and conjugate gradients an iteration. 0: as the parameters say. */
static const struct {
    int iterations, linear_iterations;
} efforts[] = {{0, 0}, {1, 0}, {1, 4}};

typedef struct newton_k {
    drape_implicit base;
    double values[PARAM_COUNT];
    drape_quasi *quasi; /* NULL without free nodes */
    drape_point point;
    size_t nodes, dofs; /* numbers in arrays of nodes, of free DOFs */
    double *x, *v, *g;  /* nodes: where the residual was evaluated last, and g there */
    double *ahead;      /* nodes: where a correction would lead; NULL without contact */
    double *f, *p;      /* free DOFs: F there, the correction */
    double *trial;      /* free DOFs */
    double *past[2];    /* nodes: velocities at the start of the step before, and of the one before that */
    double past_time[2], past_end; /* [s] of these, and where the last attempt ended; NAN: there is none */
    int effort;
    drape_work work;
} newton_k;

/* ---- Making and freeing ---- */

static bool create_arrays(newton_k *s)
{
    drape_context *ctx = s->base.ctx;
    s->nodes = 3 * (size_t)s->base.model->node_count;
    s->dofs = 3 * (size_t)s->base.model->free_count;
    s->x = drape_alloc(ctx, s->nodes, sizeof *s->x);
    s->v = drape_alloc(ctx, s->nodes, sizeof *s->v);
    s->g = drape_alloc(ctx, s->nodes, sizeof *s->g);
    s->past[0] = drape_alloc(ctx, s->nodes, sizeof *s->past[0]);
    s->past[1] = drape_alloc(ctx, s->nodes, sizeof *s->past[1]);
    s->f = drape_alloc(ctx, s->dofs, sizeof *s->f);
    s->p = drape_alloc(ctx, s->dofs, sizeof *s->p);
    s->trial = drape_alloc(ctx, s->dofs, sizeof *s->trial);
    bool contact = drape_system_contact(s->base.system) != NULL;
    if (contact)
        s->ahead = drape_alloc(ctx, s->nodes, sizeof *s->ahead);
    return s->x && s->v && s->g && s->past[0] && s->past[1] && s->f && s->p && s->trial &&
           (s->ahead || !contact);
}

static void destroy(void **state)
{
    newton_k *s = *state;
    if (!s)
        return;
    drape_context *ctx = s->base.ctx;
    drape_quasi_destroy(&s->quasi);
    void *all[] = {s->x, s->v, s->g, s->past[0], s->past[1], s->f, s->p, s->trial, s->ahead};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        drape_free(ctx, all[i]);
    drape_implicit_free(&s->base);
    drape_free(ctx, s);
    *state = NULL;
}

static void restart(void *state, const drape_state *from)
{
    newton_k *s = state;
    (void)from;
    s->past_time[0] = s->past_time[1] = s->past_end = NAN;
}

static drape_status create(drape_context *ctx, drape_system *system, const double *values, void **state)
{
    newton_k *s = drape_alloc(ctx, 1, sizeof *s);
    *state = s;
    if (!s)
        return DRAPE_E_MEMORY;
    memcpy(s->values, values, sizeof s->values);
    drape_status status = drape_implicit_init_arrays(ctx, system, &s->base);
    if (!status && !create_arrays(s))
        status = DRAPE_E_MEMORY;
    if (!status && s->dofs > 0)
        status = drape_quasi_create(ctx, system, (int)values[PARAM_COARSE_SPACING], &s->quasi);
    restart(s, NULL);
    if (status)
        destroy(state);
    return status;
}

/* ---- The guess ---- */

/* Keeps the velocities that steps began with. An attempt at the same step again has the same past. */
static void remember(newton_k *s, const drape_state *in, double end)
{
    if (in->t == s->past_time[0]) {
        s->past_end = end;
        return;
    }
    bool follows = in->t == s->past_end;
    double *oldest = s->past[1];
    s->past[1] = s->past[0];
    s->past_time[1] = follows ? s->past_time[0] : NAN;
    s->past[0] = oldest;
    s->past_time[0] = in->t;
    s->past_end = end;
    memcpy(s->past[0], in->v, s->nodes * sizeof *in->v);
}

static void guess(newton_k *s, const drape_state *in, double h)
{
    drape_implicit *b = &s->base;
    double before = in->t - s->past_time[1];
    double share = isnan(before) ? 0 : s->values[PARAM_EXTRAPOLATION] * h * h / before;
    for (size_t i = 0; i < s->dofs; i++) {
        size_t at = drape_implicit_at(b, i);
        b->inertia[i] = h * in->v[at];
        b->d[i] = b->inertia[i] + share * (in->v[at] - s->past[1][at]);
    }
}

/* q' = (q(x1) - q(x0))/h */
static void set_history(drape_implicit *b, const drape_state *in, double h)
{
    drape_implicit_measure(b, in, b->history);
    for (int64_t i = 0; b->history && i < b->model->measure_count; i++)
        b->history[i] /= -h;
}

/* ---- The residual ---- */

static void set_point(newton_k *s, const drape_state *in, double h)
{
    const drape_implicit *b = &s->base;
    s->point = (drape_point){.x = s->x,
                             .v = s->v,
                             .internal = in->internal,
                             .weight = 1 / h,
                             .history = b->history,
                             .t = b->t,
                             .span = {b->span[0], b->span[1]}};
    memcpy(s->x, b->x_base, s->nodes * sizeof *s->x);
    memcpy(s->v, b->v_base, s->nodes * sizeof *s->v);
}

/* F = M (d - h v0)/h^2 + g; false if it is not finite. */
static bool evaluate(newton_k *s, const double *d)
{
    const drape_implicit *b = &s->base;
    double start = drape_clock_seconds(), w = s->point.weight;
    for (size_t i = 0; i < s->dofs; i++) {
        size_t at = drape_implicit_at(b, i);
        s->x[at] = b->x_base[at] + d[i];
        s->v[at] = w * d[i];
    }
    drape_system_force(b->system, &s->point, s->g);
    for (size_t i = 0; i < s->dofs; i++)
        s->f[i] = w * w * b->model->mass[b->model->node_of_free[i / 3]] * (d[i] - b->inertia[i]) +
                  s->g[drape_implicit_at(b, i)];
    s->work.residuals++;
    s->work.residual_seconds += drape_clock_seconds() - start;
    return drape_all_finite(s->f, s->dofs);
}

static double largest(const double *f, size_t n)
{
    double max = 0;
    for (size_t i = 0; i < n; i++)
        max = fabs(f[i]) > max ? fabs(f[i]) : max;
    return max;
}

static double dot(const double *a, const double *b, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

/* ---- A correction ---- */

/* Shortens a way of the free nodes from x to what passes through nothing. */
static void stay_free(newton_k *s, const double *x, double *way)
{
    const drape_implicit *b = &s->base;
    if (!s->ahead)
        return;
    memcpy(s->ahead, x, s->nodes * sizeof *x);
    for (size_t i = 0; i < s->dofs; i++)
        s->ahead[drape_implicit_at(b, i)] += way[i];
    double share = drape_system_way(b->system, x, s->ahead, s->point.t);
    for (size_t i = 0; share < 1 && i < s->dofs; i++)
        way[i] *= share;
}

/* s->p with A p = -F. */
static drape_status correct(newton_k *s)
{
    int most = efforts[s->effort].linear_iterations;
    double start = drape_clock_seconds(), w = s->point.weight;
    drape_status status = drape_quasi_update(s->quasi, &s->point, w * w);
    s->work.jacobians++;
    s->work.jacobian_seconds += drape_clock_seconds() - start;
    if (status)
        return status;
    start = drape_clock_seconds();
    for (size_t i = 0; i < s->dofs; i++)
        s->trial[i] = -s->f[i];
    s->work.linear_iterations +=
        drape_quasi_solve(s->quasi, s->trial, s->p, s->values[PARAM_LINEAR_TOLERANCE],
                          most ? most : (int)s->values[PARAM_LINEAR_ITERATIONS]);
    s->work.solve_seconds += drape_clock_seconds() - start;
    return DRAPE_OK;
}

/* d += a p with a share a at which the work along p has not turned too far, found by bisection; the residual is
 * that of the new d then. */
static bool advance(newton_k *s, double *d)
{
    double start = dot(s->f, s->p, s->dofs), a = 1;
    for (int k = 0; k <= MOST_TRIALS; k++, a /= 2) {
        for (size_t i = 0; i < s->dofs; i++)
            s->trial[i] = d[i] + a * s->p[i];
        bool finite = evaluate(s, s->trial);
        if (finite && (k == MOST_TRIALS || !(dot(s->f, s->p, s->dofs) > -WORK_SHARE * start))) {
            memcpy(d, s->trial, s->dofs * sizeof *d);
            return true;
        }
    }
    return false;
}

/* ---- A step ---- */

static drape_status fail(newton_k *s, drape_status status, const char *reason, drape_step_info *info)
{
    info->reason = reason;
    if (status == DRAPE_RETRY_NONFINITE) { /* an element that collapsed on the way is named before a node */
        drape_status degenerate =
            drape_system_check(s->base.system, s->x, NULL, s->point.internal, &info->reason, &info->worst);
        return degenerate ? degenerate : status;
    }
    return status;
}

static drape_status iterate(newton_k *s, drape_step_info *info)
{
    double *d = s->base.d, tolerance = s->values[PARAM_TOLERANCE];
    int wanted =
        efforts[s->effort].iterations ? efforts[s->effort].iterations : (int)s->values[PARAM_ITERATIONS];
    stay_free(s, s->x, d);
    if (!evaluate(s, d))
        return fail(s, DRAPE_RETRY_NONFINITE, "nonfinite", info);
    double first = dot(s->f, s->f, s->dofs);
    for (;; info->iterations++) {
        info->residual = largest(s->f, s->dofs);
        bool fell = dot(s->f, s->f, s->dofs) < first;
        info->reason = info->residual <= tolerance ? "converged" : "iterations";
        if (info->residual <= tolerance || (info->iterations >= wanted && fell))
            return DRAPE_OK;
        if (info->iterations >= wanted + (int)s->values[PARAM_RESCUE_ITERATIONS])
            return fail(s, DRAPE_RETRY_NONLINEAR, "residual", info);
        drape_status status = correct(s);
        if (status)
            return fail(s, status, status < 0 ? "memory" : "singular", info);
        stay_free(s, s->x, s->p);
        if (!advance(s, d))
            return fail(s, DRAPE_RETRY_NONFINITE, "nonfinite", info);
        s->work.newton_iterations++;
    }
}

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    newton_k *s = state;
    drape_implicit *b = &s->base;
    drape_implicit_base(b, in, out->t, h);
    remember(s, in, out->t);
    guess(s, in, h);
    set_history(b, in, h);
    set_point(s, in, h);
    drape_status status = iterate(s, info);
    info->tolerance = fmax(info->residual, s->values[PARAM_TOLERANCE]);
    info->worst = status == DRAPE_RETRY_DEGENERATE
                      ? info->worst
                      : drape_system_worst_dof(b->system, s->f, "residual [N]", info->tolerance);
    if (!status)
        status = drape_system_status(b->system);
    if (status)
        return status;
    memcpy(out->x, s->x, s->nodes * sizeof *out->x);
    memcpy(out->v, s->v, s->nodes * sizeof *out->v);
    drape_implicit_audit_at(b, &s->point, s->g, in, out, info);
    return DRAPE_OK;
}

static void set_effort(void *state, int effort)
{
    ((newton_k *)state)->effort = effort;
}

static drape_work work(const void *state)
{
    const newton_k *s = state;
    drape_work work = s->work;
    if (s->quasi) {
        work.factorizations = drape_quasi_factorizations(s->quasi);
        work.factor_seconds = drape_quasi_factor_seconds(s->quasi);
        work.jacobian_seconds -= work.factor_seconds;
    }
    return work;
}

static size_t bytes(const void *state)
{
    const newton_k *s = state;
    return sizeof *s + drape_implicit_array_bytes(&s->base) +
           ((s->ahead ? 6 : 5) * s->nodes + 3 * s->dofs) * sizeof(double) +
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
    .restart = restart,
    .efforts = sizeof efforts / sizeof *efforts,
    .set_effort = set_effort,
    .work = work,
    .bytes = bytes,
    .destroy = destroy,
};
