/*
 * dirk: singly diagonally implicit Runge-Kutta methods whose first stage is explicit (ESDIRK), of orders
 * 2 to 5, with step sizes by the embedded error, by ARKODE's ARKStep (Reynolds, Gardner, Woodward &
 * Chinomona 2023), for
 *     y' = (v, -M^-1 g(x, v, t)).
 * All are L-stable and stiffly accurate: waves that a step does not resolve die out within it, at every
 * order, unlike in the BDF of order 3 and more. All stages have the same gamma, and so one matrix.
 * first_order.h has all that does not concern ARKODE alone.
 *     order 2: TR-BDF2, 3 stages (Bank et al. 1985; Hosea & Shampine 1996)
 *           3: ESDIRK3(2)I5L[2]SA, 5 stages (Kennedy & Carpenter 2016)
 *           4: ARK4(3)7L[2]SA1, 7 stages (Kennedy & Carpenter 2019)
 *           5: ARK5(4)8L[2]SA2, 8 stages (the same)
 * Among the tables of ARKODE these need the fewest residuals for an error of 1e-3 to 1e-7 of the size, on a
 * soft and on a stiff sheet.
 *
 * With fixed_step, steps have one size, by which the order can be measured. Nothing but a failure of Newton's
 * method makes one shorter.
 *
 * A step depends on the state at its beginning, the derivative there, and the size that was chosen for it.
 * ARKODE is started anew in each step with these, so a checkpoint has all of its history. The derivative is
 * that of the last stage of the step before, as deduced from the stage equation: an evaluation of the force
 * would multiply the error of the Newton iteration by the stiffness (Shampine 1980, Implementation of
 * implicit formulas).
 *
 * Between the ends of a step positions are interpolated by Hermite's polynomials: of degree 3 from
 * positions and velocities at order 2 and 3, of degree 5 with accelerations above. Their local error is
 * of one order more than the method. Velocities are of degree 3, from velocities and accelerations.
 */
#include "integrators/first_order.h"

#include <arkode/arkode_arkstep.h>
#include <math.h>

#define LOOSE_ORDER 3
#define TIGHT_ORDER 5
/* The matrix is factored again when gamma changed by more than this; the test of convergence notices
 * earlier if it must be. */
#define GAMMA_CHANGE    0.2
#define FIRST_SHARE     1e-3
#define FIRST_CHANGE    0.5
#define ERROR_FAILS     10 /* of the error test in a step, as IDA has it */
#define MAX_CORRECTIONS 6  /* of the undamped Newton iteration */

enum { PARAM_FIXED_STEP = DRAPE_FIRST_ORDER_OWN, PARAM_COUNT };

static const drape_param params[PARAM_COUNT] = {
    DRAPE_FIRST_ORDER_PARAMS(DRAPE_INTEGER("order", "1", DRAPE_DERIVED("3 for rtol >= 1e-4, else 5"), 2, 5,
                                           "order of the method")),
    [PARAM_FIXED_STEP] =
        DRAPE_NUMBER("fixed_step", "s", DRAPE_DERIVED("none"), DRAPE_ABOVE(0), 1e9,
                     "size of every step that ends at no kink or end of an advance; the local error is not "
                     "tested, and rtol bounds only what Newton's method leaves"),
};

static const struct {
    ARKODE_DIRKTableID table;
    int stages;
    int error_order; /* of h in the estimated local error */
} methods[] = {
    [2] = {ARKODE_TRBDF2_3_3_2, 3, 3},
    [3] = {ARKODE_ESDIRK32I5L2SA_5_2_3, 5, 3},
    [4] = {ARKODE_ARK437L2SA_DIRK_7_3_4, 7, 4},
    [5] = {ARKODE_ARK548L2SAb_DIRK_8_4_5, 8, 5},
};

typedef struct dirk_state {
    drape_first_order base;       /* y, rate: at the end of the last step */
    N_Vector before, rate_before; /* at its beginning */
    N_Vector far;                 /* that stage of the step which is farthest from its beginning: */
    double far_after, last_after; /* [s] its time, and that of the last stage, after the beginning */
    double t, h;                  /* [s] that end; size of that step */
    double next;                  /* [s] size of the next step */
    double error;                 /* estimated local error of the last step relative to the tolerance */
    bool attempted;               /* a step, by this ARKODE */
} dirk_state;

static int order_of(const dirk_state *s)
{
    return (int)s->base.values[DRAPE_FIRST_ORDER_ORDER];
}

