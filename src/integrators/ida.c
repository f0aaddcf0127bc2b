/*
 * ida: variable order and step size with local error control by IDA (Hindmarsh et al. 2005; Brenan,
 * Campbell & Petzold 1996): backward differentiation formulas (BDF) with variable coefficients and a fixed
 * leading one, for
 *     F = [x' - v ; M v' + g(x, v, t)] = 0.
 * first_order.h has all that does not concern IDA alone.
 *
 * The maximum order is 2 at loose tolerances, because BDF 3 to 5 are not A-stable and feed energy into
 * undamped waves; it is 5 if the tolerance resolves these waves.
 *
 * A step that needs more than one matrix is longer than pays (drape_first_order_limit): the next one is cut
 * by a stop, the only bound by which IDA shortens a step. Without it, rtol 1e-2 took 1.6 times the matrices
 * of 1e-3 on a hung sheet.
 */
#include "base/elementary.h"
#include "integrators/first_order.h"
#include "solvers/sundials_memory.h"

#include <ida/ida.h>
#include <math.h>

#define LOOSE_ORDER 2
#define TIGHT_ORDER 5
/* The matrix is factored again when c_j changed by more than (1 - d)/(1 + d). IDA's own d, 0.25, takes a
 * quarter more residuals for as many factorisations. */
#define CJ_CHANGE 0.1

static const drape_param params[] = {
    DRAPE_FIRST_ORDER_PARAMS(DRAPE_INTEGER("max_order", "1", DRAPE_DERIVED("2 for rtol >= 1e-4, else 5"), 1,
                                           5, "highest order of the BDF")),
};

static int residual(sunrealtype t, N_Vector y, N_Vector rate, N_Vector out, void *user)
{
    drape_first_order *s = user;
    const double *v = N_VGetArrayPointer(y) + s->n, *xp = N_VGetArrayPointer(rate), *vp = xp + s->n;
    double *f = N_VGetArrayPointer(out), start = drape_system_clock(s->system);
    drape_first_order_force(s, t, N_VGetArrayPointer(y));
    for (int64_t i = 0; i < s->n; i++) {
        f[i] = xp[i] - v[i];
        f[s->n + i] = s->mass[i] * vp[i] + s->g[drape_first_order_at(s, i)];
    }
    return drape_first_order_judge(s, t, f, start);
}

static int jacobian(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector rate, N_Vector r, SUNMatrix matrix,
                    void *user, N_Vector a, N_Vector b, N_Vector c)
{
    (void)rate, (void)r, (void)matrix, (void)a, (void)b, (void)c;
    return drape_first_order_jacobian(user, t, cj, N_VGetArrayPointer(y));
}

static bool configure(drape_first_order *s)
{
    DRAPE_IDA_QUIET(s->memory);
    return !IDAInit(s->memory, residual, 0, s->y, s->rate) && !IDASetUserData(s->memory, s) &&
           !IDASVtolerances(s->memory, 0, s->weights) &&
           !IDASetLinearSolver(s->memory, s->shell.solver, s->shell.matrix) &&
           !IDASetNonlinearSolver(s->memory, s->newton.solver) && drape_sun_newton_set_test(&s->newton) &&
           !IDASetJacFn(s->memory, jacobian) &&
           !IDASetMaxOrd(s->memory, (int)s->values[DRAPE_FIRST_ORDER_ORDER]) &&
           !IDASetNonlinConvCoef(s->memory, DRAPE_NEWTON_SHARE) &&
           !IDASetDeltaCjLSetup(s->memory, CJ_CHANGE) &&
           !IDASetMaxStep(s->memory, drape_first_order_max_step(s));
}

static bool create_ida(drape_first_order *s)
{
    s->newton.retreat = drape_first_order_retreat;
    s->newton.user = s;
    s->limit = INFINITY;
    s->memory = IDACreate(s->sun);
    if (!s->memory || !configure(s))
        return false;
    drape_ida_clear(s->memory);
    return true;
}

static bool begin(drape_first_order *s, double t, double h)
{
    s->limit = INFINITY;
    return !IDAReInit(s->memory, t, s->y, s->rate) && !IDASetInitStep(s->memory, h);
}

