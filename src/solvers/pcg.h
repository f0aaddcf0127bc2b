/*
 * pcg.h: preconditioned conjugate gradients (Hestenes & Stiefel 1952) for A x = b, A symmetric positive
 * definite, both it and the preconditioner given as functions. At a direction without positive curvature A is
 * not positive definite: the iteration ends there, with its last x.
 */
#ifndef DRAPE_SOLVERS_PCG_H
#define DRAPE_SOLVERS_PCG_H

#include "base/context.h"

typedef struct drape_pcg {
    int64_t n;
    const void *owner;
    void (*multiply)(const void *owner, const double *x, double *y);     /* y = A x */
    void (*precondition)(const void *owner, const double *r, double *z); /* z = P^-1 r */
    double *r, *z, *p, *q;                                               /* (n) workspace */
    int iterations;                                                      /* of the last solve */
    bool definite;  /* no direction of negative curvature was met */
    bool converged; /* the tolerance was reached */
} drape_pcg;

/* x from b, until the residual falls to a share `tolerance` in the norm of P^-1. The iteration starts at 0,
 * and every iterate is a direction of descent of x'Ax/2 - b'x. */
void drape_pcg_solve(drape_pcg *pcg, const double *b, double *x, double tolerance, int max_iterations);

#endif
