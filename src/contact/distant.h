/*
 * distant.h: which nodes are surely far from smooth colliders. The distance of a point from a surface changes
 * by no more than the point moves in the coordinates of the collider. So a place of a node and its gap there,
 * which were evaluated earlier, show for most pairs of a node and a collider that they cannot meet. A ball
 * around nodes that are near each other shows it for all of them at once.
 */
#ifndef DRAPE_CONTACT_DISTANT_H
#define DRAPE_CONTACT_DISTANT_H

#include "geometry/path_bvh.h"
#include "model/model.h"

/* A place of a node in the coordinates of a collider, and a lower bound of the gap there. */
typedef struct drape_known_gap {
    double own[3], gap; /* [m] -INFINITY: never evaluated */
} drape_known_gap;

/* A ball around a cluster of nodes at each end of a path. */
typedef struct drape_node_ball {
    double centre[2][3], radius; /* [m] the larger one of both */
} drape_node_ball;

/* Not archived: results do not depend on it. */
typedef struct drape_distant {
    const drape_model *model;
    drape_known_gap
        *known;     /* (collider_count x node_count); never evaluated for pins, and for colliders that are
                               not smooth or deform */
    int32_t *order; /* (node_count) the nodes, so that neighbours at rest are near each other in the list */
    drape_node_ball *balls; /* around clusters of nodes that follow each other in the list */
    double rounding;        /* [m] of gaps, at the last update */
} drape_distant;

/* faces: a tree of the faces of the cloth, which gives the order; it may be empty. */
drape_status drape_distant_create(drape_arena *arena, const drape_model *model, const drape_path_bvh *faces,
                                  drape_distant *out);

/* Evaluates the gaps of nodes that have moved by a large part of their known gap. x: (points x 3), pose:
 * (collider_count), rounding: that of gaps [m]. */
void drape_distant_update(drape_distant *distant, const double *x, const drape_collider_pose *pose,
                          double rounding);

/* Puts balls around the clusters on the straight path of all nodes from x to y; y NULL: only at x. */
void drape_distant_fit(drape_distant *distant, const double *x, const double *y);

/* Marks the nodes (node_count) whose gap may be less than `gap` on the path that was fitted last, which is
 * straight in the coordinates of the collider. pose: of the collider at both ends. */
void drape_distant_mark(const drape_distant *distant, int32_t collider,
                        const drape_collider_pose *const pose[2], double gap, bool *marked);

/* Whether the gap of a node at a place, in the coordinates of a collider, is surely at least `gap` [m]. If
 * this holds at both ends of a path that is straight in these coordinates, it holds on the whole path. */
static inline bool drape_distant_keeps(const drape_distant *distant, int32_t collider, int32_t node,
                                       const double own[3], double gap)
{
    const size_t at = (size_t)collider * (size_t)distant->model->node_count + (size_t)node;
    const drape_known_gap *known = &distant->known[at];
    const double slack = known->gap - gap, a = own[0] - known->own[0], b = own[1] - known->own[1],
                 c = own[2] - known->own[2];
    return slack > 0 && a * a + b * b + c * c < slack * slack;
}

#endif