/* The other codes are IDA_MEM_NULL, IDA_ILL_INPUT, IDA_LINIT_FAIL, IDA_VECTOROP_ERR and the like. */
static const drape_solver_code codes[] = {
    {IDA_SUCCESS, DRAPE_REASON_CONVERGED},        {IDA_TSTOP_RETURN, DRAPE_REASON_CONVERGED},
    {IDA_ERR_FAIL, DRAPE_REASON_ERROR_TEST},      {IDA_TOO_MUCH_ACC, DRAPE_REASON_ROUND_OFF},
    {IDA_CONV_FAIL, DRAPE_REASON_NEWTON},         {IDA_NLS_FAIL, DRAPE_REASON_NEWTON},
    {IDA_LSETUP_FAIL, DRAPE_REASON_SINGULAR},     {IDA_LSOLVE_FAIL, DRAPE_REASON_SINGULAR},
    {IDA_RES_FAIL, DRAPE_REASON_NONFINITE},       {IDA_REP_RES_ERR, DRAPE_REASON_NONFINITE},
    {IDA_FIRST_RES_FAIL, DRAPE_REASON_NONFINITE},
};

/* The largest next step by the effort of the last one, for which IDA needed a matrix if it grew. */
static double limit_effort(drape_first_order *s, double before)
{
    sunrealtype last = 0;
    int order = 1;
    IDAGetLastStep(s->memory, &last);
    IDAGetLastOrder(s->memory, &order);
    IDAGetEstLocalErrors(s->memory, s->between);
    const double error = fmax(drape_first_order_norm(s, s->between) / (order + 1), DRAPE_LEAST_ERROR),
                 allowed = fmax(drape_pow(error, -1.0 / (order + 1)), 1);
    return drape_first_order_limit(s, 1, last > (1 + CJ_CHANGE) * before, allowed) * last;
}

static drape_reason step(drape_first_order *s, double end, double *t)
{
    sunrealtype before = 0;
    IDAGetLastStep(s->memory, &before);
    /* no short step is left over before a stop, after which IDA would have to grow again */
    const bool limits = 2 * s->limit < s->span[1] - s->span[0];
    if (IDASetStopTime(s->memory, limits ? s->span[0] + s->limit : s->span[1]))
        return DRAPE_REASON_SOLVER;
    const drape_reason reason = drape_solver_reason(codes, sizeof codes / sizeof *codes,
                                                    IDASolve(s->memory, end, t, s->y, s->rate, IDA_ONE_STEP));
    if (reason == DRAPE_REASON_CONVERGED)
        s->limit = fmax(*t == s->span[1] ? s->limit : 0, limit_effort(s, before));
    return reason;
}

static int dense(drape_first_order *s, double t, N_Vector out)
{
    return IDAGetDky(s->memory, t, 0, out);
}

static int errors(drape_first_order *s, N_Vector out)
{
    return IDAGetEstLocalErrors(s->memory, out);
}

static bool archive_ida(drape_first_order *s, drape_archive *a)
{
    drape_archive_double(a, &s->limit);
    if (a->reading && !(s->limit > 0))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has an impossible size of the next step");
    return drape_ida_archive(s->memory, a);
}

/* The differences of the history, and scratch. */
static int vectors(const drape_first_order *s)
{
    return (int)s->values[DRAPE_FIRST_ORDER_ORDER] + 1 + 6;
}

static const drape_first_order_solver solver = {
    .name = "IDA",
    .state_size = sizeof(drape_first_order),
    .param_count = DRAPE_FIRST_ORDER_OWN,
    .loose_order = LOOSE_ORDER,
    .tight_order = TIGHT_ORDER,
    .correct = drape_first_order_solve,
    .create = create_ida,
    .free = IDAFree,
    .begin = begin,
    .step = step,
    .last_step = IDAGetLastStep,
    .current_step = IDAGetCurrentStep,
    .iterations = IDAGetNumNonlinSolvIters,
    .errors = errors,
    .dense = dense,
    .archive = archive_ida,
    .vectors = vectors,
};

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    return drape_first_order_create(&solver, arena, system, values, state);
}

const drape_integrator_ops drape_integrator_ida = {
    .entry = {.name = "ida",
              .summary = "variable order and step with local error control by IDA",
              .reference = "Hindmarsh et al. 2005, SUNDIALS; Brenan, Campbell & Petzold 1996",
              DRAPE_PARAMS(params)},
    .order = 5,
    .create = create,
    .by_ranks = true,
    DRAPE_FIRST_ORDER_OPS,
};
