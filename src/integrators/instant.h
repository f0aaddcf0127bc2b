/*
 * instant.h: shared by integrators that evaluate forces at instants of a step, within a span of time in which
 * no pin and no collider has a kink: how pins move there, and the power of what drives cloth and what it
 * dissipates. Not thread-safe, as the system is.
 */
#ifndef DRAPE_INTEGRATORS_INSTANT_H
#define DRAPE_INTEGRATORS_INSTANT_H

#include "integrators/integrator.h"

/* Places pins at time t, with the velocity that they have there, in x and v (nodes). span [s]: see above. */
void drape_instant_place_pins(const drape_motion *motion, double t, const double span[2], double *x,
                              double *v);

/* After forces g (nodes) at x were not finite: reports the node where they are not, or the element that
 * collapsed there, with its reason. scratch: free DOFs. */
void drape_instant_diagnose(drape_system *system, const double *x, const double *internal, const double *g,
                            double *scratch, drape_step_info *info);

/* drape_system_dissipation with the work on colliders. */
double drape_instant_dissipation(drape_system *system, const drape_point *point, double time, double *g);

/* Adds the work over a time [s] of what moves pins, supports and colliders against the forces g (nodes) at a
 * point with its span, where they were the last that were evaluated, to work, at DRAPE_BY_PINS and
 * DRAPE_BY_COLLIDERS. Of a rank's part of the model, that part of it. */
void drape_instant_driving(const drape_system *system, const drape_point *point, const double *g, double time,
                           double *work);

#endif
