/*
 * pcg.h: preconditioned conjugate gradients (Hestenes & Stiefel 1952) for A x = b with A symmetric positive
 * definite; A and the preconditioner are functions. At a direction without positive curvature A is not
 * positive definite: the iteration stops there and returns the last x.
 */
#ifndef DRAPE_SOLVERS_PCG_H
#define DRAPE_SOLVERS_PCG_H

#include "base/arena.h"
#include "base/ranks.h"

typedef void drape_pcg_map(const void *owner, const double *from, double *to); /* (n) each */

typedef struct drape_pcg {
    int64_t n;
    const void *owner;
    drape_pcg_map *multiply;     /* A x */
    drape_pcg_map *precondition; /* P^-1 r */
    const drape_ranks *ranks;    /* that share vectors, of which n numbers are here; NULL: they are here */
    double *r, *z, *p, *q;       /* (n) workspace; z and q may be the same */
    double *length, *ratio; /* (max_iterations) of each iteration: how far it goes along its direction, and
                                    how much of that goes into the next one; NULL: not kept */
    int iterations;         /* of the last solve */
    bool definite;          /* no direction without positive curvature was met */
    bool converged;         /* the tolerance was reached; not tested after the last of max_iterations */
} drape_pcg;

/* Takes the workspace, which lives as long as the arena: drape_arena_status says whether there was memory. */
drape_pcg drape_pcg_of(drape_arena *arena, int64_t n, const void *owner, drape_pcg_map *multiply,
                       drape_pcg_map *precondition);

/* Solves for x (NULL: it is not wanted), starting at 0, until the norm of the residual, weighted by P^-1,
 * falls to `tolerance` times its initial value. Every iterate is a descent direction of x'Ax/2 - b'x. */
void drape_pcg_solve(drape_pcg *pcg, const double *b, double *x, double tolerance, int max_iterations);

#endif
