/* cholesky.h: A = L L' of a symmetric positive definite matrix, front by front. */
#ifndef DRAPE_SOLVERS_CHOLESKY_H
#define DRAPE_SOLVERS_CHOLESKY_H

#include "solvers/fronts.h"

/* Factors s->values; inverse (n) becomes the inverses of the diagonal of L. DRAPE_RETRY_LINEAR if the matrix
 * is not positive definite or singular to working precision, DRAPE_E_STOPPED if it was cancelled. */
drape_status drape_cholesky_factor(drape_fronts *s, double *inverse);
void drape_cholesky_solve(drape_fronts *s, double *inverse, const double *b, double *x);

#endif
