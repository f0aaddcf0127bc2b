/* inertia.h: the number of negative eigenvalues of a symmetric matrix, which is 0 for a stable
 * equilibrium. */
#ifndef DRAPE_SOLVERS_INERTIA_H
#define DRAPE_SOLVERS_INERTIA_H

#include "sparse/pattern.h"

/* By Sylvester's law of inertia, A = L D L' has as many negative eigenvalues as D has negative entries.
 * *known: false if a pivot is zero, where the factorisation stops. Takes and frees its own memory. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_inertia(drape_context *ctx, const drape_pattern *pattern, const double *values,
                           int64_t *negative, bool *known);

#endif
