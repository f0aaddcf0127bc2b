/*
 * ida_newton.h: when the Newton iteration of a step of IDA has converged.
 *
 * IDA takes the rate at which old factors contract from the last step that iterated twice. While c_j stays,
 * that may be thousands of steps ago, and each step since has ended after one correction, however wrong the
 * matrix had become. The residual that such a step leaves is below the tolerance, but it acts alike in all of
 * them, and turns waves with w h about 1, which BDF 2 damps, into growing ones: a sheet of 1470 J came to
 * 2345 J.
 *
 * Here a rate is doubled with every step that does not measure it, and it is unknown after new factors.
 */
#ifndef DRAPE_INTEGRATORS_IDA_NEWTON_H
#define DRAPE_INTEGRATORS_IDA_NEWTON_H

#include "base/archive.h"

#include <sundials/sundials_nonlinearsolver.h>

#include <stdbool.h>

typedef struct drape_ida_newton {
    SUNNonlinearSolver solver;
    double first; /* norm of the first correction of a step */
    double left;  /* error left after a correction, over its norm: r/(1 - r) of the rate r */
    bool strict;  /* a tenth of the tolerance holds: the run has gained energy */
} drape_ida_newton;

/* Takes the place of IDA's own iteration. like: any vector of the unknowns. False: no memory, or refused. */
bool drape_ida_newton_attach(drape_ida_newton *newton, void *ida, N_Vector like, SUNContext sun);

/* After new factors. */
void drape_ida_newton_forget(drape_ida_newton *newton);

/* What it keeps from step to step. */
void drape_ida_newton_archive(drape_ida_newton *newton, drape_archive *a);

/* After IDA has been freed; NULL solver: nothing. */
void drape_ida_newton_free(drape_ida_newton *newton);

#endif
