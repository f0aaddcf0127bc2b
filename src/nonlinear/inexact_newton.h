/*
 * inexact_newton.h: a fixed number of inexact Newton iterations on a step equation (Dembo, Eisenstat &
 * Steihaug 1982), for steps of bounded cost. In contrast to newton.h
 *     - the matrix is only near the Jacobian, and positive: that of approx_jacobian.h, which costs less
 *       than a residual and is never factored as a whole, where conjugate gradients solve with it to a
 *       relative tolerance; or that of factored_jacobian.h, where the first would be too far off,
 *     - a correction is shortened for contact only at the nodes that would meet something.
 * Some more iterations are made while the estimated error is above its bound, or
 *     with factors, without contact   the energy that is left would move nodes by a hundredth of the scene
 *     otherwise                       the residual is not below that of the guess, with contact below a tenth
 *                                     of it, or with factors would alone move nodes by edges
 * If then neither the residual nor the estimated error is below that of the guess, the step is refused. So no
 * step is accepted unchecked.
 *
 * The error, the distance to the solution, is estimated from one more correction p, with the last matrix A,
 * which is not added, except in contact:
 *     e = (|p| / m)^(1 - c) (|M^-1 F| / m_w)^c,  m = p . (F(d + p) - F(d)) / p . A p
 * m is the share that the mean Jacobian along p has of A, so |p| / m is as far as the error along p reaches.
 * What is left of the error is mostly where A is much stiffer than J, as positive semidefinite parts of
 * compressed cloth are, and p is too short; the second factor is the error if nothing but inertia resisted
 * it, so it is too long. The power c is fitted to 1 600 steps of cloth that hangs, swings, flies and
 * falls on things. With conjugate gradients p is that of a few of their iterations, and m is 1.
 *
 * That holds near the solution. A stiff sheet that is jerked or buckles comes there by many corrections of
 * nearly the same length, shortened by the line search, or passes a saddle, where they become short and then
 * long again. With factors and without contact, where one was shortened the error is at least what a
 * geometric series of corrections has left, by their measured contraction; where the exact matrix is still
 * indefinite, nine times the last one.
 *
 * Where cloth is not in contact, what the first correction of a step leaves changes little from one step to
 * the next. It is measured, by the second correction or by the estimate, and judges the three steps that
 * follow, which need no other estimate. Factors are not kept from one step to the next: in moving cloth one
 * correction with those of the step before is 0.3 to 3 bounds off, and conjugate gradients with them take 13
 * to 25 iterations, as long as new factors.
 */
#ifndef DRAPE_NONLINEAR_INEXACT_NEWTON_H
#define DRAPE_NONLINEAR_INEXACT_NEWTON_H

#include "nonlinear/step_equation.h"

typedef struct drape_inexact_newton drape_inexact_newton;

typedef struct drape_inexact_settings {
    int iterations, rescue_iterations; /* rescue: maximum number of further iterations, until the residual
                                          has fallen and the estimated error is within its bound */
    double tolerance;                  /* [N] largest component of F below which iterations end */
    double error;    /* [m] bound on the estimated RMS distance of the nodes to the solution */
    double deadline; /* [s of drape_clock_seconds] by which iterations end that only reduce this error,
                        and after which no other is begun beyond `iterations`, and, in contact, some more
                        that keep cloth from being thrown about */
    double linear_tolerance; /* relative residual that conjugate gradients leave in each correction */
    int max_linear_iterations;
    bool cheap;        /* where the solver has both matrices, corrections are made without factors */
    bool follows;      /* the step begins with the result of the last solve */
    double pins_ahead; /* [m] largest coordinate by which moved pins are ahead of where the guess has them */
} drape_inexact_settings;

/* auto: whichever factored_jacobian.h says; with contact, where both serve, both: contact needs most of its
 * iterations for the active set, which costs less without factors. */
typedef enum { DRAPE_INEXACT_AUTO, DRAPE_INEXACT_APPROXIMATE, DRAPE_INEXACT_FACTORED } drape_inexact_matrix;

/* dt: the nominal step, by which auto chooses. coarse_spacing: see approx_jacobian.h. The equation and the
 * arena must outlive it. Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER; even then drape_inexact_newton_destroy must
 * be called, to free what the linear solver took. */
drape_status drape_inexact_newton_create(drape_arena *arena, drape_step_equation *equation,
                                         drape_inexact_matrix matrix, double dt, int coarse_spacing,
                                         drape_inexact_newton **out);
void drape_inexact_newton_destroy(drape_inexact_newton **newton);

/* Iterates from the guess d (free DOFs), and leaves the result in d. DRAPE_OK: the residual there has
 * fallen as said above, or is within the tolerance; the equation was evaluated last at d. The
 * residual is reported without a tolerance. */
drape_status drape_inexact_newton_solve(drape_inexact_newton *newton, const drape_inexact_settings *settings,
                                        double *d, drape_solve_report *report);

/* Archives what is kept between solves, and the equation's work. */
void drape_inexact_newton_archive(drape_inexact_newton *newton, drape_archive *a);

size_t drape_inexact_newton_bytes(const drape_inexact_newton *newton); /* outside of its arena */

#endif
