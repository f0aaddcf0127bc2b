/*
 * bvh.h: a bounding volume hierarchy: a binary tree of axis-aligned boxes over edges or triangles, of cloth
 * or of a collider. Its shape is made once, from rest positions, so that a branch is a patch of cloth; the
 * boxes are refitted to any positions. Queries visit elements in an order that does not depend on the
 * positions, so that sums over what they find have the same bits however it was found.
 */
#ifndef DRAPE_GEOMETRY_BVH_H
#define DRAPE_GEOMETRY_BVH_H

#include "base/arena.h"

#define DRAPE_BVH_DEPTH 64 /* of a stack for a walk: halving 2^31 elements takes 31 */

typedef struct drape_box {
    double low[3], high[3];
} drape_box;

typedef struct drape_bvh_branch {
    drape_box box;
    int32_t first, count; /* leaf: elements order[first] ... */
    int32_t second;       /* the second child, the first is the next branch; 0 in a leaf */
} drape_bvh_branch;

typedef struct drape_bvh {
    int32_t count; /* elements */
    int nodes;     /* of each element */
    const int32_t *node;
    int32_t *order;
    drape_bvh_branch *branches;
    int32_t branch_count;
} drape_bvh;

/* node (count x nodes) outlives the tree. x: positions that give the shape. Errors: DRAPE_E_MEMORY. */
drape_status drape_bvh_build(drape_arena *arena, int32_t count, int nodes, const int32_t *node,
                             const double *x, drape_bvh *bvh);

/* Boxes around the elements at x and, where y is not NULL, on the straight path from x to y. */
void drape_bvh_fit(drape_bvh *bvh, const double *x, const double *y);

/* The box of some nodes at x, and at y unless it is NULL, grown by reach. */
drape_box drape_box_of(const int32_t *node, int nodes, const double *x, const double *y, double reach);

/* Calls visit for every element whose leaf meets the box. */
typedef void drape_bvh_visit(void *user, int32_t element);
void drape_bvh_query(const drape_bvh *bvh, const drape_box *box, drape_bvh_visit *visit, void *user);

#endif
