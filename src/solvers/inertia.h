/* inertia.h: the number of negative eigenvalues of a symmetric matrix, which is 0 for a stable
 * equilibrium. */
#ifndef DRAPE_SOLVERS_INERTIA_H
#define DRAPE_SOLVERS_INERTIA_H

#include "sparse/pattern.h"

#include <stdatomic.h>

/* By Sylvester's law of inertia, A = L D L' has as many negative eigenvalues as D has. *known: false if
 * the matrix, which ranks may share, is not finite, singular to working precision, or the factors are not
 * accurate enough to tell. cancel: as in drape_linear_ops.watch, or NULL. Takes and frees its own memory.
 * Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER, DRAPE_E_STOPPED. */
drape_status drape_inertia(drape_context *ctx, const drape_pattern *pattern, const double *values,
                           const atomic_bool *const *cancel, int64_t *negative, bool *known);

#endif
