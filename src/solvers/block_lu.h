/*
 * block_lu.h: A = L U front by front, for a matrix that is not positive definite: symmetric or not. The
 * diagonal blocks of U are tiles, each factored with row interchanges; L has unit blocks. If A is symmetric,
 * U' = L D with the diagonal blocks D, so that only the lower half is updated: half of the work.
 *
 * Rows are interchanged within a tile only, so storage is known before. A tile whose pivot is too small is
 * shifted: a multiple of the unit matrix is added to it (a static perturbation, as in Schenk & Gaertner 2006,
 * On fast factorization pivoting methods for sparse symmetric indefinite systems). The factors are then those
 * of a nearby matrix; refine.h makes up for the difference. The matrix must be scaled: its entries are at
 * most about 1.
 */
#ifndef DRAPE_SOLVERS_BLOCK_LU_H
#define DRAPE_SOLVERS_BLOCK_LU_H

#include "solvers/fronts.h"

typedef struct drape_block_lu {
    drape_fronts *s;   /* with the upper half: its updates only if a matrix is not symmetric */
    double *inverse;   /* (n) of the pivots */
    int32_t *pivot;    /* (n) row interchanges, within the tile */
    int32_t *negative; /* (fronts) negative eigenvalues of the diagonal tiles; NULL: not counted */
    bool symmetric;    /* the matrix that is being factored */
    double shift;      /* a tile with a smaller pivot is shifted by at least this; 0: it has no factors */
} drape_block_lu;

/* Takes the memory of the factors, but not that of the upper half. Errors: DRAPE_E_MEMORY. */
drape_status drape_block_lu_create(drape_arena *arena, drape_fronts *s, drape_block_lu *f);

/* Factors s->values. DRAPE_RETRY_LINEAR if there are no factors: a pivot is zero up to rounding errors,
 * DRAPE_E_STOPPED if it was cancelled. */
drape_status drape_block_lu_factor(drape_block_lu *f);
double drape_block_lu_smallest_pivot(const drape_block_lu *f);
void drape_block_lu_solve(void *factors, const double *b, double *x); /* a drape_preconditioner */

#endif
