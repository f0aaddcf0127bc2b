/*
 * flat.h: shows that neighbouring clusters of cloth, whose boxes overlap, are apart because the cloth between
 * them is little deformed. If a sheet is flat and convex at rest, the straight line between two points of the
 * rest shape lies in the sheet. With the gradient F (3 x 2) of the faces that the line crosses, and any A (3
 * x 2) of norm 1, the points X, Y of the rest shape are at least c |X - Y| apart if the symmetric part of A^T
 * F has no eigenvalue below c on these faces:
 *
 *     |x - y| >= (X - Y)^T A^T (x - y) / |X - Y| = mean of (X - Y)^T A^T F (X - Y) / |X - Y| >= c |X - Y|.
 *
 * On straight paths the least eigenvalue is concave in the step fraction, so what holds at both ends holds
 * between. Pieces without a common node are at least as far apart at rest as the least height of a face that
 * is crossed.
 */
#ifndef DRAPE_CONTACT_FLAT_H
#define DRAPE_CONTACT_FLAT_H

#include "contact/clusters.h"

/* Gradients of the faces of a group, at both ends, by column and axis, and their sum over a cluster. */
typedef struct drape_gradients {
    double of[2][2][3][LANES];
} drape_gradients;

/* A rectangle in the plane of a sheet [m]. */
typedef struct drape_flat_area {
    double low[2], high[2];
} drape_flat_area;

/* Clusters in the largest part of a sheet that is tested as a whole: larger parts are seldom flat enough. */
#define DRAPE_FLAT_WINDOW 16

typedef struct drape_flat {
    const drape_clusters *clusters;
    double *inverse; /* (groups of faces x 4 x LANES) of the matrix of two edges of each face at rest; a lane
                        without a face has a copy of another one */
    double *height;  /* [m] (clusters) the least of its faces at rest */
    drape_flat_area *area; /* (branches) at rest, in the plane of the sheet; sheets lie side by side */
    int32_t *cloth;        /* (branches) the sheet that all of its faces are of; -1: there is none */
    int32_t *leaves;       /* (branches) */
    /* Pairs of branches of one sheet that touch at rest, listed at the first branch, and the clusters of all
     * faces that a line between them may cross. */
    int32_t *first_pair; /* (branches + 2) */
    int32_t *other;      /* (pairs) the second branch */
    int64_t *at; /* (pairs) index in `window` of the number of its clusters, which the clusters follow */
    int32_t *window;
    drape_gradients *gradients; /* (groups of faces) */
    double (*sum)[2][3];        /* (clusters) of gradients of both ends, by column and axis */
    int64_t *fitted;            /* (clusters) the search that they are of */
} drape_flat;

/* clusters must outlive it. rest: (node_count x 3). Errors: DRAPE_E_MEMORY. */
drape_status drape_flat_create(drape_arena *arena, const drape_clusters *clusters, const double *rest,
                               drape_flat *out);

/* Whether pieces keep a distance on the path from x to y (y NULL: at x): the lesser of `reach`, and half of
 * their distance at rest plus `slack`. search: the number of the search, > 0, by which it is known what is
 * fitted. */
typedef struct drape_flat_query {
    const double *x, *y;
    double reach, slack, rounding; /* [m] */
    int64_t search;
} drape_flat_query;

/* Whether all pairs of pieces without a common node, one piece of each branch, surely keep their distance. a,
 * b: a pair that drape_clusters_descend has returned, or the root twice. */
bool drape_flat_keeps_apart(drape_flat *flat, int32_t a, int32_t b, const drape_flat_query *want);

#endif
