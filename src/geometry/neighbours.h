/*
 * neighbours.h: which points are nearer to each other than a reach, asked again and again while the points
 * move a little: a grid of boxes in a hash table, and lists of near points that are kept for many updates
 * (Verlet 1967). The broad phase of the explicit integrator, for nodes against nodes; that of contact is
 * contact/broad_phase.h, for faces and edges.
 */
#ifndef DRAPE_GEOMETRY_NEIGHBOURS_H
#define DRAPE_GEOMETRY_NEIGHBOURS_H

#include "base/arena.h"

#include <string.h>

#define DRAPE_MAX_NEIGHBOURS  64 /* in the list of a point */
#define DRAPE_MEAN_NEIGHBOURS 24 /* room in the lists, for each point on average */

typedef struct drape_neighbours {
    int32_t points;
    double reach;            /* [m] */
    double per_box;          /* boxes per metre */
    int32_t buckets;         /* a power of 2 */
    int32_t *start;          /* (buckets + 1) */
    int32_t *bucket, *place; /* (points) of a point, and its index in the sorted arrays */
    int32_t *point;          /* sorted: (points) */
    uint64_t *row;           /* sorted: (points) the row along x that contains its box */
    double *x;               /* sorted: (points x 3) */
    double share;            /* of the last update */
    bool listed;             /* the lists are valid near x_listed, for shares up to listed_share */
    double listed_share;
    int32_t *first, *cursor; /* (points + 1), (points): of a point in near */
    int32_t *near;           /* (points x DRAPE_MEAN_NEIGHBOURS) */
    int32_t *pair;           /* (points x DRAPE_MEAN_NEIGHBOURS / 2 x 2) */
    double *x_listed;        /* (points x 3) */
} drape_neighbours;

drape_status drape_neighbours_create(drape_arena *arena, int32_t points, double reach, drape_neighbours *out);

/* The points are at x (points x 3). They are then asked for one by one and may be moved in between, each by
 * at most share times the reach; drape_neighbours_moved reports it. */
void drape_neighbours_update(drape_neighbours *neighbours, double share, const double *x);

static inline void drape_neighbours_moved(drape_neighbours *s, int32_t point, const double *x)
{
    if (!s->listed)
        memcpy(s->x + 3 * (size_t)s->place[point], x, 3 * sizeof *x);
}

/* drape_neighbours_of without lists. */
int drape_neighbours_search(const drape_neighbours *neighbours, int32_t point, const double *x,
                            int32_t found[DRAPE_MAX_NEIGHBOURS + 1]);

/* The numbers, ascending, of all points that are nearer to a point at x than the reach, and of some others:
 * an array of the neighbours, valid until the next update, or `room`. Returns how many, -1 if they are more
 * than DRAPE_MAX_NEIGHBOURS. */
static inline int drape_neighbours_of(const drape_neighbours *s, int32_t point, const double *x,
                                      int32_t room[DRAPE_MAX_NEIGHBOURS + 1], const int32_t **near)
{
    *near = s->listed ? s->near + s->first[point] : room;
    return s->listed ? s->first[point + 1] - s->first[point] : drape_neighbours_search(s, point, x, room);
}

#endif
