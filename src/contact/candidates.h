/*
 * candidates.h: the candidate pairs, found by the broad phase along a straight path of all points. They are
 * valid for a configuration if at some moment of the path, the same for all points, every point is within the
 * margin of its place in the configuration.
 *
 * Where only some points or colliders have left the path, a patch is searched: the pairs that have one of
 * these points or colliders, along a new path of all points. The pairs of a patch replace those of earlier
 * searches that have one of them. So layers of cloth are not searched again because a collider moves, and of
 * a correction that is shortened again and again only the part that meets something is searched each time.
 * The rank of pairs depends on the pieces alone: sums over the active pairs, in this order, have the same
 * bits wherever searches were made.
 */
#ifndef DRAPE_CONTACT_CANDIDATES_H
#define DRAPE_CONTACT_CANDIDATES_H

#include "contact/broad_phase.h"
#include "contact/sort_pairs.h"

/* All points move straight from one end to the other. */
typedef struct drape_straight_path {
    drape_configuration end[2];
} drape_straight_path;

/* The pairs of one search. */
typedef struct drape_candidate_set {
    bool known;                   /* there was memory for everything that the search found */
    double *x[2];                 /* (points x 3) the ends of its path */
    drape_collider_pose *pose[2]; /* (collider_count) */
    double *away; /* (points + collider_count) [m] the distance of each from its path, as last measured */
    drape_pair *pairs; /* (count of capacity) including those with surfaces, by increasing rank */
    int32_t count, capacity;
} drape_candidate_set;

#define DRAPE_CANDIDATE_SETS 4

typedef struct drape_candidates {
    drape_arena *arena;
    drape_broad_phase *broad;
    double margin;                                 /* how far points may be from the paths [m] */
    drape_candidate_set set[DRAPE_CANDIDATE_SETS]; /* set 0 is of all pairs, later ones are patches */
    int sets;                                      /* number of sets in use; 0: no search was made */
    uint8_t *level;  /* (points + collider_count) the last set for which each was marked; 0: set 0 */
    bool *marked;    /* (points + collider_count) of the search in progress */
    uint8_t *beyond; /* (points + collider_count) a bit for each set from whose path it is too far */
    bool *stale;     /* (collider_count) whose pairs have another activation distance by now */
    drape_pair_sorter sorter;
} drape_candidates;

/* arena and broad must outlive the candidates. */
drape_status drape_candidates_create(drape_arena *arena, drape_broad_phase *broad, double margin,
                                     drape_candidates *out);

/* Calls visit, in the order of the broad phase, for all pairs that can become active while no point is
 * farther than the margin from the path; if `passing`, only for pairs of features whose gap can fall to the
 * least one. marked: (points + collider_count) a pair must have a marked piece; NULL: all pairs. The points
 * of a marked collider must be marked, too. */
void drape_candidates_find(drape_broad_phase *broad, const drape_straight_path *path, double margin,
                           bool passing, const bool *marked, drape_broad_phase_visit *visit, void *user);

/* Makes the candidates valid on the path, by a patch if few points are away from earlier searches there.
 * Errors: DRAPE_E_MEMORY. */
drape_status drape_candidates_search(drape_candidates *candidates, const drape_straight_path *path);

/* Whether that would search no more than a patch. */
bool drape_candidates_patch_serves(drape_candidates *candidates, const drape_straight_path *path);

/* Forgets all searches. */
void drape_candidates_forget(drape_candidates *candidates);

/* The activation distance of a collider has changed: its pairs are searched anew. */
void drape_candidates_forget_collider(drape_candidates *candidates, int32_t collider);

/* How far a straight path is from the paths of the searches. */
typedef struct drape_distances {
    double set
        [DRAPE_CANDIDATE_SETS]; /* [m] the largest of all points; those of each: drape_candidate_set.away */
    double stray; /* [m] by which points may be farther away than was measured; the caller sets it */
    double
        beyond; /* [m] pairs are wanted up to so far beyond their activation distance; the caller sets it */
} drape_distances;

/* Measures the distances of a path, which are largest at one of its ends. The distances of single points are
 * kept until the next call. The distance from a set is INFINITY if there was no search, or if a position is
 * not finite or beyond the margin; later sets are then not measured. */
drape_distances drape_candidates_distances(const drape_candidates *candidates,
                                           const drape_straight_path *path);

/* The largest of them; INFINITY if the candidates are not valid on the path. */
double drape_candidates_farthest(const drape_candidates *candidates, const drape_distances *away);

/* A position in the list of candidates. */
typedef struct drape_candidate_cursor {
    int32_t at[DRAPE_CANDIDATE_SETS];
} drape_candidate_cursor;

/* The next candidate by rank whose gap can fall below its activation distance; NULL: there is none. */
const drape_pair *drape_candidates_next(const drape_candidates *candidates, const drape_distances *away,
                                        drape_candidate_cursor *cursor);

#endif
