/*
 * ida_newton.h: the Newton iteration in a step of IDA: when it has converged, and what to do where it fails.
 *
 * IDA estimates the rate at which the iteration with old factors contracts from the last step that took two
 * iterations. While c_j does not change, that may be thousands of steps ago, and each step since has ended
 * after one correction, however inaccurate the matrix had become. The residual that such a step leaves is
 * below the tolerance, but it has the same effect in every step, and makes waves with w h about 1, which
 * BDF 2 damps, grow: the energy of a sheet rose from 1470 J to 2345 J.
 *
 * Here the estimated rate is doubled with every step that does not measure it, and it is unknown after new
 * factors.
 *
 * IDA does not shorten corrections. It shortens the step instead until none needs to be shortened, and the
 * kinks of friction, where the slip of a node ends, need steps of a microsecond: at such a kink the matrix
 * at one side knows nothing of the other. Where the iteration fails with new factors, a damped one begins
 * anew at the prediction. Its corrections are shortened by a line search, and its matrix has an upper bound
 * of that of friction, by which corrections do not overshoot (drape_friction_bound). IDA shortens the step
 * only where this fails, too.
 */
#ifndef DRAPE_INTEGRATORS_IDA_NEWTON_H
#define DRAPE_INTEGRATORS_IDA_NEWTON_H

#include "base/archive.h"

#include <sundials/sundials_nonlinearsolver.h>

#include <stdbool.h>

typedef struct drape_ida_newton {
    SUNNonlinearSolver solver;
    int (*undamped)(SUNNonlinearSolver, N_Vector, N_Vector, N_Vector, sunrealtype, int, void *);
    N_Vector residual, correction, next, trial; /* of the damped iteration */
    double first;                               /* norm of the first correction of a step */
    double left; /* error left after a correction relative to the correction's norm: r/(1 - r) for the
                     rate r */
    bool strict; /* a tenth of the tolerance is used: the run has gained energy */
    bool failed; /* the undamped iteration, with the last new matrix that it had */
    bool bounds; /* the matrix that is requested now is for the damped iteration */
} drape_ida_newton;

/* Replaces IDA's own nonlinear solver. like: any vector of the unknowns (x, v), with F = (x' - v, M v' + g).
 * False: out of memory, or refused by IDA. */
bool drape_ida_newton_attach(drape_ida_newton *newton, void *ida, N_Vector like, SUNContext sun);

/* To be called after new factors. */
void drape_ida_newton_forget(drape_ida_newton *newton);

/* Archives what is kept between steps. */
void drape_ida_newton_archive(drape_ida_newton *newton, drape_archive *a);

/* Call it after IDA has been freed; does nothing if solver is NULL. */
void drape_ida_newton_free(drape_ida_newton *newton);

#endif
