/*
 * projective: backward Euler by a fixed point with a matrix that never changes, as projective dynamics has it (Liu,
 * Bouaziz & Kavan 2017, Quasi-Newton methods for real-time simulation of hyperelastic materials):
 *     d <- d - A^-1 F(d),  A = M/h^2 + C
 * with the scalar matrix C of all strain measures (scalar.h), one unknown a node for all three coordinates, factored
 * once for each size of step. KINSOL iterates and accelerates (Anderson 1965; Peng et al. 2018, Anderson acceleration
 * for geometry optimization and physics simulation).
 *
 * The matrix is as stiff across the sheet as along it, where a swinging sheet has nothing but its inertia: the motion
 * across is held back, which acceleration undoes in part. newton_k is nearer to the converged step for the same time
 * (docs/realtime.md); this row has a bound on each step that is the smallest of all, and no matrix to assemble in it.
 *
 * KINSOL ignores what a fixed point function returns, so the residual of the end is judged as in rung.h.
 */
#include "integrators/rung.h"
#include "integrators/scalar.h"
#include "solvers/sundials_compat.h"

#include "base/clock.h"

#include <kinsol/kinsol.h>
#include <klu.h>
#include <nvector/nvector_serial.h>
#include <string.h>

enum { PARAM_DT, PARAM_ITERATIONS, PARAM_TOLERANCE, PARAM_EXTRAPOLATION, PARAM_ACCELERATION, PARAM_COUNT };

static const drape_param params[PARAM_COUNT] = {
    [PARAM_DT] = DRAPE_NUMBER("dt", "s", 1.0 / 60, DRAPE_ABOVE(0), 1e6, "nominal step"),
    [PARAM_ITERATIONS] = DRAPE_INTEGER("iterations", "1", 10, 1, 1000, "of the fixed point, a step"),
    [PARAM_TOLERANCE] = DRAPE_NUMBER("tolerance", "N", 1e-6, DRAPE_ABOVE(0), 1e12,
                                     "residual of the free nodes, largest component, that ends the "
                                     "iteration; not a bound on an accepted state"),
    [PARAM_EXTRAPOLATION] = DRAPE_NUMBER("extrapolation", "1", 0.5, 0, 1,
                                         "share of the last change of velocity that the guess takes along"),
    [PARAM_ACCELERATION] =
        DRAPE_INTEGER("acceleration", "1", 5, 0, 20, "iterates that Anderson acceleration combines; 0: none"),
};

#define ORDER_AMD 0
#define RIGHT     3 /* coordinates */

/* Iterations at each effort; 0: as the parameters say. */
static const int efforts[] = {0, 5, 2};

typedef struct projective {
    drape_rung rung;
    double values[PARAM_COUNT];
    drape_scalar scalar;
    SuiteSparse_long *column, *row; /* the scalar matrix in KLU's indices: it is symmetric */
    klu_l_common common;
    klu_l_symbolic *symbolic;
    klu_l_numeric *numeric;
    double chosen_for; /* [1/s] the weight of the matrix that the pivots were chosen for */
    bool refactored;   /* since */
    double *z;         /* (3 x free nodes) by coordinates */
    SUNContext sun;
    void *kin;
    N_Vector unknown, ones;
    bool nonfinite, solved; /* of this step: a residual was; the tolerance was reached */
    int effort;
} projective;

/* ---- The scalar system ---- */

static drape_status analyse(projective *s)
{
    drape_context *ctx = s->rung.base.ctx;
    const drape_scalar *c = &s->scalar;
    size_t n = (size_t)c->n, entries = (size_t)c->start[n];
    s->column = drape_alloc(ctx, n + 1, sizeof *s->column);
    s->row = drape_alloc(ctx, entries, sizeof *s->row);
    s->z = drape_alloc(ctx, RIGHT * n, sizeof *s->z);
    if (!s->column || !s->row || !s->z)
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i <= n; i++)
        s->column[i] = c->start[i];
    for (size_t i = 0; i < entries; i++)
        s->row[i] = c->column[i];
    klu_l_defaults(&s->common);
    s->common.ordering = ORDER_AMD;
    s->common.btf = 0;
    s->symbolic = klu_l_analyze(c->n, s->column, s->row, &s->common);
    return s->symbolic ? DRAPE_OK : drape_fail_memory(ctx, entries * sizeof(double));
}

/* The factors for a size of step. The matrix is positive definite: its pivots stay good, and later factorisations
 * take no heap. */
