/* host.h: what functions for hosts have in common. */
#ifndef DRAPE_HOST_HOST_H
#define DRAPE_HOST_HOST_H

#include "sim/sim.h"

/* Errors: DRAPE_E_ARGUMENT: there is no such collider. */
drape_status drape_host_check_collider(const drape_sim *sim, const char *function, int32_t collider);

/* Where the pivot of a collider is. */
void drape_host_pivot(const drape_sim *sim, int32_t collider, double pivot[3]);

#endif
