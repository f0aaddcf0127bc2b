/*
 * factored_jacobian.h: a positive semidefinite matrix near the Jacobian of a step equation, with its
 * factors, for fixed numbers of iterations (newton.h) where the matrix of approx_jacobian.h is too
 * far from J or too ill-conditioned:
 *     A = m_w M + C (x) I + J+
 * with
 *     C   bending of flat cloth: one scalar for each pair of nodes, constant (scalar_stiffness.h); a
 *         hundredth of the time of its Hessians
 *     J+  all other terms and contact, with the positive semidefinite parts of their elements, which
 *         converges slowly where cloth is compressed, or without, exact but for contact, where A may be
 *         indefinite
 * It is symmetric; where there is friction, drag or a load that follows the cloth, solutions are corrected
 * for what is not (nonsymmetric.h).
 *
 * C couples nodes two and three edges apart, which makes factors of A several times as expensive as those
 * of J+: for a measured fabric of 10 000 nodes nine times. So a matrix N without
 * these entries is factored: each c_ij that J+ has no block for is added to the diagonal,
 *     N = A + sum of the c_ij |x_i - x_j|^2 that are left out, as quadratic forms
 * which is exact where nodes move alike, and stiffer than A otherwise, as most of the c_ij are positive. Then
 * A x = b is solved by conjugate gradients preconditioned by N, in 2 to 5 iterations. Where the c_ij are
 * large beside the inertia, as in thick plates of a fine mesh, these take too many, and A is factored. That
 * is decided for the nominal step: a longer one takes more iterations. N may be definite where A is not: that
 * is known only if conjugate gradients meet a direction without positive curvature.
 *
 * With predicted stress (stress_predictor.h) in J+, one correction from the extrapolated guess is within a
 * hundredth of the motion of sheets that hang, at any stiffness of the membrane.
 */
#ifndef DRAPE_NONLINEAR_FACTORED_JACOBIAN_H
#define DRAPE_NONLINEAR_FACTORED_JACOBIAN_H

#include "nonlinear/matrix.h"

typedef struct drape_factored_jacobian drape_factored_jacobian;

extern const drape_matrix_ops drape_factored_jacobian_ops;

/* *better: whether the model needs this matrix for steps of dt: a term of it is neither a measure of pairs
 * nor flat bending, or is drag that couples nodes, or its membrane is so stiff that conjugate gradients need
 * many iterations, or it has so few nodes that factors cost no more. *needed: not only for the membrane, so
 * that nothing is gained without factors. Errors: DRAPE_E_MEMORY. */
drape_status drape_factored_jacobian_is_better(drape_system *system, double dt, bool *better, bool *needed);

/* For a system with at least one free node, whose pattern may then leave out what only bending couples
 * (drape_system_leave_out). dt: the nominal step. The arena must outlive it. Errors: DRAPE_E_MEMORY,
 * DRAPE_E_SOLVER; even then it must be destroyed. */
drape_status drape_factored_jacobian_create(drape_arena *arena, drape_system *system, double dt,
                                            drape_factored_jacobian **out);

/* The matrix that has factors, A or N, for tests. */
bool drape_factored_jacobian_is_lumped(const drape_factored_jacobian *jacobian);
const double *drape_factored_jacobian_values(const drape_factored_jacobian *jacobian);

#endif
