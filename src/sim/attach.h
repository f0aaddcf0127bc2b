/* attach.h: pins that colliders carry, while a sim runs. */
#ifndef DRAPE_SIM_ATTACH_H
#define DRAPE_SIM_ATTACH_H

#include "sim/sim.h"

/* The collider that carries a node; -1: none. */
int32_t drape_sim_carrier(const drape_sim *sim, int32_t node);

/* The collider that carries a node goes on to carry it, from where the node is now in the present state. */
void drape_sim_ride_on(drape_sim *sim, int32_t node);

/* Takes to a new sim the pins that colliders carry, where its model has these colliders: before
 * (collider_count), the number that each had; -1: it is new. Those that the scene attached only where the
 * new scene does, too. Errors: DRAPE_E_MEMORY. */
drape_status drape_sim_continue_rides(drape_sim *to, const drape_sim *from, const int32_t *before);

#endif
