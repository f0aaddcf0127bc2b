/*
 * cvode: variable order and step size with local error control by CVODE (Hindmarsh et al. 2005; Cohen &
 * Hindmarsh 1996): backward differentiation formulas (BDF) with a fixed leading coefficient, whose history is
 * a Nordsieck array, for
 *     y' = (v, -M^-1 g(x, v, t)).
 * first_order.h has all that does not concern CVODE alone.
 *
 * Its Newton corrections solve I - gamma J, which is the matrix of first_order.h with c_j = 1/gamma and
 * r1 = c_j b1, r2 = c_j M b2. It changes the step size only where it would grow by half or more, so factors
 * serve longer than in IDA.
 *
 * The maximum order is 2 at loose tolerances, as in `ida`. stability_detection: CVODE lowers an order of 3 or
 * more where waves are outside the region of stability, judged by the sizes of the derivatives of the last
 * steps.
 *
 * No function of CVODE returns its history, so a checkpoint has the derivatives of the last step, by which its
 * frames are interpolated, and CVODE restarts there.
 */
#include "integrators/first_order.h"

#include <cvode/cvode.h>
#include <math.h>
#include <string.h>

#define LOOSE_ORDER 2
#define TIGHT_ORDER 5
/* Of the tolerance of the error test: bound for the error of the Newton iteration. */
#define NEWTON_SHARE 0.1
/* The matrix is factored again when gamma changed by more than this, and after this number of steps; the test
 * of convergence notices earlier if it must be. */
#define GAMMA_CHANGE 0.3
#define SETUP_STEPS  1000

enum { PARAM_STABILITY_DETECTION = DRAPE_FIRST_ORDER_OWN, PARAM_COUNT };

static const drape_param params[PARAM_COUNT] = {
    DRAPE_FIRST_ORDER_PARAMS(DRAPE_INTEGER("max_order", "1", DRAPE_DERIVED("2 for rtol >= 1e-4, else 5"), 1,
                                           5, "highest order of the BDF")),
    [PARAM_STABILITY_DETECTION] =
        DRAPE_BOOLEAN("stability_detection", false, "lowers an order above 2 where waves would be amplified"),
};

typedef struct cvode_state {
    drape_first_order base;
    /* From a checkpoint: derivatives of y at `end`, from the 0th, until the next step. */
    double *derivatives; /* (TIGHT_ORDER + 1, 2 n) */
    double end;          /* [s] */
    int count;           /* 0: there are none */
} cvode_state;

static int system_matrix(sunrealtype t, N_Vector y, N_Vector rate, SUNMatrix matrix, sunbooleantype keep,
                         sunbooleantype *renewed, sunrealtype gamma, void *user, N_Vector a, N_Vector b,
                         N_Vector c)
{
    (void)rate, (void)matrix, (void)keep, (void)a, (void)b, (void)c;
    *renewed = SUNTRUE;
    return drape_first_order_jacobian(user, t, 1 / gamma, N_VGetArrayPointer(y));
}

static bool configure(drape_first_order *f)
{
    void *m = f->memory;
    DRAPE_CVODE_QUIET(m);
    bool good = !CVodeInit(m, drape_first_order_rhs, 0, f->y) && !CVodeSetUserData(m, f) &&
                !CVodeSVtolerances(m, 0, f->weights) &&
                !CVodeSetLinearSolver(m, f->linear->solver, f->linear->matrix) &&
                !CVodeSetLinSysFn(m, system_matrix) && !CVodeSetNonlinearSolver(m, f->newton.solver) &&
                drape_sun_newton_set_test(&f->newton) &&
                !CVodeSetMaxOrd(m, (int)f->values[DRAPE_FIRST_ORDER_ORDER]) &&
                !CVodeSetMaxErrTestFails(m, DRAPE_FIRST_ORDER_ERROR_FAILS) &&
                !CVodeSetMaxConvFails(m, DRAPE_FIRST_ORDER_SOLVER_FAILS) &&
                !CVodeSetNonlinConvCoef(m, NEWTON_SHARE) && !CVodeSetDeltaGammaMaxLSetup(m, GAMMA_CHANGE) &&
                !CVodeSetLSetupFrequency(m, SETUP_STEPS) && !CVodeSetMaxHnilWarns(m, -1) &&
                !CVodeSetStabLimDet(m, f->values[PARAM_STABILITY_DETECTION] != 0);
    if (good && !isnan(f->values[DRAPE_FIRST_ORDER_MAX_STEP]))
        good = !CVodeSetMaxStep(m, f->values[DRAPE_FIRST_ORDER_MAX_STEP]);
    return good;
}

