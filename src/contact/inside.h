/*
 * inside.h: the pairs that began below their least gap, at the start of a run or after its state was set, and
 * have not come out yet. A pair is known by its pieces.
 */
#ifndef DRAPE_CONTACT_INSIDE_H
#define DRAPE_CONTACT_INSIDE_H

#include "base/archive.h"
#include "contact/pair.h"

/* A pair that is nearer than DRAPE_BARRIER_GENTLE activation distances. */
typedef struct drape_near_pair {
    drape_pair pair;
    double gap; /* [m] */
} drape_near_pair;

/* The pieces of a pair. */
typedef struct drape_pair_key {
    int32_t kind, collider, node[4];
} drape_pair_key;

typedef struct drape_inside_pairs {
    drape_arena *arena;
    drape_pair_key *keys; /* (count of room), ascending */
    int32_t count, room;
} drape_inside_pairs;

bool drape_inside_has(const drape_inside_pairs *inside, const drape_pair *pair);

/* Keeps those of its pairs that are among the near ones, for at the others both barriers agree, and adds
 * those that are below their least gap. Returns whether a pair was added; *status: DRAPE_E_MEMORY. */
bool drape_inside_update(drape_inside_pairs *inside, const drape_near_pair *near, int32_t count,
                         double rounding, drape_status *status);

/* Adds a pair that is not among them. They are complete again after drape_inside_sort. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_inside_add(drape_inside_pairs *inside, const drape_pair_key *key);
void drape_inside_sort(drape_inside_pairs *inside);

void drape_inside_archive(drape_inside_pairs *inside, drape_archive *a);

#endif
