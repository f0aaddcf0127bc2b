/* sun_newton.c: see sun_newton.h. */
#include "integrators/sun_newton.h"
#include "base/elementary.h"
#include "nonlinear/line_search.h"

#include <math.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>

#define UNKNOWN  20.0 /* error left after a correction with new factors: a rate of 0.95, as IDA assumes */
#define AGEING   2.0
#define SLOWEST  0.9  /* a larger rate asks for new factors, or a smaller step; IDA's own */
#define ROUNDING 1e-4 /* of the tolerance: a smaller first correction is rounding; IDA's own */
#define STRICT   0.1  /* of the tolerance */

/* Of the damped iteration. */
#define MAX_CORRECTIONS 20
#define FARTHEST        3.0 /* tolerances that a prediction is off: the error test of BDF 2 allows no more */
#define CHORD_RATE      0.5 /* factors are used again while each correction is at most this of the last one */

static SUNNonlinearSolverContent_Newton content_of(const drape_sun_newton *newton)
{
    return newton->solver->content;
}

static double bound_of(const drape_sun_newton *newton, double tolerance)
{
    return newton->strict ? STRICT * tolerance : tolerance;
}

/* ---- With the factors that are at hand ---- */

static int converged(SUNNonlinearSolver solver, N_Vector y, N_Vector correction, sunrealtype tolerance,
                     N_Vector weights, void *user)
{
    (void)y;
    drape_sun_newton *newton = user;
    int done = 0;
    double norm = N_VWrmsNorm(correction, weights);
    double max = bound_of(newton, tolerance);
    if (SUNNonlinSolGetCurIter(solver, &done))
        return -1;
    if (done == 0) {
        newton->first = norm;
        newton->left *= AGEING;
        if (norm <= ROUNDING * max)
            return 0;
    } else {
        double rate = drape_pow(norm / newton->first, 1.0 / done);
        if (!(rate <= SLOWEST))
            return SUN_NLS_CONV_RECVR;
        newton->left = rate / (1 - rate);
    }
    return newton->left * norm <= max ? 0 : SUN_NLS_CONTINUE;
}

/* ---- Damped ---- */

/* correction = -A^-1 F with the present factors, F in newton->residual. */
static int correct(drape_sun_newton *newton, N_Vector correction, void *library)
{
    N_VScale(-1, newton->residual, correction);
    content_of(newton)->niters++;
    return content_of(newton)->LSolve(correction, library);
}

/* The same after factoring the matrix at the point of the last residual. */
static int renew(drape_sun_newton *newton, N_Vector correction, void *library)
{
    newton->bounds = true;
    int code = content_of(newton)->LSetup(SUNTRUE, &content_of(newton)->jcur, library);
    newton->bounds = false;
    return code ? code : correct(newton, correction, library);
}

/* Begins at the predicted x, or short of it where that would be inside something, with v = x': then every
 * correction has dv = c_j dx, and the residual of M v' + g alone decides how long it should be. */
static int begin(drape_sun_newton *newton, N_Vector y, N_Vector weights, void *library)
{
    N_VConst(0, y);
    int code = content_of(newton)->Sys(y, newton->residual, library);
    const bool retreats = code > 0 && newton->retreat && newton->retreat(newton->user, y);
    if (retreats)
        code = content_of(newton)->Sys(y, newton->residual, library);
    if (code)
        return code;
    const int64_t n = newton->n / 2;
    sunrealtype gamma = 1;
    if (newton->gamma)
        newton->gamma(library, &gamma);
    /* scale: what makes x' - v, or v' + M^-1 g, of a residual */
    const double *f = N_VGetArrayPointer(newton->residual), scale = 1 / gamma;
    double *v = N_VGetArrayPointer(y) + n;
    for (int64_t i = 0; i < n; i++)
        v[i] = scale * f[i];
    if (retreats && N_VWrmsNorm(y, weights) > FARTHEST)
        return SUN_NLS_CONV_RECVR;
    return content_of(newton)->Sys(y, newton->residual, library);
}

/* Work of the residual of M v' + g along a correction; with masses, in a unit that is the same in a step. */
static double work_along(const drape_sun_newton *newton, N_Vector correction)
{
    const int64_t n = newton->n / 2;
    const double *f = N_VGetArrayPointer(newton->residual) + n, *dx = N_VGetArrayPointer(correction);
    double work = 0;
    for (int64_t i = 0; i < n; i++)
        work += (newton->mass ? newton->mass[i] * f[i] : f[i]) * dx[i];
    return drape_ranks_sum(newton->ranks, work);
}

