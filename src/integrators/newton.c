/* newton.c: see newton.h. KINSOL owns the iteration; the residual, the Jacobian, the linear solver and all
 * judgement are ours. */
#include "integrators/newton.h"

#include "base/clock.h"
#include "base/finite.h"
#include "solvers/sun_linear.h"

#include <kinsol/kinsol.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <string.h>

enum { NORM_MAX, NORM_L1, NORM_L2 };
enum { FAILURE_REJECT, FAILURE_ACCEPT };
enum { METHOD_EXACT, METHOD_MODIFIED };
enum { GLOBAL_LINE_SEARCH, GLOBAL_NONE };
enum { PREDICTOR_INERTIAL, PREDICTOR_REST };

static const char *const norm_choices[] = {"max", "l1", "l2", NULL};
static const char *const failure_choices[] = {"reject", "accept", NULL};
static const char *const method_choices[] = {"exact", "modified", NULL};
static const char *const global_choices[] = {"line_search", "none", NULL};
static const char *const predictor_choices[] = {"inertial", "rest", NULL};

/* KINSOL's settings that no user should need, all set, none left to a default. */
#define SETUPS_EXACT    1  /* iterations between Jacobians: exact Newton */
#define SETUPS_MODIFIED 10 /* and modified Newton */
#define STEP_TOLERANCE                                                                                       \
    1e-15 /* of the scene's size: below it a step moves nothing, and the solve stands still */
#define MAX_NEWTON_STEP                                                                                      \
    1e3 /* of the scene's size, a node: KINSOL's own limit depends on the guess and is 1 for d = 0 */
#define MAX_BETA_FAILURES 1000 /* the line search may fail its curvature condition as often as it likes */

const drape_param drape_newton_params[DRAPE_NEWTON_PARAM_COUNT] = {
    [DRAPE_NEWTON_DT] = {.name = "dt",
                         .unit = "s",
                         .default_value = 1.0 / 60,
                         .min = 0,
                         .max = 1e6,
                         .open_min = true,
                         .help = "nominal step"},
    [DRAPE_NEWTON_TOLERANCE] = {.name = "tolerance",
                                .unit = "N",
                                .default_value = 1e-6,
                                .min = 0,
                                .max = 1e12,
                                .open_min = true,
                                .help =
                                    "bound on the residual of the free nodes of an accepted state, in norm"},
    [DRAPE_NEWTON_NORM] = {.name = "norm",
                           .kind = DRAPE_PARAM_CHOICE,
                           .unit = "1",
                           .default_value = NORM_MAX,
                           .choices = norm_choices,
                           .help =
                               "norm of the residual: largest component, sum, or root of the sum of squares"},
    [DRAPE_NEWTON_MAX_ITERATIONS] = {.name = "max_iterations",
                                     .kind = DRAPE_PARAM_INTEGER,
                                     .unit = "1",
                                     .default_value = 50,
                                     .min = 1,
                                     .max = 100000,
                                     .help = "Newton iterations before the attempt fails"},
    [DRAPE_NEWTON_ON_FAILURE] =
        {.name = "on_failure",
         .kind = DRAPE_PARAM_CHOICE,
         .unit = "1",
         .default_value = FAILURE_REJECT,
         .choices = failure_choices,
         .help = "accept: go on with an unconverged state, as the DEP report does; the log says so"},
    [DRAPE_NEWTON_METHOD] =
        {.name = "newton",
         .kind = DRAPE_PARAM_CHOICE,
         .unit = "1",
         .default_value = METHOD_EXACT,
         .choices = method_choices,
         .help = "exact: a Jacobian each iteration; modified: factors kept for up to 10 iterations and "
                 "across steps"},
    [DRAPE_NEWTON_GLOBALIZATION] =
        {.name = "globalization",
         .kind = DRAPE_PARAM_CHOICE,
         .unit = "1",
         .default_value = GLOBAL_NONE,
         .choices = global_choices,
         .help = "none: full Newton steps, failures go to the controller; line_search: steps shortened "
                 "until the residual falls, which takes more iterations on most cloths"},
    [DRAPE_NEWTON_PREDICTOR] = {.name = "predictor",
                                .kind = DRAPE_PARAM_CHOICE,
                                .unit = "1",
                                .default_value = PREDICTOR_INERTIAL,
                                .choices = predictor_choices,
                                .help =
                                    "guess: the nodes fly on, or stay where they are as in the DEP report"},
    [DRAPE_NEWTON_PROJECT] = {.name = "project",
                              .kind = DRAPE_PARAM_BOOLEAN,
                              .unit = "1",
                              .default_value = 0,
                              .help = "project the Hessian of every element to positive semidefinite"},
    [DRAPE_NEWTON_LINEAR_SOLVER] = {.name = "linear_solver",
                                    .kind = DRAPE_PARAM_CHOICE,
                                    .unit = "1",
                                    .default_value = 0,
                                    .choices = drape_linears_words,
                                    .help = "a row of the linear solvers"},
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
    double *x, *v, *g;           /* nodes: where the residual was evaluated last, and g there */
    double *f;                   /* free DOFs: F there */
    bool nonfinite;              /* a residual was */
    double factored_mass_weight; /* of the factors that modified Newton may keep; 0: none */
    drape_work work;
};

