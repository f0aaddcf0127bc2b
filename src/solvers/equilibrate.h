/* equilibrate.h: scales the rows and columns of a matrix so that the largest magnitude of each is about 1
 * (Ruiz 2001, A scaling algorithm to equilibrate both rows and columns norms in matrices). All factors are
 * powers of 2, so nothing is rounded. */
#ifndef DRAPE_SOLVERS_EQUILIBRATE_H
#define DRAPE_SOLVERS_EQUILIBRATE_H

#include "sparse/pattern.h"

/* scaled (nonzeros) = R A C; row and column (n) are the diagonals of R and C, equal if the matrix is
 * symmetric. work (4 n) is workspace. False if a row or a column is zero: the matrix is singular. */
bool drape_equilibrate(const drape_pattern *p, const double *values, bool symmetric, double *row,
                       double *column, double *scaled, double *work);

#endif
