/*
 * distant.h: which nodes are surely far from smooth colliders. The distance from a surface changes by no more
 * than a point moves in the coordinates of the collider: where each node was when it was looked at, and its
 * gap there, tell of most pairs of a node and a collider, without another look, that they cannot meet. Of
 * nodes that are near each other, a ball around them tells it at once.
 */
#ifndef DRAPE_CONTACT_DISTANT_H
#define DRAPE_CONTACT_DISTANT_H

#include "geometry/path_bvh.h"
#include "model/model.h"

/* Where a node was in the coordinates of a collider, and a lower bound of its gap there. */
typedef struct drape_sighting {
    double own[3], gap; /* [m] -INFINITY: never looked at */
} drape_sighting;

/* A ball around a cluster of nodes at each end of a path. */
typedef struct drape_node_ball {
    double centre[2][3], radius; /* [m] the larger one of both */
} drape_node_ball;

/* Not archived: results do not depend on it. */
typedef struct drape_distant {
    const drape_model *model;
    drape_sighting *seen;   /* (collider_count x node_count); of pins, and of colliders that are not smooth or
                             deform, never */
    int32_t *order;         /* (node_count) the nodes, those near each other at rest in a row, */
    drape_node_ball *balls; /* of which some form a cluster */
    double rounding;        /* [m] of gaps, at the last update */
} drape_distant;

/* faces: of the cloth, a tree whose order brings those near each other together; it may be empty. */
drape_status drape_distant_create(drape_arena *arena, const drape_model *model, const drape_path_bvh *faces,
                                  drape_distant *out);

/* Looks at the nodes that have moved by a large part of their gap since they were looked at. x: (points x 3),
 * pose: (collider_count), rounding: that of gaps [m]. */
void drape_distant_update(drape_distant *distant, const double *x, const drape_collider_pose *pose,
                          double rounding);

/* Puts balls around the clusters on the straight path of all nodes from x to y; y NULL: only at x. */
void drape_distant_fit(drape_distant *distant, const double *x, const double *y);

/* Marks the nodes (node_count) whose gap may be less than this on the path that was fitted last, straight in
 * the coordinates of a collider, with its poses at both ends. */
void drape_distant_mark(const drape_distant *distant, int32_t collider,
                        const drape_collider_pose *const pose[2], double gap, bool *marked);

/* Whether the gap of a node, in the coordinates of a collider, is surely at least so large [m]. Of a straight
 * path there, it is if it is at both ends. */
static inline bool drape_distant_keeps(const drape_distant *distant, int32_t collider, int32_t node,
                                       const double own[3], double gap)
{
    const size_t at = (size_t)collider * (size_t)distant->model->node_count + (size_t)node;
    const drape_sighting *seen = &distant->seen[at];
    const double slack = seen->gap - gap, a = own[0] - seen->own[0], b = own[1] - seen->own[1],
                 c = own[2] - seen->own[2];
    return slack > 0 && a * a + b * b + c * c < slack * slack;
}

#endif
