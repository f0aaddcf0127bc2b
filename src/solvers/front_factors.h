/*
 * front_factors.h: factors of a matrix, front by front:
 *     A = L L'   Cholesky, of a symmetric positive definite matrix, in the lower half of the panels
 *     A = L U    of any other one; if A is symmetric, U' = L D with the diagonal blocks D, so that only the
 *                lower half is updated: half of the work
 * The diagonal blocks of U are tiles, each factored with row interchanges; L has unit blocks.
 *
 * Rows are interchanged within a tile only, so storage is known before. A tile whose pivot is too small is
 * shifted: a multiple of the unit matrix is added to it (a static perturbation, as in Schenk & Gaertner 2006,
 * On fast factorization pivoting methods for sparse symmetric indefinite systems). The factors are then those
 * of a nearby matrix; refine.h makes up for the difference. A matrix for L U must be scaled: its entries are
 * at most about 1.
 */
#ifndef DRAPE_SOLVERS_FRONT_FACTORS_H
#define DRAPE_SOLVERS_FRONT_FACTORS_H

#include "solvers/fronts.h"

typedef struct drape_front_factors {
    drape_fronts *s;   /* for L U with the upper half: its updates only if a matrix is not symmetric */
    double *inverse;   /* (n) of the pivots, or of the diagonal of L */
    int32_t *pivot;    /* (n) row interchanges, within the tile; NULL: these are Cholesky factors */
    int32_t *negative; /* (fronts) negative eigenvalues of the diagonal tiles of L U; NULL: not counted */
    bool symmetric;    /* the matrix that L U is of */
    double shift; /* a tile of L U with a smaller pivot is shifted by at least this; 0: it has no factors */
} drape_front_factors;

/* Takes the memory for one of both, but not that of the upper half. Errors: DRAPE_E_MEMORY. */
drape_status drape_front_factors_create(drape_arena *arena, drape_fronts *s, bool cholesky,
                                        drape_front_factors *f);

/* Factors s->values. DRAPE_RETRY_LINEAR if there are no factors: the matrix is not positive definite or, for
 * L U, a pivot is zero up to rounding errors. DRAPE_E_STOPPED if it was cancelled. */
drape_status drape_front_factors_make(drape_front_factors *f);

/* The smallest and the largest magnitude in `inverse`. */
void drape_front_factors_range(const drape_front_factors *f, double *low, double *high);

/* x = A^-1 b, both in the pattern's order; they may be the same. factors: a drape_front_factors; this is a
 * drape_preconditioner. */
void drape_front_factors_solve(void *factors, const double *b, double *x);

#endif
