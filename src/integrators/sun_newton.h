/*
 * sun_newton.h: the Newton iteration in a step of IDA or ARKODE: when it has converged, and what
 * to do where it fails.
 *
 * IDA estimates, like ARKODE, the rate at which the iteration with old factors contracts from the
 * last step that took two iterations. While c_j does not change, that may be thousands of steps ago, and
 * each step since has ended after one correction, however inaccurate the matrix had become. The residual
 * that such a step leaves is below the tolerance, but it has the same effect in every step, and makes
 * waves with w h about 1, which BDF 2 damps, grow: the energy of a sheet rose from 1470 J to 2345 J.
 *
 * Here the estimated rate is doubled with every step that does not measure it, and it is unknown after new
 * factors.
 *
 * IDA does not shorten corrections. It shortens the step instead until none needs to be shortened, and the
 * kinks of friction, where the slip of a node ends, need steps of a microsecond: at such a kink the matrix
 * at one side knows nothing of the other. Where the iteration fails with new factors, a damped one begins
 * anew at the prediction. A prediction knows nothing of contact that begins: nodes that it would bring into
 * something are held back (retreat). The corrections are shortened by a line search, and the matrix has an
 * upper bound of that of friction, by which corrections do not overshoot (drape_friction_bound). The step is
 * shortened only where this fails, too.
 *
 * The residual of IDA is F = (x' - v, M v' + g). That of ARKODE is gamma (x' - v, v' + M^-1 g),
 * from which gamma and the masses make the first.
 */
#ifndef DRAPE_INTEGRATORS_SUN_NEWTON_H
#define DRAPE_INTEGRATORS_SUN_NEWTON_H

#include "base/archive.h"
#include "base/ranks.h"

#include <sundials/sundials_nonlinearsolver.h>

#include <stdbool.h>

typedef struct drape_sun_newton {
    SUNNonlinearSolver solver;
    int64_t n;                /* unknowns here */
    const drape_ranks *ranks; /* NULL: all are */
    int (*undamped)(SUNNonlinearSolver, N_Vector, N_Vector, N_Vector, sunrealtype, int, void *);
    N_Vector residual, correction, next, trial; /* of the damped iteration */
    double first;                               /* norm of the first correction of a step */
    double left; /* error left after a correction relative to the correction's norm: r/(1 - r) for the
                     rate r */
    bool strict; /* a tenth of the tolerance is used: the run has gained energy */
    bool failed; /* the undamped iteration, with the last new matrix that it had */
    bool bounds; /* the matrix that is requested now is for the damped iteration */
    /* Of ARKODE: the masses of x (n), and the function that returns gamma. NULL: IDA. */
    const double *mass;
    int (*gamma)(void *solver, sunrealtype *gamma);
    /* Whether the iteration begins with new factors. NULL: the solver decides. */
    bool (*is_due)(void *user);
    /* After a residual at a predicted y that cannot be evaluated: adds to y, the correction so far, what
     * makes it one that can. False: there is no such thing. NULL: nor ever is. */
    bool (*retreat)(void *user, N_Vector y);
    void *user;
} drape_sun_newton;

/* Creates newton->solver. like: any vector of the unknowns (x, v), of which n are here; ranks: that share
 * them. False: out of memory. */
bool drape_sun_newton_create(drape_sun_newton *newton, N_Vector like, int64_t n, const drape_ranks *ranks,
                             SUNContext sun);

/* To be called after newton->solver has been given to IDA or ARKODE, which put their own test of
 * convergence into it. False: refused. */
bool drape_sun_newton_set_test(drape_sun_newton *newton);

/* To be called after new factors. */
void drape_sun_newton_forget(drape_sun_newton *newton);

/* Archives what is kept between steps. */
void drape_sun_newton_archive(drape_sun_newton *newton, drape_archive *a);

/* Call it after the library's memory has been freed; does nothing if solver is NULL. */
void drape_sun_newton_free(drape_sun_newton *newton);

#endif
