/*
 * multigrid.h: a preconditioner of symmetric positive definite matrices of cloth, algebraic multigrid by
 * smoothed aggregation (Vanek, Mandel & Brezina 1996, Algebraic multigrid by smoothed aggregation for second
 * and fourth order elliptic problems). Neighbouring nodes form aggregates; a coarse matrix has six unknowns
 * for each, the rigid motions of the aggregate, which no stiff term of a cloth resists. The same is done with
 * the coarse matrix, until a dense one is left that is factored. An application is a W-cycle, accelerated by
 * Chebyshev polynomials, with one symmetric sweep of block Gauss-Seidel on each level: a symmetric positive
 * definite map, by the same operations in the same order for any number of threads.
 *
 * Where ranks share the matrix (pattern->ranks), they share the levels, too, and the functions are
 * collective. Each forms aggregates of its own nodes, and sweeps take what others have from before the sweep.
 */
#ifndef DRAPE_SOLVERS_MULTIGRID_H
#define DRAPE_SOLVERS_MULTIGRID_H

#include "sparse/pattern.h"

typedef struct drape_multigrid drape_multigrid;

/* Forms the aggregates of all levels, which depend on the pattern alone, and takes all memory. The pattern
 * must outlive it. Errors: DRAPE_E_MEMORY. */
drape_status drape_multigrid_create(drape_arena *arena, const drape_pattern *pattern, drape_multigrid **out);

/* Makes the coarse matrices of a symmetric matrix; values (pattern->nonzeros) must stay until the next call.
 * x (pattern->n): positions of the nodes [m], of which the rigid motions are made; all equal: they are
 * translations only. DRAPE_RETRY_LINEAR if a matrix is noticed not to be positive definite. */
drape_status drape_multigrid_factor(drape_multigrid *m, const double *values, const double *x);

/* z = an approximation of A^-1 r. r and z are of drape_pattern_own(pattern) numbers and differ. */
void drape_multigrid_apply(drape_multigrid *m, const double *r, double *z);

/* y = A x. */
void drape_multigrid_multiply(const drape_multigrid *m, const double *x, double *y);

/* Number of levels, 1 if the matrix itself is factored. */
int drape_multigrid_levels(const drape_multigrid *m);

#endif
