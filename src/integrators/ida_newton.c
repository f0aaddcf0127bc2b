/* ida_newton.c: see ida_newton.h. */
#include "integrators/ida_newton.h"
#include "base/elementary.h"

#include <ida/ida.h>
#include <math.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>

#define UNKNOWN  20.0 /* error left after a correction with new factors: a rate of 0.95, as IDA assumes */
#define AGEING   2.0
#define SLOWEST  0.9  /* a larger rate asks for new factors, or a smaller step; IDA's own */
#define ROUNDING 1e-4 /* of the tolerance: a smaller first correction is rounding; IDA's own */
#define STRICT   0.1  /* of the tolerance */

static int converged(SUNNonlinearSolver solver, N_Vector y, N_Vector correction, sunrealtype tolerance,
                     N_Vector weights, void *user)
{
    (void)y;
    drape_ida_newton *newton = user;
    int done = 0;
    double norm = N_VWrmsNorm(correction, weights);
    double max = newton->strict ? STRICT * tolerance : tolerance;
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

bool drape_ida_newton_attach(drape_ida_newton *newton, void *ida, N_Vector like, SUNContext sun)
{
    drape_ida_newton_forget(newton);
    newton->solver = SUNNonlinSol_Newton(like, sun);
    return newton->solver && !IDASetNonlinearSolver(ida, newton->solver) &&
           !SUNNonlinSolSetConvTestFn(newton->solver, converged, newton);
}

void drape_ida_newton_forget(drape_ida_newton *newton)
{
    newton->left = UNKNOWN;
}

void drape_ida_newton_archive(drape_ida_newton *newton, drape_archive *a)
{
    drape_archive_double(a, &newton->first);
    drape_archive_double(a, &newton->left);
    drape_archive_bool(a, &newton->strict);
}

void drape_ida_newton_free(drape_ida_newton *newton)
{
    if (newton->solver)
        SUNNonlinSolFree(newton->solver);
    newton->solver = NULL;
}
