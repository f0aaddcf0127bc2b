/*
 * ida: variable order and step size with local error control by IDA (Hindmarsh et al. 2005; Brenan,
 * Campbell & Petzold 1996).
 *     y = (x, v) of the free nodes,  F = [x' - v ; M v' + g(x, v, t)] = 0
 *
 * Each Newton correction of IDA solves [c_j I, -I; K, D + c_j M] (dx, dv) = (r1, r2), K = dg/dx, D = dg/dv.
 * Eliminating dv = c_j dx - r1 leaves
 *     (K + c_j D + c_j^2 M) dx = r2 + (D + c_j M) r1:
 * the matrix of a backward Euler step of size 1/c_j, with the same pattern and the same linear solvers. IDA
 * keeps Jacobian and factors while c_j stays near the value that they were computed for; that is most of
 * its advantage over one factorisation for each iteration. ida_newton.h decides when the iteration with old
 * factors has converged, and damps one that fails.
 *
 * That iteration does not need an exact matrix either. The nonsymmetric parts are those of friction, whose
 * force follows the normal force, and of dashpots of strains that rotate. Both are small beside c_j^2 M and
 * c_j D at the step sizes at which they occur. If each off-diagonal pair is replaced by its mean, Cholesky
 * factors can be used: half of the time or less in most scenes with contact, for as many iterations. Where
 * much cloth slides, the iteration may fail with them: then some matrices are exact.
 *
 * Error weights are a length and a velocity, the same for every node: 1/atol_x and 1/atol_v. A relative
 * part would make the error depend on where the scene is. The maximum order is 2 at loose tolerances,
 * because BDF 3 to 5 are not A-stable and feed energy into undamped waves; it is 5 if the tolerance
 * resolves these waves.
 *
 * The motion of pins has kinks at the keys of their tracks, and where a host changes their paths: IDA stops
 * there and restarts.
 *
 * IDA chooses order and step, predicts, tests errors and iterates. Its callbacks follow in the order in
 * which it calls them, then the stages of a step around IDASolve.
 */
#include "base/finite.h"
#include "base/reason.h"
#include "integrators/ida_newton.h"
#include "integrators/integrator.h"
#include "integrators/tolerance.h"
#include "solvers/sun_linear.h"
#include "solvers/sundials_memory.h"

#include <float.h>
#include <ida/ida.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <string.h>

enum {
    PARAM_RTOL,
    PARAM_ATOL_X,
    PARAM_ATOL_V,
    PARAM_MAX_ORDER,
    PARAM_MAX_STEP,
    PARAM_MAX_STEPS,
    PARAM_LINEAR_SOLVER,
    PARAM_MATRIX,
    PARAM_COUNT
};
enum { MATRIX_AUTO, MATRIX_SYMMETRIC, MATRIX_EXACT };

#define TIGHT          1e-4 /* rtol below which order 5 is used */
#define LOOSE_ORDER    2
#define TIGHT_ORDER    5
#define NEWTON_SHARE   0.33 /* of the error tolerance: bound for the error of the Newton iteration */
#define MAX_EXACT_SPAN 64   /* maximum number of exact matrices in a row if symmetric ones keep failing */
/* The matrix is factored again when c_j changed by more than (1 - d)/(1 + d). IDA's own d, 0.25, takes a
 * quarter more residuals for as many factorisations. */
#define CJ_CHANGE 0.1
/* Share of the energy of a scene. At rtol 1e-3 the energy of a smooth fall oscillates by half a percent: a
 * larger gain means that waves are amplified. */
#define GAIN 0.02
/* Fraction of the time: steps whose sum ends this near to the end of an advance end there. What is left is
 * the sum's rounding error, which the schedule does not step over. */
#define LANDED (1e3 * DBL_EPSILON)
/* Of the time in which the scene moves by its size. What comes too near crosses the least gap of contact,
 * 1e-3 of a thickness, in longer steps at any speed that it can have, so steps as short as this, one
 * after the other, lead nowhere. A few may start IDA. */
#define LEAST_STEP       1e-10
#define MAX_TINY         20
#define MAX_ERROR_FAILS  10 /* error test failures in one step */
#define MAX_SOLVER_FAILS 10 /* convergence failures in one step */

static const char *const matrix_choices[] = {
    [MATRIX_AUTO] = "auto", [MATRIX_SYMMETRIC] = "symmetric", [MATRIX_EXACT] = "exact", NULL};
