/* newton.c: see newton.h. KINSOL owns the iteration; the residual, the Jacobian, the linear solver and all
 * judgement are ours. */
#include "integrators/newton.h"

#include "base/finite.h"
#include "integrators/mixed.h"
#include "solvers/sun_linear.h"
#include "solvers/sundials_memory.h"

#include <float.h>
#include <kinsol/kinsol.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <string.h>

enum { NORM_MAX, NORM_L1, NORM_L2 };
enum { FAILURE_REJECT, FAILURE_ACCEPT };
enum { METHOD_EXACT, METHOD_MODIFIED };
enum { GLOBAL_LINE_SEARCH, GLOBAL_NONE, GLOBAL_WORK, GLOBAL_AUTO };
enum { PREDICTOR_INERTIAL, PREDICTOR_REST };

static const char *const norm_choices[] = {"max", "l1", "l2", NULL};
static const char *const failure_choices[] = {"reject", "accept", NULL};
static const char *const method_choices[] = {"exact", "modified", NULL};
static const char *const global_choices[] = {"line_search", "none", "work", "auto", NULL};
static const char *const predictor_choices[] = {"inertial", "rest", NULL};

/* KINSOL's settings that no user should need, all set, none left to a default. */
#define SETUPS_EXACT    1  /* iterations between Jacobians: exact Newton */
#define SETUPS_MODIFIED 10 /* and modified Newton */
#define STEP_TOLERANCE                                                                                       \
    1e-15 /* of the scene's size: below it a step moves nothing, and the solve stands still */
#define MAX_NEWTON_STEP                                                                                      \
    1e3 /* of the scene's size, a node: KINSOL's own limit depends on the guess and is 1 for d = 0 */
#define WORK_SHARE        0.5 /* of the work along a correction: so much may be left on the far side */
#define MOST_TRIALS       8   /* of the line search, by bisection */
#define MOST_MIXED        8   /* corrections of a solve after which the forces are taken as they are */
#define MOST_CHORDS       2   /* corrections more, with the factors of one */
#define SHORT_STEP        0.5
#define LEAST_SHARE       1e-3 /* of the positive part, that an indefinite matrix is given */
#define MORE_SHARE        4    /* times as much is tried next */
#define MAX_BETA_FAILURES 1000 /* the line search may fail its curvature condition as often as it likes */

const drape_param drape_newton_params[DRAPE_NEWTON_PARAM_COUNT] = {
    [DRAPE_NEWTON_DT] = DRAPE_NUMBER("dt", "s", 1.0 / 60, DRAPE_ABOVE(0), 1e6, "nominal step"),
    [DRAPE_NEWTON_TOLERANCE] =
        DRAPE_NUMBER("tolerance", "N", 1e-6, DRAPE_ABOVE(0), 1e12,
                     "bound on the residual of the free nodes of an accepted state, in norm"),
    [DRAPE_NEWTON_NORM] =
        DRAPE_CHOICE("norm", NORM_MAX, norm_choices,
                     "norm of the residual: largest component, sum, or root of the sum of squares"),
    [DRAPE_NEWTON_MAX_ITERATIONS] =
        DRAPE_INTEGER("max_iterations", "1", 50, 1, 100000, "Newton iterations before the attempt fails"),
    [DRAPE_NEWTON_ON_FAILURE] =
        DRAPE_CHOICE("on_failure", FAILURE_REJECT, failure_choices,
                     "accept: go on with an unconverged state, as the DEP report does; the log says so"),
    [DRAPE_NEWTON_METHOD] =
        DRAPE_CHOICE("newton", METHOD_EXACT, method_choices,
                     "exact: a Jacobian each iteration, but for chords at the end under globalization work; "
                     "modified: factors kept for up to 10 iterations and across steps"),
    [DRAPE_NEWTON_GLOBALIZATION] =
        DRAPE_CHOICE("globalization", GLOBAL_AUTO, global_choices,
                     "none: full Newton steps, failures go to the controller; line_search: steps shortened "
                     "until the residual falls; work: until its work along them does, with positive matrices "
                     "after short ones and where the exact one is not definite; auto: work"),
    [DRAPE_NEWTON_PREDICTOR] =
        DRAPE_CHOICE("predictor", PREDICTOR_INERTIAL, predictor_choices,
                     "guess: the nodes fly on, or stay where they are as in the DEP report"),
    [DRAPE_NEWTON_PROJECT] =
        DRAPE_BOOLEAN("project", false, "project the Hessian of every element to positive semidefinite"),
    [DRAPE_NEWTON_LINEAR_SOLVER] =
        DRAPE_CHOICE("linear_solver", 0, drape_linears_words, "name of a linear solver"),
    [DRAPE_NEWTON_LINEAR_TOLERANCE] =
        DRAPE_NUMBER("linear_tolerance", "1", 1e-3, 1e-14, DRAPE_BELOW(1),
                     "share of the residual that iterative linear solvers leave in a correction"),
};