static int system_matrix(sunrealtype t, N_Vector y, N_Vector rate, SUNMatrix matrix, SUNMatrix mass,
                         sunbooleantype keep, sunbooleantype *renewed, sunrealtype gamma, void *user,
                         N_Vector a, N_Vector b, N_Vector c)
{
    (void)rate, (void)matrix, (void)mass, (void)keep, (void)a, (void)b, (void)c;
    *renewed = SUNTRUE;
    return drape_first_order_jacobian(user, t, 1 / gamma, N_VGetArrayPointer(y));
}

/* NAN: the local error chooses. */
static double fixed_step(const dirk_state *s)
{
    return s->base.values[PARAM_FIXED_STEP];
}

/* c_j of the factors relative to that of the stage. */
static double ratio_of(const drape_first_order *f)
{
    sunrealtype gamma = 0;
    ARKStepGetCurrentGamma(f->memory, &gamma);
    return gamma * f->factored_cj;
}

/* ARKODE, which is started anew in each step, does not know the factors of the step before. */
static bool matrix_is_due(void *user)
{
    return !(fabs(ratio_of(user) - 1) <= GAMMA_CHANGE);
}

/* Factors for another gamma make corrections that are too long or too short: their mean over all waves is
 * corrected, as by SUNDIALS. */
static int correct(SUNLinearSolver linear_solver, SUNMatrix matrix, N_Vector out, N_Vector in,
                   sunrealtype tolerance)
{
    int status = drape_first_order_solve_rhs(linear_solver, matrix, out, in, tolerance);
    N_VScale(2 / (1 + ratio_of(linear_solver->content)), out, out);
    return status;
}

/* The derivative at the beginning of the step is known. */
static int rhs(sunrealtype t, N_Vector y, N_Vector rate, void *user)
{
    const dirk_state *s = user;
    if (t != s->t)
        return drape_first_order_rhs(t, y, rate, user);
    N_VScale(1, s->base.rate, rate);
    return 0;
}

/* Predicts a stage: Taylor's polynomial at the beginning of the step, with one term more from the farthest
 * stage. ARKODE's own predictors use earlier steps, which it does not know. y of the stage before is in
 * f->y. */
static int predict(sunrealtype t, N_Vector predicted, void *user)
{
    dirk_state *s = user;
    const drape_first_order *f = &s->base;
    const double c = t - s->t, *y = N_VGetArrayPointer(s->before), *r = N_VGetArrayPointer(s->rate_before),
                 *z = N_VGetArrayPointer(s->far);
    double *out = N_VGetArrayPointer(predicted);
    if (s->last_after > s->far_after) {
        N_VScale(1, f->y, s->far);
        s->far_after = s->last_after;
    }
    const double d = s->far_after, u = d > 0 ? c / d : 0;
    for (int64_t i = 0; i < f->n; i++) {
        const int64_t j = f->n + i;
        const double x = y[i] + c * (y[j] + c / 2 * r[j]), v = y[j] + c * r[j];
        out[i] = d > 0 ? x + u * u * u * (z[i] - y[i] - d * (y[j] + d / 2 * r[j])) : x;
        out[j] = d > 0 ? v + u * u * (z[j] - y[j] - d * r[j]) : v;
    }
    s->last_after = c;
    return 0;
}

static bool create_arkode(drape_first_order *f)
{
    dirk_state *s = (dirk_state *)f;
    f->newton.mass = f->mass;
    f->newton.gamma = ARKStepGetCurrentGamma;
    f->newton.is_due = matrix_is_due;
    f->newton.user = f;
    s->before = N_VClone(f->y);
    s->rate_before = N_VClone(f->y);
    s->far = N_VClone(f->y);
    if (!s->before || !s->rate_before || !s->far)
        return false;
    N_VConst(0, s->before);
    N_VConst(0, s->rate_before);
    f->memory = ARKStepCreate(NULL, rhs, 0, f->y, f->sun);
    void *m = f->memory;
    if (!m)
        return false;
    DRAPE_ARKODE_QUIET(m);
    return !ARKStepSetUserData(m, f) && !ARKStepSVtolerances(m, 0, f->weights) &&
           !ARKStepSetTableNum(m, methods[order_of(s)].table, ARKODE_ERK_NONE) &&
           !ARKStepSetLinearSolver(m, f->shell.solver, f->shell.matrix) &&
           !ARKStepSetLinSysFn(m, system_matrix) && !ARKStepSetLinearSolutionScaling(m, SUNFALSE) &&
           !ARKStepSetNonlinearSolver(m, f->newton.solver) && drape_sun_newton_set_test(&f->newton) &&
           !ARKStepSetDeduceImplicitRhs(m, SUNTRUE) && !ARKStepSetStagePredictFn(m, predict) &&
           !ARKStepSetMaxNonlinIters(m, MAX_CORRECTIONS) && !ARKStepSetMaxErrTestFails(m, ERROR_FAILS) &&
           !ARKStepSetNonlinConvCoef(m, DRAPE_NEWTON_SHARE) && !ARKStepSetMaxHnilWarns(m, -1) &&
           !ARKStepSetMaxStep(m, drape_first_order_max_step(f));
}

