/*
 * residual_bound.h: how small the residual of a free node must be for a step to count as converged. Its
 * measure is the load of the node: its mass m times an acceleration a of the scene,
 *     with gravity     a = |g|
 *     without gravity  a = the least of  L/(1 s)^2,  D/(s L^3),  and the mean of |g(x, v)|/m at the start
 * with the diagonal L of the rest bounding box, the areal density s and the flexural rigidity D of a cloth: a
 * free node that is accelerated by L/(1 s)^2 moves by about the size of the scene in a second, and a sheet
 * that is pressed by D/L^3 bends by about its size. The third one counts only if it is more than rounding.
 *
 * The residual that is left in a step accelerates a loose node by F/m, an error of h^2 F/m in its position,
 * and displaces one that is held with the stiffness k by F/k. If no F is above a share e of the load, the
 * first is the share e of what gravity moves the node in the step, the second the share e of its sag, for
 * any mass, size, step and mesh.
 *
 * Without a tolerance in newtons e is DRAPE_LOAD_SHARE, but no bound is below the rounding error of the
 * forces at the start. With one, it is the bound of every node. In both cases no bound is above
 * DRAPE_MAX_LOAD_SHARE of the load: a state that ignores the load is never called converged.
 */
#ifndef DRAPE_NONLINEAR_RESIDUAL_BOUND_H
#define DRAPE_NONLINEAR_RESIDUAL_BOUND_H

#include "nonlinear/step_equation.h"

#define DRAPE_LOAD_SHARE     3e-4
#define DRAPE_MAX_LOAD_SHARE 1e-2

/* The bound on each of n components that implies a bound on their norm. */
double drape_residual_component(double bound, drape_norm norm, double n);

/* Derives the bounds for a norm from a tolerance that the scene gave [N], NAN: none. Sets the weights of
 * the equation's norms, mean bound over own bound, its max_residual, and *tolerance [N]: the bound on the
 * weighted norm. A weight of 1, which all nodes have unless the load limits a bound, leaves newtons.
 * Errors: DRAPE_E_MEMORY. */
drape_status drape_residual_bound_set(drape_step_equation *equation, drape_norm norm, double given,
                                      double *tolerance);

#endif
