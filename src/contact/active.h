/*
 * active.h: the active set: the candidates whose gap is below the activation distance, each with its
 * geometry. The closest point of an edge or face may lie on its vertex or edge, which other pairs may share:
 * such pairs are merged into one contact, with the sum of their areas.
 */
#ifndef DRAPE_CONTACT_ACTIVE_H
#define DRAPE_CONTACT_ACTIVE_H

#include "base/archive.h"
#include "contact/candidates.h"
#include "contact/exempt.h"

/* The pairs that began below their least gap, at the start of a run or after its state was set, and have not
 * come out yet. A pair is known by its pieces. */

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
    drape_pair_key *keys; /* (count of capacity), ascending */
    int32_t count, capacity;
} drape_inside_pairs;

/* Keeps those of its pairs that are among the near ones, for at the others both barriers agree, and adds
 * those that are below their least gap. Returns whether a pair was added; *status: DRAPE_E_MEMORY. */
bool drape_inside_update(drape_inside_pairs *inside, const drape_near_pair *near, int32_t count,
                         double rounding, drape_status *status);

/* Adds a pair that is not among them. They are complete again after drape_inside_sort. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_inside_add(drape_inside_pairs *inside, const drape_pair_key *key);
void drape_inside_sort(drape_inside_pairs *inside);

void drape_inside_archive(drape_inside_pairs *inside, drape_archive *a);

typedef struct drape_active_contact {
    drape_pair pair; /* its nodes are the points of the gap; -1 for points that do not exist */
    drape_gap gap;
    bool gentle;   /* its pairs began below the least gap: see barrier.h */
    double exempt; /* factor of the pressure of exempt pairs (exempt.h); 0: they are held */
} drape_active_contact;

typedef struct drape_active_set {
    drape_arena *arena;
    drape_active_contact *contacts; /* (count of capacity) */
    int32_t count, capacity;
    int32_t *slots; /* (slot_count) hash table with the nodes as keys: 1 + index of a contact; 0: free */
    int32_t slot_count;
    drape_near_pair *near; /* (near_count of near_capacity) pairs, not merged */
    int32_t near_count, near_capacity;
} drape_active_set;

/* Lists the active contacts of a configuration at these distances from the paths of the candidates. Those of
 * pairs inside are gentle; all_inside: those of all pairs below their least gap are, for outside of steps no
 * others are. Exempt pairs are not near. Errors: DRAPE_E_MEMORY. */
drape_status drape_active_set_list(drape_active_set *set, const drape_candidates *candidates,
                                   const drape_distances *away, const drape_configuration *at,
                                   const drape_inside_pairs *inside, bool all_inside,
                                   const drape_exempt *exempt);

/* Adds an active contact. Errors: DRAPE_E_MEMORY. */
drape_status drape_active_set_add(drape_active_set *set, const drape_active_contact *contact);

#endif
