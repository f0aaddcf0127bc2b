/*
 * candidates.h: the candidate pairs, found by the broad phase along a straight path of all points. They are
 * valid for a configuration if at some moment of the path, the same for all points, every point is within the
 * margin of its place in the configuration. The rank of pairs depends on the
 * pieces alone: sums over the active pairs, in this order, have the same bits wherever searches were made.
 */
#ifndef DRAPE_CONTACT_CANDIDATES_H
#define DRAPE_CONTACT_CANDIDATES_H

#include "contact/broad_phase.h"
#include "contact/sort_pairs.h"

/* All points move straight from one end to the other. */
typedef struct drape_straight_path {
    drape_configuration end[2];
} drape_straight_path;

typedef struct drape_candidates {
    drape_arena *arena;
    drape_broad_phase *broad;
    double margin; /* how far points may be from the path [m] */
    bool known;    /* a search was made, and its pairs still have the activation distances of now */
    bool complete; /* there was memory for all pairs of the search in progress */
    double *x[2];  /* (points x 3) the ends of the path of the search */
    drape_collider_pose *pose[2]; /* (collider_count) */
    double *away; /* (points + collider_count) [m] the distance of each from its path, as last measured */
    drape_pair *pairs; /* (count of capacity) including those with surfaces, by increasing rank */
    int32_t count, capacity;
    drape_pair_sorter sorter;
} drape_candidates;

/* arena and broad must outlive the candidates. */
drape_status drape_candidates_create(drape_arena *arena, drape_broad_phase *broad, double margin,
                                     drape_candidates *out);

/* Calls visit, in the order of the broad phase, for all pairs that can become active while no point is
 * farther than the margin from the path; if `passing`, only for pairs of features whose gap can fall to the
 * least one. */
void drape_candidates_find(drape_broad_phase *broad, const drape_straight_path *path, double margin,
                           bool passing, drape_broad_phase_visit *visit, void *user);

/* Searches candidates that are valid on the path. Errors: DRAPE_E_MEMORY. */
drape_status drape_candidates_search(drape_candidates *candidates, const drape_straight_path *path);

/* Forgets the search, as when an activation distance has changed. */
void drape_candidates_forget(drape_candidates *candidates);

/* How far a straight path is from that of the search. */
typedef struct drape_distances {
    double largest; /* [m] of all points; those of each: drape_candidates.away */
    double stray;   /* [m] by which points may be farther away than was measured; the caller sets it */
    double
        beyond; /* [m] pairs are wanted up to so far beyond their activation distance; the caller sets it */
} drape_distances;

/* Measures the distances of a path, which are largest at one of its ends. The distances of single points are
 * kept until the next call. The largest is INFINITY if there was no search, or if a position is not finite or
 * beyond the margin. */
drape_distances drape_candidates_distances(const drape_candidates *candidates,
                                           const drape_straight_path *path);

/* Whether the candidates are valid on a path at these distances. */
static inline bool drape_candidates_are_valid(const drape_candidates *candidates, const drape_distances *away)
{
    return away->largest + away->stray <= candidates->margin;
}

/* The next candidate from *at on, by rank, whose gap can fall below its activation distance; NULL: there is
 * none. *at: 0 at first. */
const drape_pair *drape_candidates_next(const drape_candidates *candidates, const drape_distances *away,
                                        int32_t *at);

#endif
