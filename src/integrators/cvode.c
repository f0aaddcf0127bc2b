/*
 * cvode: variable order and step size with local error control by CVODE (Hindmarsh et al. 2005; Cohen &
 * Hindmarsh 1996): backward differentiation formulas (BDF) with a fixed leading coefficient, whose
 * history is a Nordsieck array, for
 *     y' = (v, -M^-1 g(x, v, t)).
 * first_order.h has all that does not concern CVODE alone.
 *
 * Its Newton corrections solve I - gamma J, which is the matrix of first_order.h with c_j = 1/gamma and
 * r1 = c_j b1, r2 = c_j M b2. It changes the step size only where it would grow by half or more, so factors
 * serve longer than in IDA.
 *
 * The maximum order is 2 at loose tolerances, as in `ida`. stability_detection: CVODE lowers an order of
 * 3 or more where waves are outside the region of stability, judged by the sizes of the derivatives of
 * the last steps. On an undamped hung sheet at order 5 and rtol 1e-4 it saved a quarter of the steps, and 74
 * of 79 rejections for their energy; elsewhere it changed nothing.
 *
 * Checkpoints have a log of what CVODE has been given: cvode_log.h.
 */
#include "integrators/cvode_log.h"
#include "integrators/first_order.h"

#include <cvode/cvode.h>
#include <math.h>

#define LOOSE_ORDER 2
#define TIGHT_ORDER 5
/* Of the tolerance of the error test: bound for the error of the Newton iteration. */
#define NEWTON_SHARE 0.1
/* The matrix is factored again when gamma changed by more than this, and after this number of steps; the
 * test of convergence notices earlier if it must be. */
#define GAMMA_CHANGE 0.3
#define SETUP_STEPS  1000

enum { PARAM_STABILITY_DETECTION = DRAPE_FIRST_ORDER_OWN, PARAM_COUNT };

static const drape_param params[PARAM_COUNT] = {
    DRAPE_FIRST_ORDER_PARAMS(DRAPE_INTEGER("max_order", "1", DRAPE_DERIVED("2 for rtol >= 1e-4, else 5"), 1,
                                           5, "highest order of the BDF")),
    [PARAM_STABILITY_DETECTION] =
        DRAPE_BOOLEAN("stability_detection", true, "lowers an order above 2 where waves would be amplified"),
};

typedef struct cvode_state {
    drape_first_order base;
    drape_cvode_log log;
} cvode_state;

static drape_cvode_log *log_of(drape_first_order *f)
{
    return &((cvode_state *)f)->log;
}

/* While the log is replayed, nothing is computed. */
static int rhs(sunrealtype t, N_Vector y, N_Vector rate, void *user)
{
    drape_cvode_log *log = log_of(user);
    return drape_cvode_log_code(log, log->replaying ? 0 : drape_first_order_rhs(t, y, rate, user));
}

static int factor(SUNLinearSolver linear_solver, SUNMatrix matrix)
{
    (void)matrix;
    drape_sun_linear *linear = linear_solver->content;
    return log_of(linear->owner)->replaying ? 0 : (int)drape_sun_linear_factor(linear, false);
}

static int system_matrix(sunrealtype t, N_Vector y, N_Vector rate, SUNMatrix matrix, sunbooleantype keep,
                         sunbooleantype *renewed, sunrealtype gamma, void *user, N_Vector a, N_Vector b,
                         N_Vector c)
{
    (void)rate, (void)matrix, (void)keep, (void)a, (void)b, (void)c;
    *renewed = SUNTRUE;
    return log_of(user)->replaying ? 0
                                   : drape_first_order_jacobian(user, t, 1 / gamma, N_VGetArrayPointer(y));
}

static bool configure(drape_first_order *f)
{
    void *m = f->memory;
    DRAPE_CVODE_QUIET(m);
    return drape_cvode_log_init(log_of(f), m, rhs, f->y, f->newton.solver) && !CVodeSetUserData(m, f) &&
           !CVodeSVtolerances(m, 0, f->weights) &&
           !CVodeSetLinearSolver(m, f->linear->shell.solver, f->linear->shell.matrix) &&
           !CVodeSetLinSysFn(m, system_matrix) && drape_sun_newton_set_test(&f->newton) &&
           !CVodeSetMaxOrd(m, (int)f->values[DRAPE_FIRST_ORDER_ORDER]) &&
           !CVodeSetMaxErrTestFails(m, DRAPE_FIRST_ORDER_ERROR_FAILS) &&
           !CVodeSetMaxConvFails(m, DRAPE_FIRST_ORDER_SOLVER_FAILS) &&
           !CVodeSetNonlinConvCoef(m, NEWTON_SHARE) && !CVodeSetDeltaGammaMaxLSetup(m, GAMMA_CHANGE) &&
           !CVodeSetLSetupFrequency(m, SETUP_STEPS) && !CVodeSetMaxHnilWarns(m, -1) &&
           !CVodeSetStabLimDet(m, f->values[PARAM_STABILITY_DETECTION] != 0) &&
           !CVodeSetMaxStep(m, drape_first_order_max_step(f));
}