static drape_status factor(projective *s, double weight)
{
    double start = drape_clock_seconds();
    if (!drape_scalar_weigh(&s->scalar, weight, weight * weight) && s->numeric)
        return DRAPE_OK;
    s->refactored = s->numeric != NULL;
    if (s->numeric)
        klu_l_refactor(s->column, s->row, s->scalar.sum, s->symbolic, s->numeric, &s->common);
    else {
        s->chosen_for = weight;
        s->numeric = klu_l_factor(s->column, s->row, s->scalar.sum, s->symbolic, &s->common);
    }
    s->rung.work.factorizations++;
    s->rung.work.factor_seconds += drape_clock_seconds() - start;
    if (!s->numeric && s->common.status == KLU_OUT_OF_MEMORY)
        return drape_fail_memory(s->rung.base.ctx, sizeof(double));
    return s->numeric && s->common.status == KLU_OK ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

/* g = d - A^-1 F */
static void correct(projective *s, const double *d, double *g)
{
    drape_rung *r = &s->rung;
    size_t n = r->dofs / RIGHT;
    double start = drape_clock_seconds();
    for (size_t i = 0; i < r->dofs; i++)
        s->z[i % RIGHT * n + i / RIGHT] = r->f[i];
    klu_l_solve(s->symbolic, s->numeric, (SuiteSparse_long)n, RIGHT, s->z, &s->common);
    for (size_t i = 0; i < r->dofs; i++)
        g[i] = d[i] - s->z[i % RIGHT * n + i / RIGHT];
    r->work.linear_iterations++;
    r->work.solve_seconds += drape_clock_seconds() - start;
}

/* The function of KINSOL. Where it cannot go on it says that d is a fixed point, so that KINSOL ends. */
static int fixed_point(N_Vector d_vector, N_Vector g_vector, void *user)
{
    projective *s = user;
    const double *d = N_VGetArrayPointer(d_vector);
    double *g = N_VGetArrayPointer(g_vector);
    s->nonfinite = s->nonfinite || !drape_rung_evaluate(&s->rung, d);
    s->solved = !s->nonfinite && drape_rung_residual(&s->rung) <= s->values[PARAM_TOLERANCE];
    if (s->nonfinite || s->solved)
        memcpy(g, d, s->rung.dofs * sizeof *g);
    else
        correct(s, d, g);
    return 0;
}

/* ---- Making and freeing ---- */

static void destroy(void **state)
{
    projective *s = *state;
    if (!s)
        return;
    drape_context *ctx = s->rung.base.ctx;
    if (s->kin)
        KINFree(&s->kin);
    if (s->unknown)
        N_VDestroy(s->unknown);
    if (s->ones)
        N_VDestroy(s->ones);
    if (s->sun)
        SUNContext_Free(&s->sun);
    klu_l_free_numeric(&s->numeric, &s->common);
    klu_l_free_symbolic(&s->symbolic, &s->common);
    drape_free(ctx, s->column);
    drape_free(ctx, s->row);
    drape_free(ctx, s->z);
    drape_scalar_free(ctx, &s->scalar);
    drape_rung_free(&s->rung);
    drape_free(ctx, s);
    *state = NULL;
}

/* Where d moves by less than a rounding of the scene's size, KINSOL ends, too. */
#define STEP_TOLERANCE 1e-15

static drape_status open_kinsol(projective *s)
{
    drape_rung *r = &s->rung;
    int64_t n = (int64_t)r->dofs;
    if (drape_sundials_context(&s->sun) || !(s->kin = KINCreate(s->sun)) ||
        !(s->unknown = N_VMake_Serial(n, r->f, s->sun)) || !(s->ones = N_VNew_Serial(n, s->sun)))
        return drape_fail_memory(r->base.ctx, (size_t)n * sizeof(double));
    N_VConst(1, s->ones);
    DRAPE_KINSOL_QUIET(s->kin);
    if (KINSetMAA(s->kin, (long)s->values[PARAM_ACCELERATION]) || KINInit(s->kin, fixed_point, s->unknown) ||
        KINSetUserData(s->kin, s) || KINSetFuncNormTol(s->kin, STEP_TOLERANCE * r->base.model->length))
        return drape_fail(r->base.ctx, DRAPE_E_MEMORY, "KINSOL cannot be set up for %lld unknowns",
                          (long long)n);
    return DRAPE_OK;
}

static drape_status create(drape_context *ctx, drape_system *system, const double *values, void **state)
{
    projective *s = drape_alloc(ctx, 1, sizeof *s);
    *state = s;
    if (!s)
        return DRAPE_E_MEMORY;
    klu_l_defaults(&s->common);
    memcpy(s->values, values, sizeof s->values);
    drape_status status = drape_rung_init(ctx, system, &s->rung);
    if (!status && s->rung.dofs > 0)
        status = drape_scalar_build(ctx, system, true, &s->scalar);
    if (!status && s->rung.dofs > 0)
        status = analyse(s);
    if (!status && s->rung.dofs > 0)
        status = open_kinsol(s);
    if (status)
        destroy(state);
    return status;
}

/* ---- A step ---- */

static drape_status iterate(projective *s, drape_step_info *info)
{
    drape_rung *r = &s->rung;
    double *d = r->base.d;
    long iterations = 0;
    s->nonfinite = s->solved = false;
    N_VSetArrayPointer(d, s->unknown);
    KINSetNumMaxIters(s->kin, efforts[s->effort] ? efforts[s->effort] : (long)s->values[PARAM_ITERATIONS]);
    int code = KINSol(s->kin, s->unknown, KIN_FP, s->ones, s->ones);
    KINGetNumNonlinSolvIters(s->kin, &iterations);
    info->iterations = (int)iterations;
    r->work.newton_iterations += iterations;
    if (code < 0 && code != KIN_MAXITER_REACHED)
        return drape_rung_fail(r, DRAPE_RETRY_NONLINEAR, "fixed_point", info);
    for (size_t i = 0; i < r->dofs;
         i++) /* the way from the start of the step, which may lead through something */
        r->trial[i] = d[i];
    drape_rung_stay_free(r, r->base.x_base, r->trial);
    memcpy(d, r->trial, r->dofs * sizeof *d);
    if (s->nonfinite || !drape_rung_evaluate(r, d))
        return drape_rung_fail(r, DRAPE_RETRY_NONFINITE, "nonfinite", info);
    info->reason = drape_rung_residual(r) <= s->values[PARAM_TOLERANCE] ? "converged" : "iterations";
    return s->solved || drape_rung_fell(r) ? DRAPE_OK
                                           : drape_rung_fail(r, DRAPE_RETRY_NONLINEAR, "residual", info);
}

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    projective *s = state;
    drape_rung *r = &s->rung;
    info->reason = "converged";
    drape_status status = drape_rung_begin(r, in, out->t, h, s->values[PARAM_EXTRAPOLATION], info);
    if (!status && r->dofs > 0 && drape_rung_residual(r) > s->values[PARAM_TOLERANCE]) {
        status = factor(s, 1 / h);
        status =
            status ? drape_rung_fail(r, status, status < 0 ? "memory" : "singular", info) : iterate(s, info);
    }
    return drape_rung_finish(r, status, in, out, s->values[PARAM_TOLERANCE], info);
}

