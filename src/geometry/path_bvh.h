/*
 * path_bvh.h: a tree of boxes over edges or triangles that move straight from one configuration to another.
 * Each branch has four children, which are tested at once, and each child has two boxes, one around each end
 * of the path, so that pieces are not taken to meet because of a motion that they have in common.
 */
#ifndef DRAPE_GEOMETRY_PATH_BVH_H
#define DRAPE_GEOMETRY_PATH_BVH_H

#include "base/lanes.h"
#include "geometry/bvh.h"

/* ---- Boxes at both ends of straight paths, four at once ---- */

/* Two convex pieces stay apart on their paths if one axis separates them at both ends with the same piece in
 * front: the difference of any two of their points along that axis is then linear in the step fraction and
 * positive at both ends. */
typedef struct drape_path_boxes {
    double low[2][3][LANES], high[2][3][LANES]; /* by end and axis */
} drape_path_boxes;

/* A box that is compared with four others: the same number in all lanes. */
typedef struct drape_path_box {
    lanes low[2][3], high[2][3];
} drape_path_box;

/* One of four boxes, enlarged by reach. */
LANES_INLINE void drape_path_box_of(const drape_path_boxes *boxes, int32_t lane, double reach, int ends,
                                    drape_path_box *box)
{
    for (int end = 0; end < ends; end++)
        for (int k = 0; k < 3; k++) {
            box->low[end][k] = boxes->low[end][k][lane] - reach - (lanes){0};
            box->high[end][k] = boxes->high[end][k][lane] + reach - (lanes){0};
        }
}

/* Which boxes an axis separates from another one: -1 in their lanes. */
LANES_INLINE lanes_mask drape_path_boxes_apart(const drape_path_boxes *boxes, const drape_path_box *from,
                                               int ends)
{
    lanes_mask apart = {0};
    for (int k = 0; k < 3; k++) {
        lanes_mask above = lanes_load(boxes->low[0][k]) > from->high[0][k],
                   below = lanes_load(boxes->high[0][k]) < from->low[0][k];
        if (ends > 1) {
            above &= lanes_load(boxes->low[1][k]) > from->high[1][k];
            below &= lanes_load(boxes->high[1][k]) < from->low[1][k];
        }
        apart |= above | below;
    }
    return apart;
}

/* ---- The tree ---- */

typedef struct drape_path_branch {
    drape_path_boxes boxes; /* of the children */
    int32_t child[LANES];   /* a later branch; -1 - e: the element e */
    int32_t marked[LANES];  /* whether an element in it is marked */
    int32_t count;          /* of children */
} drape_path_branch;

typedef struct drape_path_bvh {
    int32_t count; /* number of elements */
    int nodes;     /* nodes per element */
    const int32_t *node;
    int32_t *place; /* (count) of each element in the order of the tree, */
    int32_t *order; /* (count) and the element in each place */
    drape_path_branch *branches;
    int32_t branch_count;
} drape_path_bvh;

/* As drape_bvh_build. Errors: DRAPE_E_MEMORY. */
drape_status drape_path_bvh_build(drape_arena *arena, int32_t count, int nodes, const int32_t *node,
                                  const double *x, drape_path_bvh *bvh);

/* Refits the boxes to the paths of the elements from x to y; y NULL: to the elements at x. marked: elements
 * with a marked point are marked; NULL: all are. grow: (count) [m] by which the box of each element is
 * enlarged; NULL: by nothing. */
void drape_path_bvh_fit(drape_path_bvh *bvh, const double *x, const double *y, const bool *marked,
                        const double *grow);

/* A search for the elements that no axis separates, by more than reach at both ends, from some nodes on their
 * path. */
typedef struct drape_path_query {
    const int32_t *node;
    int nodes;
    const double *x, *y; /* y NULL as in the last fit */
    double reach;
    bool only_marked; /* only marked elements */
} drape_path_query;

/* Calls visit for every such element, by increasing place. */
void drape_path_bvh_query(const drape_path_bvh *bvh, const drape_path_query *query, drape_bvh_visit *visit,
                          void *user);

/* Some elements of a tree, and the points of these elements. */
typedef struct drape_path_elements {
    const int32_t *element, *point;
    int32_t elements, points;
} drape_path_elements;

/* The same for some elements of a tree that is not fitted, by a test of each of their points: for a few
 * queries this costs less than to fit the tree. marked as in drape_path_bvh_fit; side: (largest point + 1)
 * scratch. */
void drape_path_bvh_scan(const drape_path_bvh *bvh, const drape_path_query *query,
                         const drape_path_elements *among, const bool *marked, uint8_t *side,
                         drape_bvh_visit *visit, void *user);

/* Calls visit for every pair of elements, one of each tree, of which one is marked and that no axis separates
 * by more than reach at both ends; both trees were fitted to the same ends. Branches that are apart are met
 * once for all of their elements, so this takes a fraction of the time of a query for each element. With a ==
 * b every pair of different elements is visited once. The order does not depend on the positions. */
typedef void drape_path_bvh_meet(void *user, int32_t a, int32_t b);
void drape_path_bvh_join(const drape_path_bvh *a, const drape_path_bvh *b, bool moves, double reach,
                         drape_path_bvh_meet *visit, void *user);

#endif