static bool create_cvode(drape_first_order *f)
{
    f->linear->shell.solver->ops->solve = drape_first_order_solve_rhs;
    f->linear->shell.solver->ops->setup = factor;
    f->newton.mass = f->mass;
    f->newton.gamma = CVodeGetCurrentGamma;
    f->memory = CVodeCreate(CV_BDF, f->sun);
    return drape_cvode_log_create(log_of(f), f->arena, f->y) && f->memory && configure(f);
}

static bool begin(drape_first_order *f, double t, double h)
{
    return drape_cvode_log_begin(log_of(f), f->memory, t, h > 0 ? h : drape_first_order_first_step(f), f->y);
}

static bool must_begin(const drape_first_order *f)
{
    return drape_cvode_log_is_full(&((const cvode_state *)f)->log);
}

static drape_first_order_outcome step(drape_first_order *f, double end, double *t)
{
    (void)end;
    switch (drape_cvode_log_step(log_of(f), f->memory, f->span[1], f->y, t)) {
    case CV_SUCCESS:
    case CV_TSTOP_RETURN:
        return DRAPE_FIRST_ORDER_STEPPED;
    case CV_ERR_FAILURE:
        return DRAPE_FIRST_ORDER_ERROR_TEST;
    case CV_TOO_MUCH_ACC:
        return DRAPE_FIRST_ORDER_ROUND_OFF;
    case CV_CONV_FAILURE:
    case CV_NLS_FAIL:
        return DRAPE_FIRST_ORDER_NEWTON;
    case CV_LSETUP_FAIL:
    case CV_LSOLVE_FAIL:
        return DRAPE_FIRST_ORDER_SINGULAR;
    case CV_RHSFUNC_FAIL:
    case CV_FIRST_RHSFUNC_ERR:
    case CV_REPTD_RHSFUNC_ERR:
    case CV_UNREC_RHSFUNC_ERR:
        return DRAPE_FIRST_ORDER_RESIDUAL;
    default: /* CV_MEM_NULL, CV_ILL_INPUT, CV_LINIT_FAIL, CV_VECTOROP_ERR ... */
        return DRAPE_FIRST_ORDER_REFUSED;
    }
}

static int dense(drape_first_order *f, double t, N_Vector out)
{
    return CVodeGetDky(f->memory, t, 0, out);
}

static int errors(drape_first_order *f, N_Vector out)
{
    return CVodeGetEstLocalErrors(f->memory, out);
}

/* After a failure there is nothing to continue. Replayed steps counted no iterations. */
static bool archive_cvode(drape_first_order *f, drape_archive *a)
{
    if (isnan(f->reached))
        log_of(f)->count = 0;
    drape_cvode_log_archive(log_of(f), f->memory, f->y, a);
    if (drape_archive_has_read(a))
        CVodeGetNumNonlinSolvIters(f->memory, &f->counted);
    return true;
}

/* The Nordsieck array, and scratch. */
static int vectors(const drape_first_order *f)
{
    return (int)f->values[DRAPE_FIRST_ORDER_ORDER] + 1 + 7;
}

static const drape_first_order_solver solver = {
    .name = "CVODE",
    .state_size = sizeof(cvode_state),
    .param_count = PARAM_COUNT,
    .loose_order = LOOSE_ORDER,
    .tight_order = TIGHT_ORDER,
    .create = create_cvode,
    .free = CVodeFree,
    .begin = begin,
    .must_begin = must_begin,
    .step = step,
    .last_step = CVodeGetLastStep,
    .current_step = CVodeGetCurrentStep,
    .iterations = CVodeGetNumNonlinSolvIters,
    .errors = errors,
    .dense = dense,
    .archive = archive_cvode,
    .vectors = vectors,
};

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    return drape_first_order_create(&solver, arena, system, values, state);
}

const drape_integrator_ops drape_integrator_cvode = {
    .entry = {.name = "cvode",
              .summary = "variable order and step with local error control by CVODE",
              .reference = "Hindmarsh et al. 2005, SUNDIALS; Cohen & Hindmarsh 1996, CVODE",
              DRAPE_PARAMS(params)},
    .order = 5,
    .create = create,
    DRAPE_FIRST_ORDER_OPS,
};
