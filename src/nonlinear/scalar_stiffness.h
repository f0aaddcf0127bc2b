/*
 * scalar_stiffness.h: a constant matrix with one scalar for each pair of nodes, which approximates the
 * Hessian of strain measures for all three coordinates alike: the trace of each 3 x 3 block of the
 * measures' Hessian at rest, k dq dq'. For a hinge it is the stencil on the flat sheet. Since (tr B)^2 <= 3
 * |B|^2, it bounds the Hessian of one measure up to a factor of 3, and exactly if all gradients of the
 * measure are parallel, as those of a hinge are.
 *
 * It stands for a term only if the gradients of its measures at each node are parallel at rest, as for
 * bending of cloth whose rest shape is flat or nearly so. For any other term it would resist rotations: that
 * of stretching in a triangle resists motion across the sheet, too, with thousands of times the sheet's
 * inertia, and cloth hardly falls.
 */
#ifndef DRAPE_NONLINEAR_SCALAR_STIFFNESS_H
#define DRAPE_NONLINEAR_SCALAR_STIFFNESS_H

#include "assemble/system.h"

/* Row by row: the entries of row i are start[i] ... start[i + 1] - 1. */
typedef struct drape_scalar_stiffness {
    const drape_model *model;
    int32_t n;                          /* free nodes */
    int32_t *start, *column, *diagonal; /* (n + 1), (entries), (n) */
    double *elastic, *damping;          /* damping NULL: there is none */
    double *sum;                        /* m_w M + elastic + w damping */
    double weight, mass_weight;         /* w and m_w of the sum; 0: not computed yet */
} drape_scalar_stiffness;

/* covers (term_count): the terms that it can stand for. Measures that depend on the distance of two nodes
 * are not among them. Errors: DRAPE_E_MEMORY. */
drape_status drape_scalar_stiffness_covers(drape_system *system, bool *covers);

/* of (term_count): the terms that it stands for. Errors: DRAPE_E_MEMORY. */
drape_status drape_scalar_stiffness_build(drape_arena *arena, drape_system *system, const bool *of,
                                          drape_scalar_stiffness *out);

/* Computes the sum for these weights. */
void drape_scalar_stiffness_weigh(drape_scalar_stiffness *scalar, double weight, double mass_weight);

#endif
