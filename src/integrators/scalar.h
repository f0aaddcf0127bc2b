/*
 * scalar.h: a matrix of one scalar a pair of nodes that stands for the Hessian of strain measures, for all three
 * coordinates alike. It is the trace of each 3 x 3 block of the measures' Hessian at rest, k dq dq', constant from there
 * on: of an edge or a spring the Laplacian with its spring constant, of a hinge its stencil on the flat sheet. Since
 * (tr B)^2 <= 3 |B|^2 it bounds the Hessian of one measure up to a factor of 3, and without one where all gradients of
 * the measure are parallel, as those of a hinge and of an edge are.
 */
#ifndef DRAPE_INTEGRATORS_SCALAR_H
#define DRAPE_INTEGRATORS_SCALAR_H

#include "assemble/system.h"

/* In rows: the entries of row i are start[i] ... start[i + 1] - 1. */
typedef struct drape_scalar {
    const drape_model *model;
    int32_t n;                          /* free nodes */
    int32_t *start, *column, *diagonal; /* (n + 1), (entries), (n) */
    double *elastic, *damping;          /* damping NULL: there is none */
    double *sum;                        /* m_w M + elastic + w damping */
    double weight, mass_weight;         /* that sum is for; 0: none yet */
} drape_scalar;

/* pairs: with measures of two nodes that depend on their distance, or only the others. Errors: DRAPE_E_MEMORY; then
 * drape_scalar_free frees what was taken. */
drape_status drape_scalar_build(drape_context *ctx, drape_system *system, bool pairs, drape_scalar *out);
void drape_scalar_free(drape_context *ctx, drape_scalar *scalar);

/* The sum for these weights; false where it is that already. */
bool drape_scalar_weigh(drape_scalar *scalar, double weight, double mass_weight);

size_t drape_scalar_bytes(const drape_scalar *scalar);

#endif