struct drape_newton {
    drape_context *ctx;
    drape_system *system;
    const drape_model *model;
    double values[DRAPE_NEWTON_PARAM_COUNT];
    int64_t n; /* free DOFs */
    SUNContext sun;
    void *kin;
    N_Vector unknown, ones; /* unknown wraps the caller's d during a solve */
    drape_sun_linear *linear;
    const drape_newton_problem *problem;
    drape_point point;
    double *trial;               /* free DOFs: of the line search; NULL without */
    double *ahead;               /* nodes: where a correction would lead; NULL without contact */
    double *x, *v, *g;           /* nodes: where the residual was evaluated last, and g there */
    double *f;                   /* free DOFs: F there */
    double *chord, *minus_f;     /* free DOFs: of chords; NULL without trial */
    drape_mixed mixed;           /* with trial */
    int corrections;             /* of this solve */
    bool searched;               /* there is trial: the line search ended on it */
    bool nonfinite;              /* a residual was */
    drape_status fitted;         /* of the last change of the pattern: < 0 ends the solve */
    double positive;             /* share of the positive parts in matrices: 1 after a short step, else 0 */
    double enough;               /* the share that made the last indefinite matrix definite */
    double factored_mass_weight; /* of the factors that modified Newton may keep; 0: none */
    drape_work work;
};

/* ---- The callbacks of KINSOL ---- */

static void place(drape_newton *s, const double *d)
{
    const drape_newton_problem *p = s->problem;
    s->searched = false;
    for (int64_t i = 0; i < s->n; i++) {
        int64_t at = 3 * (int64_t)s->model->node_of_free[i / 3] + i % 3;
        s->x[at] = p->x_base[at] + d[i];
        s->v[at] = p->v_base[at] + p->weight * d[i];
    }
}

/* F into s->f; false if it is not finite. A NaN that KINSOL is shown passes for convergence: its norms ignore
 * it. */
static bool evaluate(drape_newton *s, const double *d)
{
    const drape_newton_problem *p = s->problem;
    double start = drape_system_clock(s->system);
    place(s, d);
    drape_system_force(s->system, &s->point, s->g);
    for (int64_t i = 0; i < s->n; i++) {
        int32_t node = s->model->node_of_free[i / 3];
        double inertia = p->mass_weight * s->model->mass[node] * (d[i] - p->inertia[i]);
        s->f[i] = inertia + s->g[3 * (int64_t)node + i % 3];
    }
    s->work.residuals++;
    s->work.residual_seconds += drape_system_clock(s->system) - start;
    return drape_all_finite(s->f, (size_t)s->n);
}

/* The line search has been at the point that KINSOL goes to: F there is known, and finite. */
static bool is_searched(const drape_newton *s, const double *d)
{
    return s->searched && memcmp(d, s->trial, (size_t)s->n * sizeof *d) == 0;
}

/* < 0: no smaller step helps. */
static int residual(N_Vector d, N_Vector f, void *user)
{
    drape_newton *s = user;
    s->nonfinite = !is_searched(s, N_VGetArrayPointer(d)) && !evaluate(s, N_VGetArrayPointer(d));
    memcpy(N_VGetArrayPointer(f), s->f, (size_t)s->n * sizeof *s->f);
    return drape_system_status(s->system) ? -1 : s->nonfinite ? 1 : 0;
}

/* Contact may couple what it did not before: then the solver is made anew. */
static drape_status fit_pattern(drape_newton *s)
{
    bool changed;
    s->fitted = drape_system_fit(s->system, &s->point, &changed);
    s->linear->stale |= changed;
    if (!s->fitted && s->linear->stale)
        s->fitted = drape_sun_linear_adopt(s->linear, drape_system_pattern(s->system));
    return s->fitted;
}

