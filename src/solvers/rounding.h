/* rounding.h: what rounding leaves of the digits of a solution. */
#ifndef DRAPE_SOLVERS_ROUNDING_H
#define DRAPE_SOLVERS_ROUNDING_H

#include <float.h>

/* The ratio of the smallest pivot to the largest, or the reciprocal of a condition number, below which a
 * matrix is singular to working precision: a pivot is the difference of some numbers, each with half an
 * epsilon. */
#define DRAPE_SINGULAR (4 * DBL_EPSILON)

/* The relative residual that rounding leaves: of a sum of a hundred terms of size 1, as in a row of the
 * matrix of a cloth, each with half an epsilon. */
#define DRAPE_EXACT (50 * DBL_EPSILON)

#endif
