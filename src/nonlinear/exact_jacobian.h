/*
 * exact_jacobian.h: the Jacobian of a step equation with its factors, by one of the linear solvers.
 *
 * J is unsymmetric with friction, which changes with the normal force, and with drag and loads that follow
 * the cloth. Then the matrix that is factored is symmetric, the symmetric part of J with the normal forces
 * held fixed, and solutions are those of J to a part of the right-hand side, by a few iterations of GMRES
 * with these factors (solvers/refine.h). A factorisation of J would cost two to four times as much, and could
 * not tell whether J is indefinite: ten flags drawn at random take 0.27 to 1.03 of its CPU time. With
 * positive parts there is no coupling of friction with normal forces.
 */
#ifndef DRAPE_NONLINEAR_EXACT_JACOBIAN_H
#define DRAPE_NONLINEAR_EXACT_JACOBIAN_H

#include "nonlinear/matrix.h"

typedef struct drape_exact_jacobian drape_exact_jacobian;

extern const drape_matrix_ops drape_exact_jacobian_ops;

/* linear: a linear solver; symmetrizes: an unsymmetric J is solved with as said above, else by its own
 * factors. The arena must outlive it. Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER; even then it must be
 * destroyed. */
drape_status drape_exact_jacobian_create(drape_arena *arena, drape_system *system,
                                         const drape_linear_ops *linear, bool symmetrizes,
                                         drape_exact_jacobian **out);

/* J itself at a point, valid until the next use; the factors are lost. Errors: DRAPE_E_MEMORY. */
drape_status drape_exact_jacobian_at(drape_exact_jacobian *jacobian, const drape_point *point,
                                     double mass_weight, const drape_pattern **pattern,
                                     const double **values);

#endif