/* Without contact, and without the solver's part of fit_pattern. */
static double jacobian_clock(const drape_newton *s)
{
    return drape_system_clock(s->system) - s->linear->factor_seconds;
}

/* J(d) into the values of the solver. */
static drape_status assemble(drape_newton *s, const double *d)
{
    double start = jacobian_clock(s);
    place(s, d); /* the residual may have been tried elsewhere since */
    drape_status status = fit_pattern(s);
    if (status)
        return status;
    s->point.stress = drape_mixed_stress(&s->mixed);
    drape_system_jacobian(s->system, &s->point, s->problem->mass_weight,
                          s->values[DRAPE_NEWTON_PROJECT] != 0 ? 1 : s->positive, s->linear->values);
    s->factored_mass_weight = s->problem->mass_weight;
    s->work.jacobians++;
    s->work.jacobian_seconds += jacobian_clock(s) - start;
    return DRAPE_OK;
}

static int jacobian(N_Vector d, N_Vector f, SUNMatrix matrix, void *user, N_Vector scratch1,
                    N_Vector scratch2)
{
    (void)f, (void)matrix, (void)scratch1, (void)scratch2;
    return assemble(user, N_VGetArrayPointer(d)) ? -1 : 0;
}

/* The share of a displacement of the free nodes from x that passes through nothing. */
static double free_share(drape_newton *s, const double *x, const double *step)
{
    memcpy(s->ahead, x, 3 * (size_t)s->model->node_count * sizeof *x);
    for (int64_t i = 0; i < s->n; i++)
        s->ahead[3 * (int64_t)s->model->node_of_free[i / 3] + i % 3] += step[i];
    return drape_system_way(s->system, x, s->ahead, s->problem->t);
}

static void scale(double *p, double share, int64_t n)
{
    for (int64_t i = 0; share != 1 && i < n; i++)
        p[i] *= share;
}

