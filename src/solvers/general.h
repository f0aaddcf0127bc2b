/*
 * general.h: a solver of matrices that are not positive definite, symmetric or not, in given fronts: the
 * matrix is scaled, factored, and the backward error of each solution is bounded. Its memory is taken for the
 * first such matrix, because most scenes have none.
 *
 * Pivots are chosen within a diagonal tile, so rounding errors may grow without bound. On the matrices of
 * cloth in bench/results/speed.csv they do not; where a solution misses the bound, a matrix of moderate size
 * is factored by KLU as well.
 */
#ifndef DRAPE_SOLVERS_GENERAL_H
#define DRAPE_SOLVERS_GENERAL_H

#include "solvers/front_factors.h"
#include "solvers/refine.h"

typedef struct drape_general {
    drape_arena arena; /* NULL arrays below: nothing was taken yet */
    drape_fronts *fronts;
    drape_front_factors lu;
    drape_refine refine;
    double *scaled, *row, *column; /* (nonzeros), (n), (n): see general.c */
    double *b, *x;                 /* (n) of the scaled matrix */
    bool factored;                 /* by `lu`; otherwise by KLU */
    drape_arena klu_arena;
    void *klu;         /* NULL: it was not needed for this matrix */
    int64_t klu_count; /* matrices that needed it */
} drape_general;

/* The arena must stay at its address. Takes no memory. */
drape_general drape_general_of(drape_arena *arena, drape_fronts *fronts);
void drape_general_destroy(drape_general *g);

/* DRAPE_RETRY_LINEAR if the matrix is singular to working precision, or so nearly that a solution misses the
 * bound; DRAPE_E_STOPPED; DRAPE_E_MEMORY, after which it may be called again. */
drape_status drape_general_factor(drape_general *g, const double *values, bool symmetric);

/* DRAPE_RETRY_LINEAR if the backward error misses the bound of refine.h. */
drape_status drape_general_solve(drape_general *g, const double *b, double *x);

/* The number of negative eigenvalues of a symmetric matrix. *known: false if it is singular to working
 * precision, or the factors are not accurate enough to tell. Errors: DRAPE_E_MEMORY, DRAPE_E_STOPPED. */
drape_status drape_general_inertia(drape_general *g, const double *values, int64_t *negative, bool *known);

#endif
