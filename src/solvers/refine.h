/*
 * refine.h: solves A x = b by the factors of a nearby matrix M, to rounding errors or to a tolerance. The
 * correction of x is found by GMRES preconditioned by M (Saad 1993, A flexible inner-outer preconditioned
 * GMRES algorithm), of which one iteration is a step of iterative refinement with the best length. If M
 * differs from A by a matrix of rank k, k + 1 iterations are enough.
 */
#ifndef DRAPE_SOLVERS_REFINE_H
#define DRAPE_SOLVERS_REFINE_H

#include "sparse/pattern.h"

/* x = M^-1 b. */
typedef void drape_preconditioner(void *factors, const double *b, double *x);

/* y += factor A x */
typedef void drape_add_product(const void *owner, double factor, const double *x, double *y);

typedef struct drape_refine {
    int64_t n;                    /* of vectors here */
    const drape_pattern *pattern; /* NULL: the matrix is only known by its products */
    double *input, *output;       /* (pattern->n) with copies of other ranks; NULL: there are none */
    double *residual;             /* (n) */
    double *basis, *correction;   /* (vectors + 1, n) and (vectors, n) */
    double first_error, error;    /* of the last solve, before and after refinement: see below */
    int64_t iterations;           /* of all solves together */
} drape_refine;

/* Errors: DRAPE_E_MEMORY. */
drape_status drape_refine_create(drape_arena *arena, const drape_pattern *pattern, drape_refine *w);

/* The same for n unknowns and drape_refine_reduce_product only. */
drape_status drape_refine_init(drape_arena *arena, int64_t n, drape_refine *w);

/* x = A^-1 b for a matrix scaled so that its entries are at most about 1. `error` becomes the backward error
 * |b - A x| / (|x| + |b|) in the maximum norm. DRAPE_RETRY_LINEAR if it misses the bound of 1e-13. */
drape_status drape_refine_solve(drape_refine *w, drape_preconditioner *apply, void *factors,
                                const double *values, const double *b, double *x);

/* The same until the residual |b - A x| is at most `tolerance` times |b| in the Euclidean norm, or for one
 * cycle of GMRES, which never makes it larger than that of x = M^-1 b. A need not be scaled. */
void drape_refine_reduce(drape_refine *w, drape_preconditioner *apply, void *factors, const double *values,
                         const double *b, double tolerance, double *x);

/* The same with a function of `owner` for the products. */
void drape_refine_reduce_product(drape_refine *w, drape_preconditioner *apply, void *factors,
                                 drape_add_product *product, const void *owner, const double *b,
                                 double tolerance, double *x);

#endif
