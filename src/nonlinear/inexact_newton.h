/*
 * inexact_newton.h: a fixed number of inexact Newton iterations on a step equation (Dembo, Eisenstat &
 * Steihaug 1982), for steps that must not take long. Compared with newton.h
 *   - the matrix is near the Jacobian (approx_jacobian.h), and costs less than a residual,
 *   - conjugate gradients find each correction, to a share of its residual,
 *   - there are no factors of the whole matrix: memory and time grow with the number of nodes.
 * Where the residual has not fallen below that of the guess there are more iterations, and then the step is
 * refused: no step is accepted unchecked.
 */
#ifndef DRAPE_NONLINEAR_INEXACT_NEWTON_H
#define DRAPE_NONLINEAR_INEXACT_NEWTON_H

#include "nonlinear/step_equation.h"

typedef struct drape_inexact_newton drape_inexact_newton;

typedef struct drape_inexact_settings {
    int iterations, rescue_iterations; /* rescue: at most as many more until the residual has fallen */
    double tolerance;                  /* [N] of the largest component: no iteration is made below it */
    double linear_tolerance; /* share of the residual that conjugate gradients leave in each correction */
    int max_linear_iterations;
} drape_inexact_settings;

/* coarse_spacing: see approx_jacobian.h. Both equation and arena outlive it. Errors: DRAPE_E_MEMORY,
 * DRAPE_E_SOLVER; then, too, drape_inexact_newton_destroy frees what the linear solver took. */
drape_status drape_inexact_newton_create(drape_arena *arena, drape_step_equation *equation,
                                         int coarse_spacing, drape_inexact_newton **out);
void drape_inexact_newton_destroy(drape_inexact_newton **newton);

/* Goes from the guess d (free DOFs) to where the iterations end. DRAPE_OK: the residual there has fallen
 * below that of the guess, or is within the tolerance; the equation was evaluated last at d. The residual is
 * reported without a tolerance. */
drape_status drape_inexact_newton_solve(drape_inexact_newton *newton, const drape_inexact_settings *settings,
                                        double *d, drape_solve_report *report);

/* What it keeps from solve to solve, and the equation's work. */
void drape_inexact_newton_archive(drape_inexact_newton *newton, drape_archive *a);

size_t drape_inexact_newton_bytes(const drape_inexact_newton *newton); /* outside of its arena */

#endif
