/* linear.h: the direct solver of a matrix that ranks share (pattern->ranks), MUMPS by PETSc. It is not in the
 * table of linear solvers, as no scene names it: a run on several ranks has it in place of direct ones
 * (drape_linear_of). */
#ifndef DRAPE_MPI_LINEAR_H
#define DRAPE_MPI_LINEAR_H

#include "solvers/linear.h"

extern const drape_linear_ops drape_linear_mpi_direct;

/* drape_ranks.inertia: the signs of the pivots of MUMPS. *known: also false if the matrix is not
 * symmetric. */
drape_status drape_mpi_inertia(drape_context *ctx, const drape_pattern *pattern, const double *values,
                               int64_t *negative, bool *known);

#endif
