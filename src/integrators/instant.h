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

/* The power of dissipative forces at a point with its span, which are written to g (nodes), on its cloth
 * and on colliders and supports that move [W]. Of a rank's part of the model, that part of it. */
double drape_instant_dissipation(drape_system *system, const drape_point *point, double *g);

/* The power of what moves pins, supports and colliders against the forces g (nodes) at a point with its
 * span, where they were the last that were evaluated [W]. Of a rank's part of the model, that part of it. */
double drape_instant_driving(const drape_system *system, const drape_point *point, const double *g);

#endif
