/* rides.h: pins that colliders carry, while a sim runs and when it goes on with another model. */
#ifndef DRAPE_SIM_RIDES_H
#define DRAPE_SIM_RIDES_H

#include "sim/sim.h"

/* From now on the collider carries the pin from where it is in the present state; triangle -1: as a whole.
 * given: by the host, not by the scene. */
void drape_sim_ride(const drape_sim *sim, int32_t node, int32_t collider, int32_t triangle, bool given);

/* *out: the triangles (count) of a deforming collider that are nearest to these nodes, to be freed by the
 * caller. Errors: DRAPE_E_MEMORY. */
drape_status drape_sim_ride_triangles(const drape_sim *sim, int32_t collider, int32_t count,
                                      const int32_t *nodes, int32_t **out);

/* The collider that carries a node; -1: none. */
int32_t drape_sim_carrier(const drape_sim *sim, int32_t node);

/* The collider that carries a node goes on to carry it, from where the node is now in the present state. */
void drape_sim_ride_on(drape_sim *sim, int32_t node);

/* Takes to a new sim the pins that colliders carry, where its model has these colliders: before
 * (collider_count), the number that each had; -1: it is new. Those that the scene attached only where the
 * new scene does, too. Errors: DRAPE_E_MEMORY. */
drape_status drape_sim_continue_rides(drape_sim *to, const drape_sim *from, const int32_t *before);

#endif
