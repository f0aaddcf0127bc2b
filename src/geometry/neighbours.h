/*
 * neighbours.h: which points are nearer to each other than a reach, asked again and again while the points move a little:
 * a grid of boxes in a hash table, and lists of near points that are kept for many updates (Verlet 1967). The broad phase
 * of the explicit integrator, for nodes against nodes; that of contact is contact/broad_phase.h, for faces and edges.
 */
#ifndef DRAPE_GEOMETRY_NEIGHBOURS_H
#define DRAPE_GEOMETRY_NEIGHBOURS_H

#include "base/arena.h"

#define DRAPE_MAX_NEIGHBOURS 64

typedef struct drape_neighbours drape_neighbours;

drape_status drape_neighbours_create(drape_arena *arena, int32_t points, double reach,
                                     drape_neighbours **out);

/* The points are at x (points x 3). They are then asked for one by one and may be moved in between, each by at most
 * share times the reach; drape_neighbours_moved reports it. */
void drape_neighbours_update(drape_neighbours *neighbours, double share, const double *x);
void drape_neighbours_moved(drape_neighbours *neighbours, int32_t point, const double *x);

/* The numbers, ascending, of all points that are nearer to a point at x than the reach, and of some others. The array is
 * `room` or one of the neighbours, valid until the next update. -1: there may be more than DRAPE_MAX_NEIGHBOURS. */
int drape_neighbours_of(const drape_neighbours *neighbours, int32_t point, const double *x,
                        int32_t room[DRAPE_MAX_NEIGHBOURS + 1], const int32_t **near);

#endif
