/*
 * bvh.h: a bounding volume hierarchy: a binary tree of axis-aligned boxes over edges or triangles, of cloth
 * or of a collider. Its shape is built once, from rest positions, so that a branch is a patch of cloth; the
 * boxes are then refitted to any positions. Queries visit elements in an order that does not depend on the
 * positions, so that sums over the results are reproducible to the bit.
 */
#ifndef DRAPE_GEOMETRY_BVH_H
#define DRAPE_GEOMETRY_BVH_H

#include "base/arena.h"

/* Stack size for a traversal, which leaves at most two children of a level waiting: halving the elements,
 * whose number is an int32_t, takes fewer levels than that has bits. */
#define DRAPE_BVH_DEPTH (2 * 8 * (int)sizeof(int32_t))

typedef struct drape_box {
    double low[3], high[3];
} drape_box;

typedef struct drape_bvh_branch {
    drape_box box;
    int32_t first, count; /* leaf: its elements are order[first] ... */
    int32_t second;       /* the second child; the first child is the next branch; 0 in a leaf */
} drape_bvh_branch;

typedef struct drape_bvh {
    int32_t count; /* number of elements */
    int nodes;     /* nodes per element */
    const int32_t *node;
    int32_t *order;
    drape_bvh_branch *branches;
    int32_t branch_count;
} drape_bvh;

/* node (count x nodes) must outlive the tree. x: the positions that determine the shape. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_bvh_build(drape_arena *arena, int32_t count, int nodes, const int32_t *node,
                             const double *x, drape_bvh *bvh);

/* Refits the boxes to the elements at x. */
void drape_bvh_fit(drape_bvh *bvh, const double *x);

/* Returns the box of some nodes at x, enlarged by reach. */
drape_box drape_box_of(const int32_t *node, int nodes, const double *x, double reach);

/* Calls visit for every element whose leaf overlaps the box. */
typedef void drape_bvh_visit(void *user, int32_t element);
void drape_bvh_query(const drape_bvh *bvh, const drape_box *box, drape_bvh_visit *visit, void *user);

#endif