/* ---- The callbacks of KINSOL ---- */

static void place(drape_newton *s, const double *d)
{
    const drape_newton_problem *p = s->problem;
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
    double start = drape_clock_seconds();
    place(s, d);
    drape_system_force(s->system, &s->point, s->g);
    for (int64_t i = 0; i < s->n; i++) {
        int32_t node = s->model->node_of_free[i / 3];
        double inertia = p->mass_weight * s->model->mass[node] * (d[i] - p->inertia[i]);
        s->f[i] = inertia + s->g[3 * (int64_t)node + i % 3];
    }
    s->work.residuals++;
    s->work.residual_seconds += drape_clock_seconds() - start;
    return drape_all_finite(s->f, (size_t)s->n);
}

static int residual(N_Vector d, N_Vector f, void *user)
{
    drape_newton *s = user;
    s->nonfinite = !evaluate(s, N_VGetArrayPointer(d));
    memcpy(N_VGetArrayPointer(f), s->f, (size_t)s->n * sizeof *s->f);
    return s->nonfinite ? 1 : 0;
}

static int jacobian(N_Vector d, N_Vector f, SUNMatrix matrix, void *user, N_Vector scratch1,
                    N_Vector scratch2)
{
    (void)f, (void)matrix, (void)scratch1, (void)scratch2;
    drape_newton *s = user;
    double start = drape_clock_seconds();
    place(s, N_VGetArrayPointer(d)); /* the residual may have been tried elsewhere since */
    drape_system_jacobian(s->system, &s->point, s->problem->mass_weight, s->values[DRAPE_NEWTON_PROJECT] != 0,
                          s->linear->values);
    s->factored_mass_weight = s->problem->mass_weight;
    s->work.jacobians++;
    s->work.jacobian_seconds += drape_clock_seconds() - start;
    return 0;
}

/* ---- Making and freeing ---- */

static drape_status create_vectors(drape_newton *s)
{
    size_t nodes = 3 * (size_t)s->model->node_count;
    s->x = drape_alloc(s->ctx, nodes, sizeof *s->x);
    s->v = drape_alloc(s->ctx, nodes, sizeof *s->v);
    s->g = drape_alloc(s->ctx, nodes, sizeof *s->g);
    s->f = drape_alloc(s->ctx, (size_t)s->n, sizeof *s->f);
    if (!s->x || !s->v || !s->g || !s->f)
        return DRAPE_E_MEMORY;
    s->unknown = N_VMake_Serial(s->n, s->f, s->sun);
    s->ones = N_VNew_Serial(s->n, s->sun);
    if (!s->unknown || !s->ones)
        return drape_fail_memory(s->ctx, (size_t)s->n * sizeof(double));
    N_VConst(1, s->ones);
    return DRAPE_OK;
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
    memcpy(s->values, values, sizeof s->values);
    drape_status status = DRAPE_OK;
    if (drape_sundials_context(&s->sun) || !(s->kin = KINCreate(s->sun)))
        status = drape_fail_memory(ctx, sizeof(void *));
    if (!status)
        status = create_vectors(s);
    if (!status && s->n > 0)
        status = drape_sun_linear_create(ctx, s->sun, drape_linears[(int)values[DRAPE_NEWTON_LINEAR_SOLVER]],
                                         &s->model->pattern, &s->linear);
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
                             .history = problem->history};
    memcpy(s->x, problem->x_base, bytes);
    memcpy(s->v, problem->v_base, bytes);
    s->nonfinite = false;
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
    if (!status) { /* unreachable as long as KINSOL tests what it says */
        info->reason = "residual";
        status = DRAPE_RETRY_NONLINEAR;
    }
    info->usable = info->lenient && !s->nonfinite && status > 0;
    return s->nonfinite ? blame_element(s, status, info) : status;
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
    N_VSetArrayPointer(d, s->unknown);
    int strategy = s->values[DRAPE_NEWTON_GLOBALIZATION] == GLOBAL_LINE_SEARCH ? KIN_LINESEARCH : KIN_NONE;
    drape_status status = status_of(KINSol(s->kin, s->unknown, strategy, s->ones, s->ones), &info->reason);
    count_iterations(s, info);
    if (status)
        drape_newton_forget_factors(s);
    return judge(s, status, d, info);
}

const drape_point *drape_newton_point(const drape_newton *newton)
{
    return &newton->point;
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

drape_work drape_newton_work(const drape_newton *newton)
{
    drape_work work = newton->work;
    if (newton->linear) {
        work.factorizations = newton->linear->factorizations;
        work.linear_iterations = newton->linear->solves;
        work.factor_seconds = newton->linear->factor_seconds;
        work.solve_seconds = newton->linear->solve_seconds;
    }
    return work;
}

size_t drape_newton_bytes(const drape_newton *newton)
{
    size_t nodes = 3 * (size_t)newton->model->node_count, values = (size_t)newton->model->pattern.nonzeros;
    size_t factors = newton->linear ? newton->linear->ops->bytes(newton->linear->state) : 0;
    return (3 * nodes + 8 * (size_t)newton->n + values) * sizeof(double) +
           factors; /* KINSOL keeps 6 vectors */
}