static void destroy_vectors(drape_first_order *f)
{
    const dirk_state *s = (dirk_state *)f;
    N_VDestroy(s->before);
    N_VDestroy(s->rate_before);
    N_VDestroy(s->far);
}

/* As IDA chooses it: y, with the rate, changes by half of its tolerance; at most a thousandth of the span
 * without a kink. Waves that are set off there are resolved, unless the tolerance is larger. */
static double first_step(const drape_first_order *f)
{
    const double h = FIRST_SHARE * (f->span[1] - f->span[0]), norm = drape_first_order_norm(f, f->rate);
    return norm * h > FIRST_CHANGE ? FIRST_CHANGE / norm : h;
}

static bool begin(drape_first_order *f, double t, double h)
{
    dirk_state *s = (dirk_state *)f;
    s->t = t;
    s->next = h > 0 ? h : isnan(fixed_step(s)) ? first_step(f) : fixed_step(s);
    s->error = 1;
    return true;
}

/* The other codes are ARK_MEM_NULL, ARK_ILL_INPUT, ARK_LINIT_FAIL, ARK_VECTOROP_ERR and the like. */
static const drape_solver_code codes[] = {
    {ARK_SUCCESS, DRAPE_REASON_CONVERGED},           {ARK_TSTOP_RETURN, DRAPE_REASON_CONVERGED},
    {ARK_ERR_FAILURE, DRAPE_REASON_ERROR_TEST},      {ARK_TOO_MUCH_ACC, DRAPE_REASON_ROUND_OFF},
    {ARK_CONV_FAILURE, DRAPE_REASON_NEWTON},         {ARK_LSETUP_FAIL, DRAPE_REASON_SINGULAR},
    {ARK_LSOLVE_FAIL, DRAPE_REASON_SINGULAR},        {ARK_RHSFUNC_FAIL, DRAPE_REASON_NONFINITE},
    {ARK_FIRST_RHSFUNC_ERR, DRAPE_REASON_NONFINITE}, {ARK_REPTD_RHSFUNC_ERR, DRAPE_REASON_NONFINITE},
    {ARK_UNREC_RHSFUNC_ERR, DRAPE_REASON_NONFINITE},
};

/* After a failed attempt the size does not grow. A step that was cut, to end at a stop, says nothing
 * against the size that had been chosen. */
static void choose_next(dirk_state *s)
{
    drape_first_order *f = &s->base;
    const int k = methods[order_of(s)].error_order;
    long attempts = 0;
    if (!isnan(fixed_step(s))) {
        s->next = fixed_step(s);
        return;
    }
    ARKStepGetNumStepAttempts(f->memory, &attempts);
    ARKStepGetEstLocalErrors(f->memory, f->between);
    const double error = drape_first_order_norm(f, f->between), chosen = s->next;
    double growth = drape_step_factor(error, s->error, k);
    if (growth > 1 && (attempts > 1 || growth < DRAPE_STEP_KEPT))
        growth = 1;
    s->next = drape_first_order_limit(f, methods[order_of(s)].stages - 1, 0, growth) * s->h;
    if (attempts == 1 && s->t == f->span[1])
        s->next = fmax(s->next, chosen);
    s->error = error;
}

/* That of the last stage, whose state is the end of the step. */
static bool copy_last_derivative(drape_first_order *f)
{
    N_Vector predicted, z, derivative = NULL, data;
    sunrealtype t, gamma;
    void *user;
    if (ARKStepGetNonlinearSystemData(f->memory, &t, &predicted, &z, &derivative, &gamma, &data, &user))
        return false;
    N_VScale(1, derivative, f->rate);
    return true;
}