static const drape_param params[PARAM_COUNT] = {
    [PARAM_RTOL] = DRAPE_RTOL_PARAM,
    [PARAM_ATOL_X] = DRAPE_ATOL_X_PARAM,
    [PARAM_ATOL_V] = DRAPE_ATOL_V_PARAM,
    [PARAM_MAX_ORDER] = DRAPE_INTEGER("max_order", "1", DRAPE_DERIVED("2 for rtol >= 1e-4, else 5"), 1, 5,
                                      "highest order of the BDF"),
    [PARAM_MAX_STEP] =
        DRAPE_NUMBER("max_step", "s", DRAPE_DERIVED("none"), DRAPE_ABOVE(0), 1e9, "largest step"),
    [PARAM_MAX_STEPS] =
        DRAPE_INTEGER("max_steps", "1/s", 100000, 1, 1e9,
                      "largest number of steps within one second of simulated time, not counting those "
                      "that end an advance; one more ends the run"),
    [PARAM_LINEAR_SOLVER] = DRAPE_CHOICE("linear_solver", 0, drape_linears_names, "name of a linear solver",
                                         .aliases = drape_linears_aliases),
    [PARAM_MATRIX] = DRAPE_CHOICE(
        "matrix", MATRIX_AUTO, matrix_choices,
        "matrix of Newton's corrections; symmetric: the symmetric part of the exact one, which differs from "
        "it with friction and dashpots; auto: symmetric, and exact for a while if that fails"),
};

typedef struct ida_state {
    drape_arena *arena;
    drape_system *system;
    const drape_model *model;
    const drape_motion *motion;
    double values[PARAM_COUNT];
    int64_t n; /* free DOFs; the system has 2 n unknowns */
    SUNContext sun;
    void *ida;
    N_Vector y, rate, weights, between; /* (x, v), (x', v'), absolute tolerances, dense output */
    drape_sun_linear *linear;
    drape_ida_newton newton;
    double *x, *v, *g;  /* nodes: where the residual was evaluated last; g there */
    double *damping;    /* D (nonzeros); NULL if nothing dissipates */
    double *reduced;    /* right-hand side of the reduced system (n) */
    double *dissipated; /* nodes; NULL if nothing dissipates */

    /* The matrix, kept between steps. */
    double factored_cj;      /* c_j of the factors */
    bool symmetric;          /* the last matrix of the undamped iteration was the symmetric part */
    int64_t exact_remaining; /* exact matrices until the symmetric part is tried again, */
    int64_t exact_span;      /* of this many in a row */

    /* Kept between steps. */
    const double *internal; /* of the last accepted state */
    double span[2];         /* [s] interval without a kink in the motion of pins and colliders */
    double reached;         /* [s] time of IDA's state; NAN: it must restart */
    double from;            /* [s] time at which the last successful step began; NAN: none */
    double powers[2];       /* [W] power of dissipation; power of pins; both at the time reached */
    double second;          /* [s] beginning of the second of simulated time in which steps are counted */
    double least_step;      /* [s] */
    int64_t tiny;           /* steps in a row that were shorter than that */
    int64_t steps;          /* attempted in that second, except those that end an advance */
    long counted;           /* Newton iterations of IDA that `work` contains already */
    drape_work work;

    /* Why callbacks failed in this step; IDA keeps only the sign. */
    bool nonfinite, crossing; /* the last residual */
    bool crossed;             /* some residual; the last that did: */
    const char *crossing_reason;
    drape_diagnostic crossing_pair;
    drape_status failure; /* < 0: the pattern could not be extended */
} ida_state;

/* ---- Between vectors and nodes ---- */

static size_t node_at(const ida_state *s, int64_t i)
{
    return 3 * (size_t)s->model->node_of_free[i / 3] + (size_t)(i % 3);
}

static double mass_of(const ida_state *s, int64_t i)
{
    return s->model->mass[s->model->node_of_free[i / 3]];
}

/* Within a step no pin has a kink, so its velocity is the same at any time inside the span. */
static void place_pins(ida_state *s, double t)
{
    const drape_motion *m = s->motion;
    drape_motion_place_pins(m, t, s->x);
    for (int32_t i = 0; i < m->moved_count; i++)
        drape_motion_pin_velocity(m, i, t, (s->span[0] + s->span[1]) / 2,
                                  s->v + 3 * (size_t)m->moved_node[i]);
}

static drape_point place(ida_state *s, double t, const double *y)
{
    place_pins(s, t);
    for (int64_t i = 0; i < s->n; i++) {
        s->x[node_at(s, i)] = y[i];
        s->v[node_at(s, i)] = y[s->n + i];
    }
    return (drape_point){
        .x = s->x, .v = s->v, .internal = s->internal, .t = t, .span = {s->span[0], s->span[1]}};
}

