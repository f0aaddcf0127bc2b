/*
 * neighbours.h: which points are nearer to each other than a reach, for repeated queries while the points
 * move a little: a grid of boxes in a hash table, and lists of near points that stay valid for many updates
 * (Verlet 1967). This is the broad phase of the explicit integrator, for nodes against nodes; the broad phase
 * of contact, for faces and edges, is contact/broad_phase.h.
 */
#ifndef DRAPE_GEOMETRY_NEIGHBOURS_H
#define DRAPE_GEOMETRY_NEIGHBOURS_H

#include "base/arena.h"

#include <string.h>

#define DRAPE_MAX_NEIGHBOURS  64 /* maximum length of the list of a point */
#define DRAPE_MEAN_NEIGHBOURS 24 /* capacity of the lists, per point on average */

typedef struct drape_neighbours {
    int32_t points;
    double reach;            /* [m] */
    double per_box;          /* boxes per metre */
    int32_t buckets;         /* number of buckets, a power of 2 */
    int32_t *start;          /* (buckets + 1) */
    int32_t *bucket, *place; /* (points) bucket of a point, and its index in the sorted arrays */
    int32_t *point;          /* (points) sorted: number of the point */
    uint64_t *row;           /* (points) sorted: the row along x that contains its box */
    double *x;               /* (points x 3) sorted */
    double share;            /* share of the last update */
    bool listed;             /* the lists are valid near x_listed, for shares up to listed_share */
    double listed_share;
    int32_t *first, *cursor; /* (points + 1), (points): where the list of a point starts in near */
    int32_t *near;           /* (points x DRAPE_MEAN_NEIGHBOURS) */
    int32_t *pair;           /* (points x DRAPE_MEAN_NEIGHBOURS / 2 x 2) */
    double *x_listed;        /* (points x 3) */
} drape_neighbours;

drape_status drape_neighbours_create(drape_arena *arena, int32_t points, double reach, drape_neighbours *out);

/* Sets the positions x (points x 3). The points are then queried one by one and may be moved in between, each
 * by at most share times the reach; drape_neighbours_moved must be called after each move. */
void drape_neighbours_update(drape_neighbours *neighbours, double share, const double *x);

static inline void drape_neighbours_moved(drape_neighbours *s, int32_t point, const double *x)
{
    if (!s->listed)
        memcpy(s->x + 3 * (size_t)s->place[point], x, 3 * sizeof *x);
}

/* Implements drape_neighbours_of when there are no lists. */
int drape_neighbours_search(const drape_neighbours *neighbours, int32_t point, const double *x,
                            int32_t found[DRAPE_MAX_NEIGHBOURS + 1]);

/* Finds the numbers, in ascending order, of all points nearer to a point at x than the reach, and of some
 * other points. *near is the array of these numbers, valid until the next update: a list, or `scratch`.
 * Returns their count, or -1 if there are more than DRAPE_MAX_NEIGHBOURS. */
static inline int drape_neighbours_of(const drape_neighbours *s, int32_t point, const double *x,
                                      int32_t scratch[DRAPE_MAX_NEIGHBOURS + 1], const int32_t **near)
{
    *near = s->listed ? s->near + s->first[point] : scratch;
    return s->listed ? s->first[point + 1] - s->first[point] : drape_neighbours_search(s, point, x, scratch);
}

#endif
