/*
 * eigen.h: the largest eigenvalues of an operator that is symmetric in an inner product, by ARPACK-NG:
 * Lanczos' method with implicit restarts (Lehoucq, Sorensen & Yang 1998, ARPACK users' guide). ARPACK asks
 * its caller for each product with the operator, so that the factors may be our own.
 */
#ifndef DRAPE_LAB_EIGEN_H
#define DRAPE_LAB_EIGEN_H

#include "base/arena.h"

/* OP, with OP' B = B OP for a positive definite B. The functions return DRAPE_OK or a failure, which ends the
 * search. */
typedef struct lab_operator {
    int64_t n;
    void *user;
    drape_status (*apply)(void *user, const double *x, double *y); /* y = OP x */
    void (*inner)(void *user, const double *x, double *y);         /* y = B x */
} lab_operator;

/* Eigenvectors (count x n) with u'B u = 1 that are known already, and their products with B. */
typedef struct lab_known {
    int32_t count;
    const double *vector, *product;
} lab_known;

/* Numbers between -1 and 1 without any symmetry that a mode might have: Knuth's linear congruential
 * sequence. */
void lab_noise(uint64_t seed, double *x, size_t count);

/* Finds the `wanted` largest eigenvalues that do not belong to known vectors, largest first: value (wanted),
 * vector (wanted x n), orthogonal to the known ones and to each other in B and with u'B u = 1. wanted <=
 * n - 1 - known->count. *found <= wanted: so many have converged; fewer are no failure. An eigenvalue of
 * multiplicity m may be found fewer than m times, and again with those that were found as known vectors. The
 * start vector is a fixed sequence of numbers. Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER, those of apply.
 * Thread-safe: ARPACK keeps variables between its calls, so that one search of the process runs at a time. */
drape_status lab_eigen(drape_context *ctx, const lab_operator *op, const lab_known *known, int32_t wanted,
                       int32_t *found, double *value, double *vector);

#endif
