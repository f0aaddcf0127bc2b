/* dense.h: the state between the two states of a step. */
#ifndef DRAPE_SIM_DENSE_H
#define DRAPE_SIM_DENSE_H

#include "sim/sim.h"

/* Writes positions and velocities (node_count x 3 each) at a time within the last step, from the one state to
 * the other: by the integrator's own dense output or, if it has none, by the cubic Hermite polynomial of both
 * states. Pins are where their motion has them at that time. */
void drape_sim_dense_positions(drape_sim *sim, const drape_state *from, const drape_state *to, double t,
                               double *x);
void drape_sim_dense_velocities(drape_sim *sim, const drape_state *from, const drape_state *to, double t,
                                double *v);

#endif