static drape_reason step(drape_first_order *f, double end, double *t)
{
    dirk_state *s = (dirk_state *)f;
    void *m = f->memory;
    N_VScale(1, f->y, s->before);
    N_VScale(1, f->rate, s->rate_before);
    s->far_after = s->last_after = 0;
    f->counted = 0; /* ARKODE begins to count */
    int (*const set_size)(void *, sunrealtype) =
        isnan(fixed_step(s)) ? ARKStepSetInitStep : ARKStepSetFixedStep;
    if (ARKStepReInit(m, NULL, rhs, s->t, s->before) || set_size(m, s->next) ||
        ARKStepSetStopTime(m, f->span[1]))
        return DRAPE_REASON_SOLVER;
    drape_reserve reserve = {.used = false}; /* the first call takes memory */
    drape_status memory =
        s->attempted ? DRAPE_OK : drape_reserve_open(&reserve, f->arena->ctx, 2 * (size_t)f->n);
    const int code = memory ? ARK_MEM_FAIL : ARKStepEvolve(m, end, f->y, t, ARK_ONE_STEP);
    s->attempted |= !memory;
    if (drape_reserve_close(&reserve, f->arena->ctx, memory))
        return DRAPE_REASON_MEMORY;
    const drape_reason reason = drape_solver_reason(codes, sizeof codes / sizeof *codes, code);
    if (reason != DRAPE_REASON_CONVERGED)
        return reason;
    if (!copy_last_derivative(f))
        return DRAPE_REASON_SOLVER;
    s->h = *t - s->t;
    s->t = *t;
    choose_next(s);
    return reason;
}

/* Hermite's polynomials. */
static int dense(drape_first_order *f, double t, N_Vector out)
{
    const dirk_state *s = (const dirk_state *)f;
    const double *y0 = N_VGetArrayPointer(s->before), *y1 = N_VGetArrayPointer(f->y),
                 *r0 = N_VGetArrayPointer(s->rate_before), *r1 = N_VGetArrayPointer(f->rate), h = s->h,
                 u = (t - (s->t - h)) / h, w = 1 - u;
    const bool quintic = order_of(s) > 3;
    double *y = N_VGetArrayPointer(out);
    for (int64_t i = 0; i < f->n; i++) {
        const int64_t j = f->n + i;
        if (quintic)
            y[i] = w * w * w *
                       (y0[i] * (1 + 3 * u + 6 * u * u) + h * u * (y0[j] * (1 + 3 * u) + h * u / 2 * r0[j])) +
                   u * u * u *
                       (y1[i] * (1 + 3 * w + 6 * w * w) - h * w * (y1[j] * (1 + 3 * w) - h * w / 2 * r1[j]));
        else
            y[i] =
                w * w * (y0[i] * (1 + 2 * u) + h * u * y0[j]) + u * u * (y1[i] * (1 + 2 * w) - h * w * y1[j]);
        y[j] = w * w * (y0[j] * (1 + 2 * u) + h * u * r0[j]) + u * u * (y1[j] * (1 + 2 * w) - h * w * r1[j]);
    }
    return 0;
}

/* Those of ARKODE are in scratch that nothing has been written to before the first step, nor in steps of
 * fixed size. */
static int errors(drape_first_order *f, N_Vector out)
{
    const dirk_state *s = (const dirk_state *)f;
    if (s->attempted && isnan(fixed_step(s)))
        return ARKStepGetEstLocalErrors(f->memory, out);
    N_VConst(0, out);
    return 0;
}

static bool archive_arkode(drape_first_order *f, drape_archive *a)
{
    dirk_state *s = (dirk_state *)f;
    N_Vector vectors[] = {f->y, f->rate, s->before, s->rate_before};
    double *const numbers[] = {&s->t, &s->h, &s->next, &s->error};
    drape_archive_mark(a, "arkode");
    for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++)
        drape_archive_doubles(a, N_VGetArrayPointer(vectors[i]), 2 * (size_t)f->n);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        drape_archive_double(a, numbers[i]);
    return true;
}

/* Three here; of the stages, the interpolation, and scratch. */
static int vectors(const drape_first_order *f)
{
    return 3 + methods[order_of((const dirk_state *)f)].stages + 4 + 9;
}

static const drape_first_order_solver solver = {
    .name = "ARKODE",
    .state_size = sizeof(dirk_state),
    .param_count = PARAM_COUNT,
    .loose_order = LOOSE_ORDER,
    .tight_order = TIGHT_ORDER,
    .correct = correct,
    .create = create_arkode,
    .free = ARKStepFree,
    .destroy_vectors = destroy_vectors,
    .begin = begin,
    .step = step,
    .last_step = ARKStepGetLastStep,
    .current_step = ARKStepGetCurrentStep,
    .iterations = ARKStepGetNumNonlinSolvIters,
    .errors = errors,
    .dense = dense,
    .archive = archive_arkode,
    .vectors = vectors,
};

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    return drape_first_order_create(&solver, arena, system, values, state);
}

const drape_integrator_ops drape_integrator_dirk = {
    .entry = {.name = "dirk",
              .summary = "L-stable Runge-Kutta methods of order 2 to 5 with local error control by ARKODE",
              .reference = "Kennedy & Carpenter 2016, 2019; Reynolds et al. 2023, ARKODE",
              DRAPE_PARAMS(params)},
    .order = 5,
    .create = create,
    .order_parameter = "order",
    DRAPE_FIRST_ORDER_OPS,
};