/* ---- Residual ---- */

static int residual(sunrealtype t, N_Vector y, N_Vector rate, N_Vector out, void *user)
{
    ida_state *s = user;
    const double *v = N_VGetArrayPointer(y) + s->n, *xp = N_VGetArrayPointer(rate), *vp = xp + s->n;
    double *f = N_VGetArrayPointer(out), start = drape_system_clock(s->system);
    drape_point point = place(s, t, N_VGetArrayPointer(y));
    drape_system_force(s->system, &point, s->g);
    for (int64_t i = 0; i < s->n; i++) {
        f[i] = xp[i] - v[i];
        f[s->n + i] = mass_of(s, i) * vp[i] + s->g[node_at(s, i)];
    }
    s->nonfinite = !drape_all_finite(f, 2 * (size_t)s->n);
    s->crossing =
        !s->nonfinite && drape_system_crosses(s->system, s->x, t, &s->crossing_reason, &s->crossing_pair);
    s->crossed |= s->crossing;
    s->work.residuals++;
    s->work.residual_seconds += drape_system_clock(s->system) - start;
    return drape_system_status(s->system) ? -1 : s->nonfinite || s->crossing ? 1 : 0;
}

/* ---- Jacobian ---- */

/* Takes the matrices for the system's present pattern. */
static drape_status renew_matrices(ida_state *s)
{
    const drape_pattern *pattern = drape_system_pattern(s->system);
    if (s->dissipated) {
        drape_arena_release(s->arena, s->damping);
        s->damping = drape_arena_take(s->arena, (size_t)pattern->nonzeros, sizeof *s->damping);
        if (!s->damping)
            return DRAPE_E_MEMORY;
    }
    return drape_sun_linear_extend_pattern(s->linear, pattern);
}

/* Contact may couple new nodes. */
static drape_status extend_pattern(ida_state *s, const drape_point *point)
{
    bool changed;
    drape_status status = drape_system_extend_pattern(s->system, point, &changed);
    s->linear->stale |= changed;
    return !status && s->linear->stale ? renew_matrices(s) : status;
}

/* Excludes contact and the new analysis in extend_pattern, which are timed separately. */
static double jacobian_clock(const ida_state *s)
{
    return drape_system_clock(s->system) - s->linear->factor_seconds;
}

/* Whether the next matrix is the symmetric part. If the iteration failed with a new symmetric matrix, exact
 * ones are used for a while: twice as many as the last time, or half as many after each symmetric one that
 * converged. */
static bool choose_symmetric(ida_state *s)
{
    const bool failed = s->symmetric && s->newton.failed;
    if (s->values[PARAM_MATRIX] != MATRIX_AUTO)
        return s->values[PARAM_MATRIX] == MATRIX_SYMMETRIC;
    if (failed)
        s->exact_remaining = s->exact_span =
            s->exact_span < MAX_EXACT_SPAN ? 2 * s->exact_span : MAX_EXACT_SPAN;
    else if (s->exact_remaining > 0)
        s->exact_remaining--;
    else if (s->exact_span > 1)
        s->exact_span /= 2;
    return s->exact_remaining == 0;
}

static int jacobian(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector rate, N_Vector r, SUNMatrix matrix,
                    void *user, N_Vector a, N_Vector b, N_Vector c)
{
    (void)rate, (void)r, (void)matrix, (void)a, (void)b, (void)c;
    ida_state *s = user;
    double start = jacobian_clock(s);
    drape_point point = place(s, t, N_VGetArrayPointer(y));
    point.weight = cj;
    point.contact = s->newton.bounds ? DRAPE_CONTACT_GAUSS_NEWTON : DRAPE_CONTACT_EXACT;
    s->failure = extend_pattern(s, &point);
    if (s->failure)
        return -1;
    drape_system_jacobian(s->system, &point, cj * cj, 0, s->linear->values);
    if (!s->newton.bounds)
        s->symmetric = choose_symmetric(s);
    if (s->newton.bounds || s->symmetric)
        drape_pattern_symmetrize(drape_system_pattern(s->system), s->linear->values);
    if (s->damping)
        drape_system_damping(s->system, &point, s->damping);
    s->factored_cj = cj;
    drape_ida_newton_forget(&s->newton);
    s->work.jacobians++;
    s->work.jacobian_seconds += jacobian_clock(s) - start;
    return 0;
}

/* ---- Solve ---- */