static bool create_cvode(drape_first_order *f)
{
    cvode_state *s = (cvode_state *)f;
    f->linear->solver->ops->solve = drape_first_order_solve_rhs;
    f->newton.mass = f->mass;
    f->newton.gamma = CVodeGetCurrentGamma;
    s->derivatives = drape_arena_take(f->arena, 2 * (size_t)f->n * (TIGHT_ORDER + 1), sizeof *s->derivatives);
    f->memory = CVodeCreate(CV_BDF, f->sun);
    return s->derivatives && f->memory && configure(f);
}

static void destroy_cvode(drape_first_order *f)
{
    if (f->memory)
        CVodeFree(&f->memory);
}

static bool begin(drape_first_order *f, double t, double h)
{
    return !CVodeReInit(f->memory, t, f->y) &&
           !CVodeSetInitStep(f->memory, h > 0 ? h : drape_first_order_first_step(f));
}

static bool stop_at(drape_first_order *f, double stop)
{
    return !CVodeSetStopTime(f->memory, stop);
}

static drape_first_order_outcome step(drape_first_order *f, double end, double *t)
{
    ((cvode_state *)f)->count = 0;
    switch (CVode(f->memory, end, f->y, t, CV_ONE_STEP)) {
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
    const cvode_state *s = (const cvode_state *)f;
    if (s->count == 0)
        return CVodeGetDky(f->memory, t, 0, out);
    const size_t n = 2 * (size_t)f->n;
    double *y = N_VGetArrayPointer(out);
    memset(y, 0, n * sizeof *y);
    for (int k = s->count - 1; k >= 0; k--) /* Horner's scheme of Taylor's polynomial */
        for (size_t i = 0; i < n; i++)
            y[i] = s->derivatives[(size_t)k * n + i] + (t - s->end) / (k + 1) * y[i];
    return 0;
}

/* The derivatives of the step that ended at `reached`. */
static void collect(cvode_state *s)
{
    drape_first_order *f = &s->base;
    const size_t n = 2 * (size_t)f->n;
    int order = 0;
    s->end = f->reached;
    if (s->count > 0 || isnan(f->reached) || CVodeGetLastOrder(f->memory, &order))
        return;
    for (int k = 0; k <= order; k++) {
        if (CVodeGetDky(f->memory, f->reached, k, f->between))
            return;
        memcpy(s->derivatives + (size_t)k * n, N_VGetArrayPointer(f->between), n * sizeof(double));
    }
    s->count = order + 1;
}

static bool archive_cvode(drape_first_order *f, drape_archive *a)
{
    cvode_state *s = (cvode_state *)f;
    const int before = s->count;
    if (!a->reading)
        collect(s);
    drape_archive_mark(a, "cvode");
    drape_archive_double(a, &s->end);
    drape_archive_int(a, &s->count);
    if (drape_archive_has_read(a) && (s->count < 0 || s->count > TIGHT_ORDER + 1))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has %d derivatives", s->count);
    for (int k = 0; k < s->count && drape_archive_good(a); k++)
        drape_archive_doubles(a, s->derivatives + 2 * (size_t)f->n * (size_t)k, 2 * (size_t)f->n);
    if (!a->reading)
        s->count = before;
    return false;
}

/* The Nordsieck array, and scratch. */
static int vectors(const drape_first_order *f)
{
    return (int)f->values[DRAPE_FIRST_ORDER_ORDER] + 1 + 7;
}

static const drape_first_order_solver solver = {
    .name = "CVODE",
    .create = create_cvode,
    .destroy = destroy_cvode,
    .begin = begin,
    .stop_at = stop_at,
    .step = step,
    .last_step = CVodeGetLastStep,
    .current_step = CVodeGetCurrentStep,
    .iterations = CVodeGetNumNonlinSolvIters,
    .errors = CVodeGetEstLocalErrors,
    .dense = dense,
    .archive = archive_cvode,
    .vectors = vectors,
};

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    cvode_state *s = *state = drape_arena_take(arena, 1, sizeof *s);
    return s ? drape_first_order_create(&s->base, &solver, arena, system, values, PARAM_COUNT, LOOSE_ORDER,
                                        TIGHT_ORDER)
             : DRAPE_E_MEMORY;
}

const drape_integrator_ops drape_integrator_cvode = {
    .entry = {.name = "cvode",
              .summary = "variable order and step with local error control by CVODE",
              .reference = "Hindmarsh et al. 2005, SUNDIALS; Cohen & Hindmarsh 1996, CVODE",
              DRAPE_PARAMS(params)},
    .order = 5,
    .create = create,
    .own_steps = true,
    .gain = DRAPE_FIRST_ORDER_GAIN,
    .smooth_forces = true,
    .loses_history = true,
    .step = drape_first_order_step,
    .interpolate = drape_first_order_interpolate,
    .restart = drape_first_order_restart,
    .work = drape_first_order_work,
    .archive = drape_first_order_archive,
    .bytes = drape_first_order_bytes,
    .destroy = drape_first_order_destroy,
};
