/* place.h: cloth and colliders placed elsewhere by a rigid motion. */
#ifndef DRAPE_HOST_PLACE_H
#define DRAPE_HOST_PLACE_H

#include "sim/sim.h"

/* Indices of cloths or colliders; a count of -1 stands for all of them. */
typedef struct drape_place_list {
    const int32_t *items;
    int32_t count;
} drape_place_list;

/* Whether these parts may be placed so. Errors: DRAPE_E_ARGUMENT. */
drape_status drape_sim_check_place(const drape_sim *sim, const drape_place_list *cloths,
                                   const drape_place_list *colliders, const drape_placement *by);

/* drape_sim_place of these parts, which exist. Errors: DRAPE_E_ARGUMENT, after which nothing has changed. */
drape_status drape_sim_place_parts(drape_sim *sim, const drape_place_list *cloths,
                                   const drape_place_list *colliders, const drape_placement *by, bool stop);

#endif