/* reduced += D r */
static void add_damping(const ida_state *s, const double *r)
{
    const drape_pattern *p = drape_system_pattern(s->system);
    if (!s->damping)
        return;
    for (int64_t j = 0; j < p->n; j++)
        for (int64_t k = p->column[j]; k < p->column[j + 1]; k++)
            s->reduced[p->row[k]] += s->damping[k] * r[j];
}

static int solve_reduced(SUNLinearSolver solver, SUNMatrix matrix, N_Vector out, N_Vector in,
                         sunrealtype tolerance)
{
    (void)matrix, (void)tolerance;
    drape_sun_linear *linear = solver->content;
    ida_state *s = linear->owner;
    const double *r1 = N_VGetArrayPointer(in), *r2 = r1 + s->n;
    double *dx = N_VGetArrayPointer(out), *dv = dx + s->n;
    for (int64_t i = 0; i < s->n; i++)
        s->reduced[i] = r2[i] + s->factored_cj * mass_of(s, i) * r1[i];
    add_damping(s, r1);
    drape_status status = drape_sun_linear_solve(linear, s->reduced, dx);
    for (int64_t i = 0; i < s->n; i++)
        dv[i] = s->factored_cj * dx[i] - r1[i];
    return status;
}

/* ---- Work of dissipation, pins and colliders ---- */

/* Power at time t of forces on moving colliders; NULL: no contact. */
static double collider_power(const ida_state *s, double t, const double *force)
{
    double power = 0;
    if (!force)
        return 0;
    for (int32_t c = 0; c < s->model->collider_count; c++) {
        double v[3];
        drape_motion_collider_velocity(s->motion, c, t, (s->span[0] + s->span[1]) / 2, v);
        for (int k = 0; k < 3; k++)
            power += force[3 * c + k] * v[k];
    }
    return power;
}

/* Power at the state in s->x, s->v at time t: of dissipative forces, and of the forces that move pins and
 * colliders. */
static void measure_powers(ida_state *s, double t, double powers[2])
{
    const drape_model *m = s->model;
    const drape_motion *motion = s->motion;
    const drape_point point = {
        .x = s->x, .v = s->v, .internal = s->internal, .t = t, .span = {s->span[0], s->span[1]}};
    powers[0] = powers[1] = 0;
    if (s->dissipated) {
        drape_system_dissipation(s->system, &point, s->dissipated);
        for (size_t i = 0; i < 3 * (size_t)m->node_count; i++)
            powers[0] += s->dissipated[i] * s->v[i];
        powers[0] += collider_power(s, t, drape_system_on_colliders(s->system));
    }
    if (motion->moved_count > 0 || m->collider_count > 0)
        drape_system_force(s->system, &point, s->g);
    powers[1] += collider_power(s, t, drape_system_on_colliders(s->system));
    for (int32_t i = 0; i < motion->moved_count; i++)
        for (size_t k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)motion->moved_node[i] + k;
            powers[1] += s->g[at] * s->v[at];
        }
}

/* Adds the work, by the trapezoidal rule. */
static void audit(ida_state *s, const drape_state *in, const drape_state *out, drape_step_info *info)
{
    double after[2];
    measure_powers(s, out->t, after);
    info->dissipated = 0.5 * (out->t - in->t) * (s->powers[0] + after[0]);
    info->pin_work = 0.5 * (out->t - in->t) * (s->powers[1] + after[1]);
    memcpy(s->powers, after, sizeof after);
}

/* ---- A step ---- */

/* After a failure, reports the degenerate element or the node whose force is not finite; otherwise the node
 * with the largest weighted error. */
static void diagnose(ida_state *s, drape_step_info *info)
{
    if (s->n == 0)
        return;
    if (s->nonfinite) {
        for (int64_t i = 0; i < s->n; i++)
            s->reduced[i] = s->g[node_at(s, i)];
        info->diagnostic = drape_system_diagnose_dof(s->system, s->reduced, "force [N]", INFINITY);
        drape_system_check(s->system, s->x, NULL, s->internal, &info->reason, &info->diagnostic);
        return;
    }
    if (s->crossing) {
        info->diagnostic = s->crossing_pair;
        return;
    }
    if (IDAGetEstLocalErrors(s->ida, s->between))
        return;
    const double *e = N_VGetArrayPointer(s->between), *w = N_VGetArrayPointer(s->weights);
    for (int64_t i = 0; i < s->n; i++)
        s->reduced[i] = fmax(fabs(e[i]) / w[i], fabs(e[s->n + i]) / w[s->n + i]);
    info->diagnostic = drape_system_diagnose_dof(s->system, s->reduced, "local error / tolerance", 1);
}

