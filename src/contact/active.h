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

/* A near pair: its gap is less than DRAPE_BARRIER_PARABOLA activation distances. */
typedef struct drape_near_pair {
    drape_pair pair;
    double gap; /* [m] */
} drape_near_pair;

/* The pieces of a pair, by which it is known. */
typedef struct drape_pair_key {
    int32_t kind, collider, node[4];
} drape_pair_key;

/* The pairs that are inside: they began below their least gap, at the start of a run or after its state was
 * set, and have been near ever since. */
typedef struct drape_inside_pairs {
    drape_arena *arena;
    drape_pair_key *keys; /* (count of capacity), ascending */
    int32_t count, capacity;
} drape_inside_pairs;

/* Removes the pairs that are near no more, where both barriers are equal and no force jumps, and adds the
 * near pairs that are below their least gap. Returns whether a pair was added; *status: DRAPE_E_MEMORY. */
bool drape_inside_update(drape_inside_pairs *inside, const drape_near_pair *near, int32_t count,
                         double rounding, drape_status *status);

/* Adds a pair that is not among them; drape_inside_sort must follow the last one. Errors: DRAPE_E_MEMORY. */
drape_status drape_inside_add(drape_inside_pairs *inside, const drape_pair_key *key);
void drape_inside_sort(drape_inside_pairs *inside);

void drape_inside_archive(drape_inside_pairs *inside, drape_archive *a);

typedef struct drape_active_contact {
    drape_pair pair; /* its nodes are the points of the gap; -1 for points that do not exist */
    drape_gap gap;
    bool inside;   /* its pairs are inside, and have a barrier that pushes them out more softly (barrier.h) */
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

/* Lists the active contacts, and the near pairs that are not exempt, of a configuration at these distances
 * from the paths of the candidates. inside: the pairs that are inside. all_inside, for queries between
 * steps: every pair below its least gap is, too. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_active_set_list(drape_active_set *set, const drape_candidates *candidates,
                                   const drape_distances *away, const drape_configuration *at,
                                   const drape_inside_pairs *inside, bool all_inside,
                                   const drape_exempt *exempt);

/* Adds an active contact. Errors: DRAPE_E_MEMORY. */
drape_status drape_active_set_add(drape_active_set *set, const drape_active_contact *contact);

#endif
