/*
 * self_search.h: finds the pairs of cloth with cloth whose pieces may be near each other, on a straight path
 * of all nodes. Clusters of a few faces are compared first: boxes separate clusters that are far from each
 * other, and neighbours in a flat sheet are separated because the sheet is little deformed (flat.h). So
 * elements are compared one by one only where cloth is folded, or where layers are near each other.
 */
#ifndef DRAPE_CONTACT_SELF_SEARCH_H
#define DRAPE_CONTACT_SELF_SEARCH_H

#include "contact/flat.h"
#include "geometry/path_bvh.h"

typedef struct drape_self_search {
    drape_clusters clusters;
    drape_flat flat;
    drape_path_boxes *boxes[DRAPE_ELEMENT_KINDS]; /* (groups) */
    int64_t *fitted;                              /* (clusters) the search in which the boxes were fitted */
    double (*low)[2][3], (*high)[2][3];           /* (branches) by end and axis */
    bool *marked;                                 /* (branches) */
    int64_t search;                               /* the number of searches so far */
} drape_self_search;

/* rest: (node_count x 3). Errors: DRAPE_E_MEMORY. */
drape_status drape_self_search_create(drape_arena *arena, const drape_model *model, const double *rest,
                                      drape_self_search *out);

/* Which pairs are searched: those that may be nearer than `reach` on the path from x to y (y NULL: at x).
 * Pairs whose pieces are surely at least half of their distance at rest plus `slack` apart may be left out.
 * marked (node_count): only pairs of clusters of which one has a marked node; NULL: all. */
typedef struct drape_self_query {
    const double *x, *y;
    double reach, slack, rounding; /* [m] */
    const bool *marked;
} drape_self_query;

/* Calls the functions for all such pairs, also of elements that share a node, in an order that does not
 * depend on positions: of a node and a face, and of two edges. */
typedef void drape_self_meet(void *user, int32_t a, int32_t b);
void drape_self_search_pairs(drape_self_search *search, const drape_self_query *want, drape_self_meet *face,
                             drape_self_meet *edge, void *user);

#endif
