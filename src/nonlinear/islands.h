/*
 * islands.h: the parts of the cloth that the equation of a step couples: the connected components of the
 * pattern of J. Two cloths that are neither sewn together nor in contact, and have not been since contact
 * last extended the pattern, are two islands. The stopping rules judge every island by itself, and without
 * contact so does the line search.
 */
#ifndef DRAPE_NONLINEAR_ISLANDS_H
#define DRAPE_NONLINEAR_ISLANDS_H

#include "sparse/pattern.h"

typedef struct drape_islands {
    int32_t count;
    int32_t *of;    /* (free nodes) the island of each */
    int32_t *found; /* the same, while they are searched for */
} drape_islands;

/* One island of n free nodes. Errors: DRAPE_E_MEMORY. */
drape_status drape_islands_init(drape_arena *arena, size_t n, drape_islands *islands);

/* Finds those of a pattern, numbered by their first nodes, and returns whether they are others than before. A
 * model that ranks share is one island. */
bool drape_islands_find(drape_islands *islands, const drape_pattern *pattern);

#endif
