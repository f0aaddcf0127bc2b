/*
 * approx_jacobian.h: a matrix near the Jacobian of a step equation that costs a fraction of it, for a few
 * inexact Newton iterations (inexact_newton.h):
 *     A = m_w M + C (x) I + sum over pairs [H -H; -H H] + R
 * H: 3 x 3 blocks of the measures that depend on the distance of two nodes, positive semidefinite part,
 * evaluated anew
 *    at each update.
 * C: all other measures, bending above all: one scalar a pair of nodes, constant (scalar_stiffness.h). Liu,
 * Bouaziz &
 *    Kavan 2017 take such a matrix for all terms; of stretching it holds the sheet back across itself, by
 * thousands of
 *    times its inertia, and ten iterations do not undo that.
 * R: the remainder: energies and dissipation without a strain measure, and contact, as they are.
 *
 * A x = b is solved by conjugate gradients with an additive preconditioner: the inverse of the diagonal
 * blocks, and the inverse of the matrix on a coarse space (solvers/prolong.h), which carries what the whole
 * sheet does together. It takes 3 to 6 iterations a digit at any size.
 */
#ifndef DRAPE_NONLINEAR_APPROX_JACOBIAN_H
#define DRAPE_NONLINEAR_APPROX_JACOBIAN_H

#include "nonlinear/report.h"

typedef struct drape_approx_jacobian drape_approx_jacobian;

/* For a system with at least one free node. spacing: edges between the centres of the coarse functions; 0: by
 * the number of nodes. The arena outlives it. Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER; then, too,
 * drape_approx_jacobian_destroy frees what is not the arena's. */
drape_status drape_approx_jacobian_create(drape_arena *arena, drape_system *system, int spacing,
                                          drape_approx_jacobian **out);
void drape_approx_jacobian_destroy(drape_approx_jacobian **jacobian);

/* The matrix at a point; work is counted. > 0: it has no factors on the coarse space. Errors: DRAPE_E_MEMORY,
 * where contact couples what it did not before. */
drape_status drape_approx_jacobian_update(drape_approx_jacobian *jacobian, const drape_point *point,
                                          double mass_weight, drape_work *work);

/* x = A^-1 b (free DOFs) until the residual falls to a share `tolerance`, in the norm of the preconditioner.
 * Returns the iterations. */
int drape_approx_jacobian_solve(drape_approx_jacobian *jacobian, const double *b, double *x, double tolerance,
                                int max_iterations);

/* y = A x, for tests. */
void drape_approx_jacobian_multiply(const drape_approx_jacobian *jacobian, const double *x, double *y);

/* What it keeps from update to update. */
void drape_approx_jacobian_archive(drape_approx_jacobian *jacobian, drape_archive *a);

int32_t drape_approx_jacobian_coarse_nodes(const drape_approx_jacobian *jacobian);
size_t drape_approx_jacobian_bytes(const drape_approx_jacobian *jacobian); /* outside of its arena */

#endif