/* Moves y along the correction by the rule of nonlinear/line_search.h, with the work of the residual of
 * M v' + g, and as far as contact allows. */
static int search(drape_sun_newton *newton, N_Vector y, N_Vector correction, void *library)
{
    drape_length l = drape_length_begin(work_along(newton, correction));
    if (l.found)
        return SUN_NLS_CONV_RECVR;
    for (int trial = 0; trial < DRAPE_LENGTH_TRIALS && !l.found; trial++) {
        N_VLinearSum(1, y, l.length, correction, newton->trial);
        const int code = content_of(newton)->Sys(newton->trial, newton->residual, library);
        if (code < 0)
            return code;
        l.end = code ? INFINITY : work_along(newton, correction);
        drape_length_judge(&l, false);
    }
    if (l.found)
        N_VScale(1, newton->trial, y);
    return l.found ? 0 : SUN_NLS_CONV_RECVR;
}

/* Its factors serve for the next correction while corrections contract. A correction within the bound is the
 * last one; so is one that would be, by factors that contract: that one is made without a search. */
static int solve_damped(drape_sun_newton *newton, N_Vector y, N_Vector weights, double max, void *library)
{
    N_Vector d = newton->correction, next = newton->next;
    int code = begin(newton, y, weights, library);
    if (!code)
        code = renew(newton, d, library);
    for (int i = 0; i < MAX_CORRECTIONS && !code; i++) {
        const double size = N_VWrmsNorm(d, weights);
        if ((code = search(newton, y, d, library)) || size <= max)
            return code;
        if ((code = correct(newton, next, library)))
            return code;
        const double left = N_VWrmsNorm(next, weights);
        if (!(left <= CHORD_RATE * size)) {
            code = renew(newton, d, library);
        } else if (left <= max) {
            N_VLinearSum(1, y, 1, next, y);
            return 0;
        } else
            N_VScale(1, next, d);
    }
    return code ? code : SUN_NLS_CONV_RECVR;
}

/* SUNDIALS' iteration; where it fails, the damped one. If old factors fail, SUNDIALS makes new ones and tries
 * again. Without LSetup it does not: where the last new ones failed, the damped iteration comes at once. */
static int solve(SUNNonlinearSolver solver, N_Vector predicted, N_Vector y, N_Vector weights,
                 sunrealtype tolerance, int call_setup, void *library)
{
    SUNNonlinearSolverContent_Newton content = solver->content;
    drape_sun_newton *newton = content->ctest_data;
    const SUNNonlinSolLSetupFn setup = content->LSetup;
    if (newton->is_due)
        call_setup = newton->is_due(newton->user);
    if (!call_setup && newton->failed)
        content->LSetup = NULL;
    content->jcur = SUNFALSE;
    int code = newton->undamped(solver, predicted, y, weights, tolerance, call_setup, library);
    content->LSetup = setup;
    if (content->jcur)
        newton->failed = code > 0;
    return code > 0 ? solve_damped(newton, y, weights, bound_of(newton, tolerance), library) : code;
}

/* ---- The object ---- */

bool drape_sun_newton_create(drape_sun_newton *newton, N_Vector like, int64_t n, const drape_ranks *ranks,
                             SUNContext sun)
{
    newton->n = n;
    newton->ranks = ranks;
    drape_sun_newton_forget(newton);
    newton->residual = N_VClone(like);
    newton->correction = N_VClone(like);
    newton->next = N_VClone(like);
    newton->trial = N_VClone(like);
    newton->solver = SUNNonlinSol_Newton(like, sun);
    if (!newton->residual || !newton->correction || !newton->next || !newton->trial || !newton->solver)
        return false;
    newton->undamped = newton->solver->ops->solve;
    newton->solver->ops->solve = solve;
    return true;
}

bool drape_sun_newton_set_test(drape_sun_newton *newton)
{
    return !SUNNonlinSolSetConvTestFn(newton->solver, converged, newton);
}

void drape_sun_newton_forget(drape_sun_newton *newton)
{
    newton->left = UNKNOWN;
}

void drape_sun_newton_archive(drape_sun_newton *newton, drape_archive *a)
{
    drape_archive_double(a, &newton->first);
    drape_archive_double(a, &newton->left);
    drape_archive_bool(a, &newton->strict);
    drape_archive_bool(a, &newton->failed);
}

void drape_sun_newton_free(drape_sun_newton *newton)
{
    SUNNonlinSolFree(newton->solver);
    newton->solver = NULL;
    N_Vector *const vectors[] = {&newton->residual, &newton->correction, &newton->next, &newton->trial};
    for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++) {
        N_VDestroy(*vectors[i]);
        *vectors[i] = NULL;
    }
}
