/*
 * approx_jacobian.h: an approximation of the Jacobian of a step equation that costs a fraction of it, for a
 * few inexact Newton iterations (newton.h):
 *     A = m_w M + C (x) I + sum over pairs [H -H; -H H] + R
 * with
 *     H  3 x 3 blocks of the measures that depend on the distance of two nodes: the positive semidefinite
 *        part, computed at each point.
 *     C  all other measures, above all bending: one scalar for each pair of nodes, constant
 *        (scalar_stiffness.h). Liu, Bouaziz & Kavan 2017 use such a matrix for all terms. For stretching it
 *        would resist motion across the sheet, too, with thousands of times the sheet's inertia, which ten
 *        iterations do not correct.
 *     R  the remainder: energies and dissipation without a strain measure, and contact, without
 *        approximation except for friction, for which nonsymmetric.h corrects solutions.
 *
 * A x = b is solved by conjugate gradients with an additive preconditioner: the inverse of the diagonal
 * blocks plus the inverse of the matrix on a coarse space (solvers/prolong.h), which represents the motion
 * of the sheet as a whole. It takes 3 to 6 iterations for each digit at any size.
 */
#ifndef DRAPE_NONLINEAR_APPROX_JACOBIAN_H
#define DRAPE_NONLINEAR_APPROX_JACOBIAN_H

#include "nonlinear/matrix.h"

typedef struct drape_approx_jacobian drape_approx_jacobian;

extern const drape_matrix_ops drape_approx_jacobian_ops;

/* For a system with at least one free node. The arena must outlive it. Errors: DRAPE_E_MEMORY,
 * DRAPE_E_SOLVER; even then it must be destroyed. */
drape_status drape_approx_jacobian_create(drape_arena *arena, drape_system *system,
                                          drape_approx_jacobian **out);

/* y = A x, for tests. */
void drape_approx_jacobian_multiply(const drape_approx_jacobian *jacobian, const double *x, double *y);

#endif
