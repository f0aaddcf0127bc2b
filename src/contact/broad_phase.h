/*
 * broad_phase.h: finds the pairs of pieces that may come near each other, at given positions or on the path
 * to others. Pieces are the nodes, edges and faces of the cloths and the features of the colliders' shapes,
 * whose points are numbered after the nodes.
 */
#ifndef DRAPE_CONTACT_BROAD_PHASE_H
#define DRAPE_CONTACT_BROAD_PHASE_H

#include "contact/clusters.h"
#include "contact/distant.h"
#include "contact/pair.h"
#include "contact/self_search.h"
#include "geometry/path_bvh.h"

typedef struct drape_broad_phase {
    const drape_model *model;
    int32_t points;                       /* nodes, and points of colliders */
    int32_t *point_collider;              /* (points - node_count) */
    int32_t *first_point;                 /* (collider_count) */
    double *rest;                         /* (points x 3): nodes at rest, points of undisplaced colliders */
    int32_t *point;                       /* (points) their numbers: the elements of trees of points */
    drape_path_bvh nodes, faces, edges;   /* of the cloths */
    drape_self_search layers;             /* of cloth with cloth */
    drape_path_bvh corners, segment_tree; /* points and segments of colliders; */
    drape_path_bvh obstacles; /* their triangles, of those without a smooth distance: their boxes are
                                 enlarged by how far from them contact begins */
    double *corner_reach, *segment_reach, *obstacle_reach; /* [m] this enlargement */
    int32_t *segment;                                      /* (segments x 2) of colliders */
    int32_t *segment_collider;
    int32_t segments;
    int32_t *triangle; /* (obstacles.count x 3) of colliders */
    int32_t *triangle_collider;
    drape_distant distant; /* nodes far from smooth colliders */
    uint8_t *side;         /* (node_count) scratch of drape_path_bvh_scan, and of a sweep */
    bool *near, *close;    /* (node_count) scratch: an element can meet a feature of a collider if all
                                             of its nodes are near and one is close */
    int32_t *near_node, *near_element;    /* (node_count), (edges or triangles) scratch: lists of these */
    int32_t *marked_node;                 /* (node_count) scratch: the nodes of marked elements */
    drape_elements_of faces_of, edges_of; /* of each node, by feature scans */
    double *node_area, *edge_area, *face_area; /* area of the sheet that belongs to each [m2] */
    double *distance;       /* (collider_count) activation distance of cloth and each collider [m] */
    double *feature_most;   /* (collider_count) upper bound of the activation distance of its features [m] */
    double rounding;        /* what rounding can change in a gap, set by who moves the points [m] */
    double obstacle_radius; /* largest radius around the triangles of an obstacle [m] */
} drape_broad_phase;

drape_status drape_broad_phase_create(drape_arena *arena, const drape_model *model, drape_broad_phase *out);

/* Which pairs are searched: those whose pieces may be within their activation distance plus reach, at x or
 * anywhere on the straight path from x to y; if `passing`, within their least gap plus reach. */
typedef struct drape_broad_query {
    const double *x, *y;                /* (points x 3); y NULL: only at x */
    const drape_collider_pose *pose[2]; /* (collider_count) at x, and at y */
    double reach;
    bool passing;
    const bool *marked; /* (points) only pairs with a marked point; NULL: all */
} drape_broad_query;

/* Calls visit for every such pair, in an order that does not depend on the positions; the order by rank does
 * not depend on the search either. Left out are pairs whose nodes are all pinned, pairs that the model
 * ignores, and pairs with smooth surfaces, since every free node makes a pair with each of these. */
typedef void drape_broad_phase_visit(void *user, const drape_pair *pair);
void drape_broad_phase_pairs(drape_broad_phase *broad, const drape_broad_query *want,
                             drape_broad_phase_visit *visit, void *user);

/* The activation distance of cloth and the features of a collider [m]. */
static inline double drape_broad_phase_feature_distance(const drape_broad_phase *broad, int32_t collider)
{
    return fmin(broad->distance[collider], broad->feature_most[collider]);
}

/* The gap within which a pair is searched, without the reach [m]. */
static inline double drape_broad_phase_wanted(const drape_broad_phase *broad, bool passing, double distance)
{
    return passing ? fmin(fmax(DRAPE_LEAST_GAP * distance, broad->rounding), 0.5 * distance) : distance;
}

/* The pair of a free node and a smooth collider. */
drape_pair drape_broad_phase_surface(const drape_broad_phase *broad, int32_t node, int32_t collider);

#endif