/* Bounds the work, because steps may follow a degenerate, undamped sheet for ever without a failure. The
 * bound is a rate, so that it does not depend on how a host divides its advances; steps that end an advance
 * are the host's choice and are not counted. A host that continues after the failure gets the same number
 * of steps again. */
static bool exhausted(ida_state *s, const drape_state *in, drape_step_info *info)
{
    if (floor(in->t) != s->second)
        s->steps = 0;
    s->second = floor(in->t);
    if (s->steps++ < (int64_t)s->values[PARAM_MAX_STEPS])
        return false;
    s->steps = 0;
    info->reason = drape_reason_name(DRAPE_REASON_MAX_STEPS);
    IDAGetLastStep(s->ida, &info->h);
    diagnose(s, info);
    return true;
}

/* Stops a run whose steps have become so small that it no longer moves, as where nothing can yield. */
static drape_status check_step_size(ida_state *s, double h, bool last, drape_step_info *info)
{
    s->tiny = h < s->least_step && !last ? s->tiny + 1 : 0;
    if (s->tiny <= MAX_TINY)
        return DRAPE_OK;
    s->tiny = 0;
    info->h = h;
    s->crossing = s->crossed;
    info->reason = s->crossing ? s->crossing_reason : drape_reason_name(DRAPE_REASON_ERROR_TEST);
    return DRAPE_E_STEP_TOO_SMALL;
}

/* Consistent initial values need no solve: x' = v, v' = -M^-1 g. */
static drape_status start(ida_state *s, const drape_state *in, drape_step_info *info)
{
    double *y = N_VGetArrayPointer(s->y), *rate = N_VGetArrayPointer(s->rate);
    for (int64_t i = 0; i < s->n; i++) {
        y[i] = in->x[node_at(s, i)];
        y[s->n + i] = rate[i] = in->v[node_at(s, i)];
    }
    drape_point point = place(s, in->t, y);
    drape_system_force(s->system, &point, s->g);
    s->work.residuals++;
    for (int64_t i = 0; i < s->n; i++)
        rate[s->n + i] = -s->g[node_at(s, i)] / mass_of(s, i);
    s->counted = 0;
    info->reason = drape_reason_name(DRAPE_REASON_NONFINITE);
    if (!drape_all_finite(rate + s->n, (size_t)s->n)) /* IDA would cut its step ten times because of it */
        return DRAPE_RETRY_NONFINITE;
    info->reason = drape_reason_name(DRAPE_REASON_SOLVER);
    return IDAReInit(s->ida, in->t, s->y, s->rate) ? DRAPE_E_SOLVER : DRAPE_OK;
}

/* Continues from `in` if that is IDA's state; otherwise restarts, with a first step of at most h if the
 * attempt before was rejected. *t: the next kink or the end, whichever comes first; a scene without free
 * nodes advances to there. Pinned nodes that do not move keep their positions, and zero velocity, in s->x
 * and s->v for the whole step. */
static drape_status prepare(ida_state *s, const drape_state *in, double end, double h, double *t,
                            drape_step_info *info)
{
    const size_t nodes = 3 * (size_t)s->model->node_count;
    double stop = drape_motion_next_kink(s->motion, in->t, end);
    memcpy(s->x, in->x, nodes * sizeof *s->x);
    memcpy(s->v, in->v, nodes * sizeof *s->v);
    s->internal = in->internal;
    s->span[0] = in->t;
    s->span[1] = stop;
    *t = h < end - in->t ? fmin(stop, in->t + h) : stop;
    if (s->n == 0) {
        place_pins(s, in->t);
        measure_powers(s, in->t, s->powers);
        return DRAPE_OK;
    }
    if (s->reached != in->t || drape_motion_at_kink(s->motion, in->t)) {
        drape_status status = start(s, in, info);
        if (status)
            return status;
        if (IDASetInitStep(s->ida, h < end - in->t ? h : 0))
            return DRAPE_E_SOLVER;
        measure_powers(s, in->t, s->powers);
    }
    return IDASetStopTime(s->ida, stop) ? DRAPE_E_SOLVER : DRAPE_OK;
}

