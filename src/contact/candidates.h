/*
 * candidates.h: the candidate pairs, found by the broad phase at some positions and valid until a point
 * moves farther from there than the margin. Their order depends on the pieces alone: sums over the active
 * ones have the same bits wherever the search was made.
 */
#ifndef DRAPE_CONTACT_CANDIDATES_H
#define DRAPE_CONTACT_CANDIDATES_H

#include "contact/broad_phase.h"

typedef struct drape_candidates {
    drape_arena *arena;
    drape_broad_phase *broad;
    bool known;                /* a search was made, and there was memory for everything that it found */
    double margin;             /* how far points may move from the positions of the search [m] */
    double *x;                 /* (points x 3) the positions of the search */
    drape_collider_pose *pose; /* (collider_count) */
    drape_pair *pairs;         /* (count of room) including those with surfaces */
    int32_t count, room;
} drape_candidates;

/* arena and broad must outlive the candidates. */
drape_status drape_candidates_create(drape_arena *arena, drape_broad_phase *broad, drape_candidates *out);

/* Finds all pairs that can become active while no point is farther than margin from these positions, which
 * may be the candidates' own. Errors: DRAPE_E_MEMORY. */
drape_status drape_candidates_search(drape_candidates *candidates, const drape_configuration *at,
                                     double margin);

/* The activation distance [m] of a pair that the broad phase found. */
double drape_candidates_distance(const drape_broad_phase *broad, const drape_pair *pair);

/* The largest distance of a point from its position at the search; INFINITY if there was none, or if a
 * position is not finite. */
double drape_candidates_moved(const drape_candidates *candidates, const drape_configuration *at);

/* Whether the gap of a candidate can fall below `gap` while no point is farther than moved from the
 * positions of the search. */
static inline bool drape_candidate_may_fall_below(const drape_pair *pair, double moved, double gap)
{
    return pair->gap_at_search - 2 * moved < gap;
}

#endif