static void set_effort(void *state, int effort)
{
    ((projective *)state)->effort = effort;
}

static drape_work work(const void *state)
{
    return ((const projective *)state)->rung.work;
}

/* The same factorisations again: those by kept pivots have other roundings. */
static void factor_again(projective *s, bool factored, double chosen_for, bool refactored, double weight,
                         drape_archive *a)
{
    drape_status status = factored ? factor(s, chosen_for) : DRAPE_OK;
    if (!status && refactored) {
        s->scalar.weight = 0; /* also where it is the same matrix */
        status = factor(s, weight);
    }
    if (status)
        drape_archive_fail(a, DRAPE_E_SOLVER, "the matrix of the checkpoint has no factors here");
}

static void archive(void *state, drape_archive *a)
{
    projective *s = state;
    bool factored = s->numeric != NULL, refactored = s->refactored;
    double chosen_for = s->chosen_for, weight = s->scalar.weight;
    drape_archive_bool(a, &factored);
    drape_archive_bool(a, &refactored);
    drape_archive_double(a, &chosen_for);
    drape_archive_double(a, &weight);
    if (drape_archive_is_reading(a))
        factor_again(s, factored, chosen_for, refactored, weight, a);
    drape_rung_archive(&s->rung, a);
}

/* KLU's factors and KINSOL's 2 m + 4 vectors are in it. */
static size_t bytes(const void *state)
{
    const projective *s = state;
    size_t n = s->rung.dofs / RIGHT, entries = n ? (size_t)s->scalar.start[n] : 0;
    size_t vectors = 2 * (size_t)s->values[PARAM_ACCELERATION] + 5;
    return sizeof *s + drape_rung_bytes(&s->rung) + (n ? drape_scalar_bytes(&s->scalar) : 0) +
           s->common.memusage + (n + 1 + entries) * sizeof *s->row +
           (vectors * s->rung.dofs + RIGHT * n) * sizeof(double);
}

const drape_integrator_ops drape_integrator_projective = {
    .name = "projective",
    .summary =
        "backward Euler by a fixed point with a constant matrix and Anderson acceleration: bounded steps",
    .reference = "Liu, Bouaziz & Kavan 2017; Anderson 1965; Peng et al. 2018",
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
