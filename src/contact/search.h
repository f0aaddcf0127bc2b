/*
 * search.h: the broad phase. Which pairs of pieces come near each other, at some positions or on the way to
 * others. Pieces: the nodes, edges and faces of the cloths; the features of the colliders' shapes, whose
 * points are numbered behind the nodes.
 */
#ifndef DRAPE_CONTACT_SEARCH_H
#define DRAPE_CONTACT_SEARCH_H

#include "colliders/bvh.h"
#include "contact/pair.h"

typedef struct drape_search {
    drape_context *ctx;
    const drape_model *model;
    int32_t points;          /* nodes, and points of colliders */
    int32_t *point_collider; /* (points - node_count) */
    double *rest;            /* (points x 3): nodes at rest, colliders where their values put them */
    drape_bvh faces, edges;  /* of the cloths */
    drape_bvh obstacles;     /* triangles of colliders without a smooth distance */
    int32_t *segment;        /* (segments x 2) of colliders */
    int32_t *segment_collider;
    int32_t segments;
    int32_t *triangle; /* (obstacles.count x 3) of colliders */
    int32_t *triangle_collider;
    double *node_area, *edge_area, *face_area; /* shares of the sheet [m2] */
    double most_distance;                      /* largest activation distance of any pair [m] */
} drape_search;

drape_status drape_search_create(drape_context *ctx, const drape_model *model, drape_search *search);
void drape_search_destroy(drape_search *search);
size_t drape_search_bytes(const drape_search *search);

/* Calls visit for every pair whose pieces may be within its activation distance, and reach more (less where it is
 * negative: but they are found where they touch), at x or anywhere on the straight way from there to y (NULL: no way), in an order that does not depend on where
 * they are. A pair that no force of its can move (all nodes pinned) is left out. Surfaces are not searched
 * here: every free node has them. x, y: (points x 3). */
typedef void drape_search_visit(void *user, const drape_pair *pair);
void drape_search_pairs(drape_search *search, const double *x, const double *y, double reach,
                        drape_search_visit *visit, void *user);

/* The pair of a free node and a smooth collider. */
drape_pair drape_search_surface(const drape_search *search, int32_t node, int32_t collider);

#endif
