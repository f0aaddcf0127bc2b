/* linear.h: linear solvers of a matrix that ranks share (pattern->ranks), by PETSc. They are not in the table
 * of linear solvers, as no scene names them: a run on several ranks has one of them in place of the scene's
 * (drape_linear_of). */
#ifndef DRAPE_MPI_LINEAR_H
#define DRAPE_MPI_LINEAR_H

#include "solvers/linear.h"

extern const drape_linear_ops drape_linear_mpi_direct;    /* MUMPS */
extern const drape_linear_ops drape_linear_mpi_iterative; /* conjugate gradients with GAMG */

/* drape_ranks.inertia: the signs of the pivots of MUMPS. *known: also false if the matrix is not
 * symmetric. */
drape_status drape_mpi_inertia(drape_context *ctx, const drape_pattern *pattern, const double *values,
                               int64_t *negative, bool *known);

#endif