/* The meaning of every return code of IDASolve for the step. */
static drape_status status_of(int code, bool nonfinite, const char **reason)
{
    *reason = drape_reason_name(nonfinite ? DRAPE_REASON_NONFINITE : DRAPE_REASON_CONVERGED);
    switch (code) {
    case IDA_SUCCESS:
    case IDA_TSTOP_RETURN:
        *reason = drape_reason_name(DRAPE_REASON_CONVERGED);
        return DRAPE_OK;
    case IDA_ERR_FAIL:
        *reason = drape_reason_name(DRAPE_REASON_ERROR_TEST);
        return DRAPE_RETRY_REJECTED;
    case IDA_TOO_MUCH_ACC:
        *reason = drape_reason_name(DRAPE_REASON_ROUND_OFF);
        return DRAPE_RETRY_REJECTED;
    case IDA_CONV_FAIL:
    case IDA_NLS_FAIL:
        *reason = drape_reason_name(nonfinite ? DRAPE_REASON_NONFINITE : DRAPE_REASON_NEWTON);
        return nonfinite ? DRAPE_RETRY_NONFINITE : DRAPE_RETRY_NONLINEAR;
    case IDA_LSETUP_FAIL:
    case IDA_LSOLVE_FAIL:
        *reason = drape_reason_name(DRAPE_REASON_SINGULAR);
        return DRAPE_RETRY_LINEAR;
    case IDA_RES_FAIL:
    case IDA_REP_RES_ERR:
    case IDA_FIRST_RES_FAIL:
        *reason = drape_reason_name(DRAPE_REASON_NONFINITE);
        return DRAPE_RETRY_NONFINITE;
    default: /* IDA_MEM_NULL, IDA_ILL_INPUT, IDA_LINIT_FAIL, IDA_VECTOROP_ERR ...: no smaller step helps */
        *reason = drape_reason_name(DRAPE_REASON_SOLVER);
        return DRAPE_E_SOLVER;
    }
}

/* Makes one step of IDA, at most to `end`; *t: the time that it reached. */
static drape_status solve(ida_state *s, double end, double h, double *t, drape_step_info *info)
{
    long iterations = 0;
    s->crossing = s->crossed = s->nonfinite = false;
    s->failure = DRAPE_OK;
    int code = IDASolve(s->ida, end, t, s->y, s->rate, IDA_ONE_STEP);
    drape_status status = status_of(code, s->nonfinite, &info->reason);
    if (status > 0 && s->crossing)
        info->reason = s->crossing_reason;
    if (drape_system_status(s->system))
        status = drape_system_status(s->system);
    if (s->failure < 0 || s->linear->status < 0)
        status = s->failure < 0 ? s->failure : s->linear->status;
    IDAGetNumNonlinSolvIters(s->ida, &iterations);
    info->iterations = (int)(iterations - s->counted);
    s->work.newton_iterations += iterations - s->counted;
    s->counted = iterations;
    if (status)
        IDAGetCurrentStep(s->ida, &info->h);
    /* IDA's step may belong to an earlier attempt: half of that would not be a smaller step. */
    info->h = fmin(info->h, h);
    return status;
}

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    ida_state *s = state;
    const size_t nodes = 3 * (size_t)s->model->node_count;
    double end = out->t, t = end;
    info->tolerance = info->residual = NAN; /* IDA bounds errors, not residuals */
    if (exhausted(s, in, info))
        return DRAPE_E_STEP_TOO_SMALL;
    /* The sim rejected the last step, which IDA had accepted: mostly because of its energy. */
    if (in->t == s->from)
        s->newton.strict = true;
    s->from = NAN;
    info->reason = drape_reason_name(DRAPE_REASON_SOLVER);
    drape_status status = prepare(s, in, end, h, &t, info);
    if (!status && s->n > 0)
        status = solve(s, end, h, &t, info);
    if (!status)
        status = check_step_size(s, t - in->t, t == s->span[1] || t == end, info);
    if (end - t <= LANDED * fabs(end))
        t = end;
    s->reached = NAN;
    if (status) {
        diagnose(s, info);
        return status;
    }
    place(s, t, s->n > 0 ? N_VGetArrayPointer(s->y) : NULL);
    memcpy(out->x, s->x, nodes * sizeof *out->x);
    memcpy(out->v, s->v, nodes * sizeof *out->v);
    out->t = t;
    info->h = t - in->t;
    info->reason = drape_reason_name(DRAPE_REASON_CONVERGED);
    audit(s, in, out, info);
    s->from = in->t;
    s->reached = t;
    s->steps -= t == end;
    return DRAPE_OK;
}

static void interpolate(void *state, double t, double *x)
{
    ida_state *s = state;
    drape_motion_place_pins(s->motion, t, x);
    if (s->n == 0 || IDAGetDky(s->ida, t, 0, s->between))
        return;
    const double *y = N_VGetArrayPointer(s->between);
    for (int64_t i = 0; i < s->n; i++)
        x[node_at(s, i)] = y[i];
}