static double dot(const double *a, const double *b, int64_t n)
{
    double sum = 0;
    for (int64_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

/* The share a of a correction p that is taken: the work of the residual along it, F(d + a p) . p, is not to be
 * above a share of what it was at a = 0, with the sign that says that the minimum of the energy was passed. The line
 * search of Matthies & Strang 1979: it needs no energy, so it holds for friction and damping too. start:
 * F(d) . p < 0. The positive part of an indefinite matrix is too stiff by far along what is unstable: its corrections
 * are lengthened until they are enough, else a sheet that buckles takes a hundred of them. */
static double search_along(drape_newton *s, const double *p, double start)
{
    const double *d = N_VGetArrayPointer(s->unknown);
    const bool lengthens = s->positive > 0 && !s->ahead;
    double low = 0, high = INFINITY, a = 1;
    for (int k = 0; k < MOST_TRIALS; k++) {
        for (int64_t i = 0; i < s->n; i++)
            s->trial[i] = d[i] + a * p[i];
        s->searched = evaluate(s, s->trial);
        double work = s->searched ? dot(s->f, p, s->n) : INFINITY;
        if (fabs(work) <= -WORK_SHARE * start || (work < 0 && a == 1 && !lengthens))
            return a;
        if (work < 0)
            low = a;
        else
            high = a;
        a = isinf(high) ? 2 * a : (low + high) / 2;
    }
    return low > 0 ? low : a;
}

/* The matrix at the present iterate with this share of its positive part, factored. A share below 1 may be refused. */
static drape_status factor_shared(drape_newton *s, double share)
{
    s->positive = share;
    drape_status status = assemble(s, N_VGetArrayPointer(s->unknown));
    if (status)
        return status;
    s->linear->definite = share < 1;
    status = drape_sun_linear_factor(s->linear);
    s->linear->definite = false;
    return status;
}

/* A matrix that is not definite leads nowhere good. Its positive part does, if slowly: what lies between is closer
 * to Newton's the less it has of it. The share that was enough the last time is tried first, half as much. */
static int factor_or_repair(SUNLinearSolver solver, SUNMatrix matrix)
{
    (void)matrix;
    drape_sun_linear *linear = solver->content;
    drape_newton *s = linear->owner;
    linear->definite = s->positive == 0;
    drape_status status = drape_sun_linear_factor(linear);
    bool refused = status == DRAPE_RETRY_LINEAR && linear->definite;
    linear->definite = false;
    if (!refused)
        return status;
    double share = fmax(s->enough / 2, LEAST_SHARE);
    while ((status = factor_shared(s, share)) == DRAPE_RETRY_LINEAR && share < 1)
        share = fmin(1, MORE_SHARE * share);
    s->enough = share;
    return status;
}

/* A correction that climbs is none: the matrix was indefinite. Its positive part gives one that descends. */
static drape_status descend(drape_newton *s, N_Vector x, N_Vector b)
{
    double *p = N_VGetArrayPointer(x), *minus_f = N_VGetArrayPointer(b);
    if (dot(minus_f, p, s->n) > 0 || s->positive == 1)
        return DRAPE_OK;
    drape_status status = factor_shared(s, 1);
    return status ? status : drape_sun_linear_solve(s->linear, minus_f, p);
}

/* KINSOL stops at the largest component; this bound on it implies the bound in the norm that was asked for.
 */
static double max_norm_bound(const drape_newton *s)
{
    double tolerance = s->values[DRAPE_NEWTON_TOLERANCE], norm = s->values[DRAPE_NEWTON_NORM];
    if (norm == NORM_L1)
        return tolerance / (double)s->n;
    return norm == NORM_L2 ? tolerance / sqrt((double)s->n) : tolerance;
}

static double largest(const double *f, int64_t n)
{
    double most = 0;
    for (int64_t i = 0; i < n; i++)
        most = fmax(most, fabs(f[i]));
    return most;
}

/* Where factors served so well that they will do for the rest, what is left is corrected with them: a chord costs a
 * tenth of a Newton iteration. F is known at the end of the correction p; `first` is what it was before, and its fall is
 * expected once more of each chord. What does not fall is undone. */
static drape_status add_chords(drape_newton *s, double *p, double first)
{
    const double *d = N_VGetArrayPointer(s->unknown), bound = max_norm_bound(s);
    double before = largest(s->f, s->n), rate = before / first;
    for (int left = MOST_CHORDS; left > 0 && before > bound && before * pow(rate, left) <= bound; left--) {
        for (int64_t i = 0; i < s->n; i++)
            s->minus_f[i] = -s->f[i];
        drape_status status = drape_sun_linear_solve(s->linear, s->minus_f, s->chord);
        if (status)
            return status;
        for (int64_t i = 0; i < s->n; i++)
            s->trial[i] = d[i] + (p[i] + s->chord[i]);
        s->searched = evaluate(s, s->trial);
        double after = s->searched ? largest(s->f, s->n) : INFINITY;
        if (!(after < before)) {
            s->searched = false;
            return DRAPE_OK;
        }
        for (int64_t i = 0; i < s->n; i++)
            p[i] += s->chord[i];
        rate = after / before;
        before = after;
    }
    return DRAPE_OK;
}

/* Where many corrections did not lead to an end, sheets buckle: there forces to first order in the last correction say
 * little, and the iteration may go in circles. */
static void correct_mixed(drape_newton *s, const double *p)
{
    double start = drape_system_clock(s->system);
    if (++s->corrections <= MOST_MIXED)
        drape_mixed_correct(&s->mixed, &s->point, p);
    else
        drape_mixed_forget(&s->mixed);
    s->work.jacobian_seconds += drape_system_clock(s->system) - start;
}

/* After a short step the next matrix is the positive part, after a whole one the exact one again. */
static drape_status globalize(drape_newton *s, N_Vector x, N_Vector b)
{
    double *p = N_VGetArrayPointer(x);
    drape_status status = s->trial ? descend(s, x, b) : DRAPE_OK;
    if (status || !drape_all_finite(p, (size_t)s->n))
        return status;
    if (s->ahead)
        scale(p, free_share(s, s->x, p), s->n);
    double start = s->trial ? -dot(N_VGetArrayPointer(b), p, s->n) : 0;
    if (start >= 0)
        return DRAPE_OK;
    correct_mixed(s, p);
    double a = search_along(s, p, start);
    scale(p, a, s->n);
    s->positive = a < SHORT_STEP;
    if (a != 1)
        drape_mixed_forget(&s->mixed);
    else if (s->searched && !s->ahead && s->mixed.wanted)
        return add_chords(s, p, largest(N_VGetArrayPointer(b), s->n));
    return DRAPE_OK;
}

/* The correction of Newton, cut short where on the way cloth would pass through something, and where it goes too
 * far. */
static int solve_and_globalize(SUNLinearSolver solver, SUNMatrix matrix, N_Vector x, N_Vector b,
                               sunrealtype tolerance)
{
    (void)matrix, (void)tolerance;
    drape_sun_linear *linear = solver->content;
    drape_status status = drape_sun_linear_solve(linear, N_VGetArrayPointer(b), N_VGetArrayPointer(x));
    return status ? status : globalize(linear->owner, x, b);
}

/* ---- Making and freeing ---- */

static drape_status create_vectors(drape_newton *s)
{
    size_t nodes = 3 * (size_t)s->model->node_count;
    s->x = drape_alloc(s->ctx, nodes, sizeof *s->x);
    s->v = drape_alloc(s->ctx, nodes, sizeof *s->v);
    s->g = drape_alloc(s->ctx, nodes, sizeof *s->g);
    s->f = drape_alloc(s->ctx, (size_t)s->n, sizeof *s->f);
    bool searches = s->values[DRAPE_NEWTON_GLOBALIZATION] == GLOBAL_WORK;
    if (searches) {
        s->trial = drape_alloc(s->ctx, (size_t)s->n, sizeof *s->trial);
        s->chord = drape_alloc(s->ctx, (size_t)s->n, sizeof *s->chord);
        s->minus_f = drape_alloc(s->ctx, (size_t)s->n, sizeof *s->minus_f);
    }
    if (drape_system_contact(s->system))
        s->ahead = drape_alloc(s->ctx, nodes, sizeof *s->ahead);
    if (!s->x || !s->v || !s->g || !s->f || (drape_system_contact(s->system) && !s->ahead) ||
        (searches && (!s->trial || !s->chord || !s->minus_f)))
        return DRAPE_E_MEMORY;
    if (searches && drape_mixed_init(s->ctx, s->system, &s->mixed))
        return DRAPE_E_MEMORY;
    s->unknown = N_VMake_Serial(s->n, s->f, s->sun);
    s->ones = N_VNew_Serial(s->n, s->sun);
    if (!s->unknown || !s->ones)
        return drape_fail_memory(s->ctx, (size_t)s->n * sizeof(double));
    N_VConst(1, s->ones);
    return DRAPE_OK;
}

static bool configure(drape_newton *s)
{
    bool exact = s->values[DRAPE_NEWTON_METHOD] == METHOD_EXACT;
    DRAPE_KINSOL_QUIET(s->kin);
    return !KINInit(s->kin, residual, s->unknown) && !KINSetUserData(s->kin, s) &&
           !KINSetLinearSolver(s->kin, s->linear->solver, s->linear->matrix) &&
           !KINSetJacFn(s->kin, jacobian) && !KINSetFuncNormTol(s->kin, max_norm_bound(s)) &&
           !KINSetScaledStepTol(s->kin, STEP_TOLERANCE * s->model->length) &&
           !KINSetMaxNewtonStep(s->kin, MAX_NEWTON_STEP * s->model->length * sqrt((double)s->n)) &&
           !KINSetNumMaxIters(s->kin, (long)s->values[DRAPE_NEWTON_MAX_ITERATIONS]) &&
           !KINSetMaxSetupCalls(s->kin, exact ? SETUPS_EXACT : SETUPS_MODIFIED) &&
           !KINSetNoResMon(s->kin, exact) && !KINSetMaxBetaFails(s->kin, MAX_BETA_FAILURES);
}

drape_status drape_newton_create(drape_context *ctx, drape_system *system, const double *values,
                                 drape_newton **out)
{
    drape_newton *s = drape_alloc(ctx, 1, sizeof *s);
    *out = s;
    if (!s)
        return DRAPE_E_MEMORY;
    s->ctx = ctx;
    s->system = system;
    s->model = drape_system_model(system);
    s->n = 3 * (int64_t)s->model->free_count;
    s->enough = 1;
    memcpy(s->values, values, sizeof s->values);
    if (s->values[DRAPE_NEWTON_GLOBALIZATION] == GLOBAL_AUTO)
        s->values[DRAPE_NEWTON_GLOBALIZATION] = GLOBAL_WORK;
    drape_status status = DRAPE_OK;
    if (drape_sundials_context(&s->sun) || !(s->kin = KINCreate(s->sun)))
        status = drape_fail_memory(ctx, sizeof(void *));
    if (!status)
        status = create_vectors(s);
    if (!status && s->n > 0)
        status =
            drape_sun_linear_create(ctx, s->sun, drape_linears[(int)values[DRAPE_NEWTON_LINEAR_SOLVER]],
                                    drape_system_pattern(system), drape_system_crew(s->system), &s->linear);
    if (!status && s->n > 0)
        s->linear->tolerance = values[DRAPE_NEWTON_LINEAR_TOLERANCE];
    if (!status && s->n > 0 && (s->ahead || s->trial)) {
        s->linear->owner = s;
        s->linear->solver->ops->solve = solve_and_globalize;
        if (s->trial)
            s->linear->solver->ops->setup = factor_or_repair;
    }
    if (!status && s->n > 0 && !configure(s))
        status =
            drape_fail(ctx, DRAPE_E_MEMORY, "KINSOL cannot be set up for %lld unknowns", (long long)s->n);
    if (status)
        drape_newton_destroy(out);
    return status;
}

void drape_newton_destroy(drape_newton **newton)
{
    drape_newton *s = *newton;
    if (!s)
        return;
    if (s->kin)
        KINFree(&s->kin);
    drape_sun_linear_destroy(&s->linear);
    if (s->unknown)
        N_VDestroy(s->unknown);
    if (s->ones)
        N_VDestroy(s->ones);
    if (s->sun)
        SUNContext_Free(&s->sun);
    drape_free(s->ctx, s->x);
    drape_free(s->ctx, s->v);
    drape_free(s->ctx, s->g);
    drape_free(s->ctx, s->f);
    drape_free(s->ctx, s->ahead);
    drape_free(s->ctx, s->trial);
    drape_free(s->ctx, s->chord);
    drape_free(s->ctx, s->minus_f);
    drape_mixed_free(&s->mixed);
    drape_free(s->ctx, s);
    *newton = NULL;
}

/* ---- One solve ---- */

static double norm_of(const drape_newton *s)
{
    double max = 0, sum = 0, squares = 0;
    for (int64_t i = 0; i < s->n; i++) {
        max = fmax(max, fabs(s->f[i]));
        sum += fabs(s->f[i]);
        squares += s->f[i] * s->f[i];
    }
    if (s->values[DRAPE_NEWTON_NORM] == NORM_L1)
        return sum;
    return s->values[DRAPE_NEWTON_NORM] == NORM_L2 ? sqrt(squares) : max;
}

#define ROUNDINGS 4 /* of each of the terms of a residual: their own, their products', their sum's */

/* Every return code of KINSol, as what it means for the step. */
static drape_status status_of(int code, const char **reason)
{
    switch (code) {
    case KIN_SUCCESS:
    case KIN_INITIAL_GUESS_OK:
        *reason = "converged";
        return DRAPE_OK;
    case KIN_STEP_LT_STPTOL: /* positive, but not converged */
        *reason = "stagnation";
        return DRAPE_RETRY_NONLINEAR;
    case KIN_MAXITER_REACHED:
        *reason = "max_iterations";
        return DRAPE_RETRY_NONLINEAR;
    case KIN_LINESEARCH_NONCONV:
    case KIN_LINESEARCH_BCFAIL:
        *reason = "line_search";
        return DRAPE_RETRY_NONLINEAR;
    case KIN_MXNEWT_5X_EXCEEDED:
        *reason = "newton_step";
        return DRAPE_RETRY_NONLINEAR;
    case KIN_LINSOLV_NO_RECOVERY:
    case KIN_LSETUP_FAIL:
    case KIN_LSOLVE_FAIL:
        *reason = "singular";
        return DRAPE_RETRY_LINEAR;
    case KIN_SYSFUNC_FAIL:
    case KIN_FIRST_SYSFUNC_ERR:
    case KIN_REPTD_SYSFUNC_ERR:
        *reason = "nonfinite";
        return DRAPE_RETRY_NONFINITE;
    default: /* KIN_MEM_NULL, KIN_ILL_INPUT, KIN_NO_MALLOC, KIN_MEM_FAIL, KIN_LINIT_FAIL, KIN_VECTOROP_ERR
                ...: no smaller step helps */
        *reason = "solver";
        return DRAPE_E_SOLVER;
    }
}

static void begin(drape_newton *s, const drape_newton_problem *problem)
{
    size_t bytes = 3 * (size_t)s->model->node_count * sizeof *s->x;
    s->problem = problem;
    s->point = (drape_point){.x = s->x,
                             .v = s->v,
                             .internal = problem->internal,
                             .weight = problem->weight,
                             .history = problem->history,
                             .t = problem->t,
                             .span = {problem->span[0], problem->span[1]}};
    memcpy(s->x, problem->x_base, bytes);
    memcpy(s->v, problem->v_base, bytes);
    s->nonfinite = s->searched = false;
    s->positive = 0;
    s->fitted = DRAPE_OK;
    drape_point start = s->point;
    start.x = problem->x_start;
    double clock = drape_system_clock(s->system);
    s->corrections = 0;
    if (s->trial)
        drape_mixed_begin(&s->mixed, start.x ? &start : NULL);
    s->work.jacobian_seconds += drape_system_clock(s->system) - clock;
}

/* KINSOL's counters start anew with each KINSol. */
static void count_iterations(drape_newton *s, drape_step_info *info)
{
    long iterations = 0;
    KINGetNumNonlinSolvIters(s->kin, &iterations);
    info->iterations = (int)iterations;
    s->work.newton_iterations += iterations;
}

/* A number that is not finite has a cause: an element that collapsed on the way is named before a node. */
static drape_status blame_element(drape_newton *s, drape_status status, drape_step_info *info)
{
    drape_status degenerate =
        drape_system_check(s->system, s->x, NULL, s->problem->internal, &info->reason, &info->worst);
    return degenerate ? degenerate : status;
}

/* Of F at d, in the norm: its terms are rounded to some DBL_EPSILON of themselves. At small h the inertia of a
 * node in flight alone, M |v|/h, is more than 1e16 times a tight tolerance, and halving h doubles it. */
static double rounding_of(drape_newton *s, const double *d)
{
    const drape_newton_problem *p = s->problem;
    for (int64_t i = 0; i < s->n; i++) {
        int32_t node = s->model->node_of_free[i / 3];
        double inertia = p->mass_weight * s->model->mass[node] * (fabs(d[i]) + fabs(p->inertia[i]));
        s->f[i] = ROUNDINGS * DBL_EPSILON * (inertia + fabs(s->g[3 * (int64_t)node + i % 3]));
    }
    return norm_of(s);
}

static drape_status judge(drape_newton *s, drape_status status, const double *d, drape_step_info *info)
{
    double tolerance = s->values[DRAPE_NEWTON_TOLERANCE];
    if (status) /* the last evaluation was a trial: say what is true of d */
        s->nonfinite = !evaluate(s, d);
    info->tolerance = tolerance;
    info->residual = s->nonfinite ? NAN : norm_of(s);
    info->worst = drape_system_worst_dof(s->system, s->f, "residual [N]", tolerance);
    if (info->residual <= tolerance) {
        info->reason = "converged";
        return DRAPE_OK;
    }
    double rounding = s->nonfinite ? NAN : rounding_of(s, d);
    if (info->residual <= rounding) {
        info->reason = "rounding";
        info->tolerance = rounding;
        return DRAPE_OK;
    }
    if (!status) { /* unreachable as long as KINSOL tests what it says */
        info->reason = "residual";
        status = DRAPE_RETRY_NONLINEAR;
    }
    info->usable = info->lenient && !s->nonfinite && status > 0;
    return s->nonfinite ? blame_element(s, status, info) : status;
}

/* A guess beyond a limit is worse than none: springs that are too long pull with forces far above any that act. */
static void improve_guess(drape_newton *s, double *d)
{
    if (s->ahead) /* from d = 0 */
        scale(d, free_share(s, s->x, d), s->n);
    place(s, d);
    if (drape_system_breaks_limit(s->system, s->x, s->problem->x_base, s->problem->internal))
        memset(d, 0, (size_t)s->n * sizeof *d);
}

drape_status drape_newton_solve(drape_newton *s, const drape_newton_problem *problem, double *d,
                                drape_step_info *info)
{
    begin(s, problem);
    info->reason = "converged";
    info->lenient = s->values[DRAPE_NEWTON_ON_FAILURE] == FAILURE_ACCEPT;
    if (s->n == 0) {
        evaluate(s, d);
        return DRAPE_OK;
    }
    bool keep =
        s->values[DRAPE_NEWTON_METHOD] == METHOD_MODIFIED && s->factored_mass_weight == problem->mass_weight;
    KINSetNoInitSetup(s->kin, keep);
    improve_guess(s, d);
    N_VSetArrayPointer(d, s->unknown);
    int strategy = s->values[DRAPE_NEWTON_GLOBALIZATION] == GLOBAL_LINE_SEARCH ? KIN_LINESEARCH : KIN_NONE;
    drape_status status = status_of(KINSol(s->kin, s->unknown, strategy, s->ones, s->ones), &info->reason);
    count_iterations(s, info);
    if (drape_system_status(s->system))
        return drape_system_status(s->system);
    drape_status fatal = s->fitted < 0 ? s->fitted : s->linear->status;
    if (fatal < 0) {
        info->reason = "memory";
        return fatal;
    }
    if (status)
        drape_newton_forget_factors(s);
    return judge(s, status, d, info);
}

const drape_point *drape_newton_point(const drape_newton *newton)
{
    return &newton->point;
}

/* Contact may couple there what it did not where the last solve was. */
drape_status drape_newton_matrix(drape_newton *s, const drape_point *point, double mass_weight,
                                 const drape_pattern **pattern, const double **values)
{
    s->point = *point;
    drape_newton_forget_factors(s);
    drape_status status = fit_pattern(s);
    if (status)
        return status;
    drape_system_jacobian(s->system, point, mass_weight, 0, s->linear->values);
    *pattern = drape_system_pattern(s->system);
    *values = s->linear->values;
    return DRAPE_OK;
}

const double *drape_newton_residual(const drape_newton *newton)
{
    return newton->f;
}

const double *drape_newton_force(const drape_newton *newton)
{
    return newton->g;
}

const double *drape_newton_values(const drape_newton *newton)
{
    return newton->values;
}

void drape_newton_forget_factors(drape_newton *newton)
{
    newton->factored_mass_weight = 0;
}

/* Modified Newton goes on with its factors, and watches the residual by what it was in the solve before. */
void drape_newton_archive(drape_newton *s, drape_archive *a)
{
    const bool modified = s->values[DRAPE_NEWTON_METHOD] == METHOD_MODIFIED;
    drape_archive_mark(a, "newton");
    drape_archive_doubles(a, s->f, (size_t)s->n);
    drape_archive_double(a, &s->enough);
    drape_archive_double(a, &s->factored_mass_weight);
    drape_work_archive(&s->work, a);
    if (s->n == 0)
        return;
    if (drape_archive_is_reading(a))
        drape_archive_note(a, drape_sun_linear_adopt_other(s->linear, drape_system_pattern(s->system)));
    drape_sun_linear_archive(s->linear, a, modified && s->factored_mass_weight != 0);
    if (modified && !drape_kinsol_archive(s->kin, a) && a->reading)
        drape_newton_forget_factors(s);
}

drape_work drape_newton_work(const drape_newton *newton)
{
    drape_work work = newton->work;
    if (newton->linear) {
        work.factorizations = newton->linear->factorizations;
        work.linear_iterations = newton->linear->iterations;
        work.factor_seconds = newton->linear->factor_seconds;
        work.solve_seconds = newton->linear->solve_seconds;
    }
    return work;
}

size_t drape_newton_bytes(const drape_newton *newton)
{
    size_t nodes = 3 * (size_t)newton->model->node_count, n = (size_t)newton->n;
    size_t values = (size_t)drape_system_pattern(newton->system)->nonzeros;
    size_t factors = newton->linear ? newton->linear->ops->bytes(newton->linear->state) : 0;
    size_t searches = (newton->ahead ? nodes : 0) + (newton->trial ? 3 * n : 0);
    if (newton->trial)
        factors += drape_mixed_bytes(&newton->mixed);
    return (3 * nodes + 8 * n + searches + values) * sizeof(double) + factors; /* KINSOL keeps 6 vectors */
}
