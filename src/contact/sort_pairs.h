/*
 * sort_pairs.h: sorts pairs by rank (pair.h), in time proportional to their number. A search finds them in
 * the order of trees of boxes.
 */
#ifndef DRAPE_CONTACT_SORT_PAIRS_H
#define DRAPE_CONTACT_SORT_PAIRS_H

#include "base/arena.h"
#include "contact/pair.h"

static inline bool drape_pair_is_before(const drape_pair *a, const drape_pair *b)
{
    for (int i = 0; i < 3; i++)
        if (a->rank[i] != b->rank[i])
            return a->rank[i] < b->rank[i];
    return false;
}

/* Scratch, which grows in the arena. Set the arena, zero the rest. */
typedef struct drape_pair_sorter {
    drape_arena *arena;
    drape_pair *pairs; /* (capacity) */
    int32_t *order[2]; /* (capacity) */
    int32_t *first;    /* (first_capacity) of the pairs with each rank */
    int32_t capacity, first_capacity;
} drape_pair_sorter;

/* Sorts `count` pairs. Errors: DRAPE_E_MEMORY, the pairs stay as they are. */
drape_status drape_sort_pairs(drape_pair_sorter *sorter, drape_pair *pairs, int32_t count);

#endif