static void interpolate_velocities(void *state, double t, double *v)
{
    ida_state *s = state;
    if (s->n == 0 || IDAGetDky(s->ida, t, 0, s->between))
        return;
    const double *y = N_VGetArrayPointer(s->between);
    for (int64_t i = 0; i < s->n; i++)
        v[node_at(s, i)] = y[s->n + i];
}

static void restart(void *state, const drape_state *from)
{
    (void)from;
    ida_state *s = state;
    s->reached = s->from = NAN;
    s->newton.strict = s->newton.failed = s->symmetric = false;
    s->exact_remaining = 0;
    s->exact_span = 1;
    drape_ida_newton_forget(&s->newton);
}

/* ---- Creation and destruction ---- */

static void create_arrays(ida_state *s)
{
    size_t nodes = 3 * (size_t)s->model->node_count;
    s->x = drape_arena_take(s->arena, nodes, sizeof *s->x);
    s->v = drape_arena_take(s->arena, nodes, sizeof *s->v);
    s->g = drape_arena_take(s->arena, nodes, sizeof *s->g);
    s->reduced = drape_arena_take(s->arena, (size_t)s->n, sizeof *s->reduced);
    if (!s->model->has_dissipation)
        return;
    s->damping =
        drape_arena_take(s->arena, (size_t)drape_system_pattern(s->system)->nonzeros, sizeof *s->damping);
    s->dissipated = drape_arena_take(s->arena, nodes, sizeof *s->dissipated);
}

/* Derived defaults, and the weights that follow from them. */
static void set_tolerances(ida_state *s)
{
    double rtol = s->values[PARAM_RTOL], size = NAN, speed = NAN;
    drape_derive_tolerances(s->model, rtol, &s->values[PARAM_ATOL_X], &s->values[PARAM_ATOL_V]);
    drape_derive_tolerances(s->model, 1, &size, &speed);
    s->least_step = LEAST_STEP * size / speed;
    if (isnan(s->values[PARAM_MAX_ORDER]))
        s->values[PARAM_MAX_ORDER] = rtol >= TIGHT ? LOOSE_ORDER : TIGHT_ORDER;
    double *w = N_VGetArrayPointer(s->weights);
    for (int64_t i = 0; i < s->n; i++) {
        w[i] = s->values[PARAM_ATOL_X];
        w[s->n + i] = s->values[PARAM_ATOL_V];
    }
}

static drape_status create_vectors(ida_state *s)
{
    s->y = N_VNew_Serial(2 * s->n, s->sun);
    s->rate = N_VNew_Serial(2 * s->n, s->sun);
    s->weights = N_VNew_Serial(2 * s->n, s->sun);
    s->between = N_VNew_Serial(2 * s->n, s->sun);
    if (!s->y || !s->rate || !s->weights || !s->between)
        return drape_fail_memory(s->arena->ctx, 2 * (size_t)s->n * sizeof(double));
    N_VConst(0, s->y);
    N_VConst(0, s->rate);
    set_tolerances(s);
    return DRAPE_OK;
}

static bool configure(ida_state *s)
{
    DRAPE_IDA_QUIET(s->ida);
    bool good = !IDAInit(s->ida, residual, 0, s->y, s->rate) && !IDASetUserData(s->ida, s) &&
                !IDASVtolerances(s->ida, 0, s->weights) &&
                !IDASetLinearSolver(s->ida, s->linear->solver, s->linear->matrix) &&
                drape_ida_newton_attach(&s->newton, s->ida, s->y, s->sun) && !IDASetJacFn(s->ida, jacobian) &&
                !IDASetMaxOrd(s->ida, (int)s->values[PARAM_MAX_ORDER]) &&
                !IDASetMaxErrTestFails(s->ida, MAX_ERROR_FAILS) &&
                !IDASetMaxConvFails(s->ida, MAX_SOLVER_FAILS) &&
                !IDASetNonlinConvCoef(s->ida, NEWTON_SHARE) && !IDASetDeltaCjLSetup(s->ida, CJ_CHANGE);
    if (good && !isnan(s->values[PARAM_MAX_STEP]))
        good = !IDASetMaxStep(s->ida, s->values[PARAM_MAX_STEP]);
    return good;
}

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    drape_context *ctx = arena->ctx;
    ida_state *s = *state = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    *s = (ida_state){.arena = arena,
                     .system = system,
                     .model = drape_system_model(system),
                     .motion = drape_system_motion(system),
                     .exact_span = 1,
                     .reached = NAN,
                     .from = NAN};
    s->n = 3 * (int64_t)s->model->free_count;
    memcpy(s->values, values, sizeof s->values);
    create_arrays(s);
    drape_status status = drape_arena_status(arena);
    if (!status && (drape_sundials_context(&s->sun) || !(s->ida = IDACreate(s->sun))))
        status = drape_fail_memory(ctx, sizeof(void *));
    if (!status && s->n > 0)
        status = create_vectors(s);
    if (!status && s->n > 0)
        status = drape_sun_linear_create(arena, s->sun, drape_linears[(int)values[PARAM_LINEAR_SOLVER]],
                                         drape_system_pattern(s->system), drape_system_pool(s->system),
                                         drape_system_cancel_flag(s->system), &s->linear);
    if (status || s->n == 0)
        return status;
    s->linear->owner = s;
    s->linear->solver->ops->solve = solve_reduced;
    if (!configure(s))
        return drape_fail(ctx, DRAPE_E_MEMORY, "IDA cannot be set up for %lld unknowns",
                          (long long)(2 * s->n));
    drape_ida_clear(s->ida);
    return DRAPE_OK;
}

