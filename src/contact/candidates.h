/*
 * candidates.h: the candidate pairs, found by the broad phase along a straight path of all points, and valid
 * for a configuration if no point is farther than the margin from its place at some step fraction of the
 * path, the same for all points. Their order depends on the pieces alone: sums over the active ones have the
 * same bits wherever the search was made.
 */
#ifndef DRAPE_CONTACT_CANDIDATES_H
#define DRAPE_CONTACT_CANDIDATES_H

#include "contact/broad_phase.h"

/* All points move straight from one end to the other. */
typedef struct drape_straight_path {
    drape_configuration end[2];
} drape_straight_path;

typedef struct drape_candidates {
    drape_arena *arena;
    drape_broad_phase *broad;
    bool known;                   /* a search was made, and there was memory for everything that it found */
    double margin;                /* how far points may be from the path [m] */
    double *x[2];                 /* (points x 3) the ends of the path */
    drape_collider_pose *pose[2]; /* (collider_count) */
    drape_pair *pairs;            /* (count of room) including those with surfaces */
    int32_t count, room;
} drape_candidates;

/* arena and broad must outlive the candidates. */
drape_status drape_candidates_create(drape_arena *arena, drape_broad_phase *broad, drape_candidates *out);

/* Calls visit for all pairs that can become active while no point is farther than margin from the path. */
void drape_candidates_find(drape_broad_phase *broad, const drape_straight_path *path, double margin,
                           drape_broad_phase_visit *visit, void *user);

/* Makes these pairs the candidates. Errors: DRAPE_E_MEMORY. */
drape_status drape_candidates_search(drape_candidates *candidates, const drape_straight_path *path,
                                     double margin);

/* The largest distance of a point from the path; INFINITY if there was no search, or if a position is not
 * finite. */
double drape_candidates_distance(const drape_candidates *candidates, const drape_configuration *at);

/* Whether the gap of a candidate can fall below `gap` while no point is farther than `away` from the path. */
static inline bool drape_candidate_may_fall_below(const drape_pair *pair, double away, double gap)
{
    return pair->gap_at_search - 2 * away < gap;
}

#endif