static void destroy(void **state)
{
    ida_state *s = *state;
    if (!s)
        return;
    if (s->ida)
        IDAFree(&s->ida);
    drape_ida_newton_free(&s->newton);
    drape_sun_linear_destroy(&s->linear);
    N_Vector vectors[] = {s->y, s->rate, s->weights, s->between};
    for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++)
        if (vectors[i])
            N_VDestroy(vectors[i]);
    if (s->sun)
        SUNContext_Free(&s->sun);
    *state = NULL;
}

/* ---- For the table ---- */

static drape_work work(const void *state)
{
    const ida_state *s = state;
    drape_work work = s->work;
    if (s->linear) {
        work.factorizations = s->linear->factorizations;
        work.linear_iterations = s->linear->iterations;
        work.factor_seconds = s->linear->factor_seconds;
        work.solve_seconds = s->linear->solve_seconds;
    }
    return work;
}

/* Its factors are kept between steps, with c_j and D. */
static void archive_factors(ida_state *s, drape_archive *a)
{
    if (drape_archive_has_read(a) && drape_system_pattern(s->system) != s->linear->pattern)
        drape_archive_note(a, renew_matrices(s));
    drape_archive_double(a, &s->factored_cj);
    drape_archive_bool(a, &s->symmetric);
    drape_archive_int64(a, &s->exact_remaining);
    drape_archive_int64(a, &s->exact_span);
    if (s->damping && drape_archive_good(a))
        drape_archive_doubles(a, s->damping, (size_t)drape_system_pattern(s->system)->nonzeros);
    drape_sun_linear_archive(s->linear, a, s->factored_cj != 0);
}

static void archive(void *state, drape_archive *a)
{
    ida_state *s = state;
    int64_t counted = s->counted;
    drape_archive_double(a, &s->reached);
    drape_archive_double(a, &s->from);
    drape_ida_newton_archive(&s->newton, a);
    drape_archive_doubles(a, s->powers, 2);
    drape_archive_double(a, &s->second);
    drape_archive_int64(a, &s->tiny);
    drape_archive_int64(a, &s->steps);
    drape_archive_int64(a, &counted);
    if (a->reading && counted < 0)
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has a negative number of iterations");
    s->counted = (long)counted;
    drape_work_archive(&s->work, a);
    if (s->n == 0)
        return;
    archive_factors(s, a);
    if (!drape_ida_archive(s->ida, a) && a->reading)
        restart(s, NULL);
}

static size_t bytes(const void *state)
{
    const ida_state *s = state;
    double max_order = s->values[PARAM_MAX_ORDER];
    size_t order = isnan(max_order) ? TIGHT_ORDER : (size_t)max_order;
    size_t vectors = 8 + order + 1 + 6; /* allocated here; the history of IDA; its scratch */
    return 2 * (size_t)s->n * vectors * sizeof(double) + (s->linear ? drape_sun_linear_bytes(s->linear) : 0);
}

const drape_integrator_ops drape_integrator_ida = {
    .entry = {.name = "ida",
              .summary = "variable order and step with local error control by IDA",
              .reference = "Hindmarsh et al. 2005, SUNDIALS; Brenan, Campbell & Petzold 1996",
              DRAPE_PARAMS(params)},
    .order = 5,
    .create = create,
    .own_steps = true,
    .gain = GAIN,
    .smooth_forces = true,
    .step = step,
    .interpolate = interpolate,
    .interpolate_velocities = interpolate_velocities,
    .restart = restart,
    .work = work,
    .archive = archive,
    .bytes = bytes,
    .destroy = destroy,
};
