/*
 * patch.h: the triangles around a triangle, unfolded into its plane.
 *
 * Local nodes: 0 1 2 of the triangle; 3 + i the apex beyond its edge i, which goes from node i to node i + 1;
 * 6 + 2 i and 7 + 2 i the apices beyond the two other edges of that neighbour. Hinges: 0 1 2 at its own
 * edges; 3 + 2 i and 4 + 2 i at those of neighbour i.
 *
 * A patch goes on across periodic edges: its nodes beyond one are those of the other side, displaced by
 * shift.
 */
#ifndef DRAPE_TERMS_PATCH_H
#define DRAPE_TERMS_PATCH_H

#include "drape/extend.h"

enum { DRAPE_PATCH_NODES = 12, DRAPE_PATCH_HINGES = 9 };

/* Local nodes of each hinge: x0 x1 the edge, x2 the inner apex, x3 the outer one. */
extern const int drape_patch_hinge[DRAPE_PATCH_HINGES][4];

typedef struct drape_patch {
    int32_t node[DRAPE_PATCH_NODES];    /* local to the cloth; -1: there is none */
    int32_t edge[DRAPE_PATCH_HINGES];   /* of each hinge; -1: there is none */
    int32_t beyond[DRAPE_PATCH_HINGES]; /* the triangle beyond each hinge; -1: there is none */
    bool turned[DRAPE_PATCH_HINGES]; /* the inner triangle of the hinge is the second one beside its edge */
    double flat[2 * DRAPE_PATCH_NODES];   /* the nodes unfolded into the plane of the triangle [m] */
    bool shifted[DRAPE_PATCH_HINGES];     /* the hinge is at a periodic edge, or has nodes beyond one */
    double at_rest[DRAPE_PATCH_NODES][3]; /* [m] displacements of the nodes at rest */
    double shift[DRAPE_PATCH_NODES][3];   /* [m] the same by the period */
} drape_patch;

/* The triangle beyond an edge, in the numbers of its own nodes. */
typedef struct drape_beyond {
    int32_t triangle, apex;      /* -1: there is none */
    int32_t a, b;                /* the nodes of the edge */
    bool across;                 /* a periodic edge */
    double at_rest[3], shift[3]; /* [m] by which it is displaced so that it lies beside the edge */
} drape_beyond;

/* What lies beyond an edge of a triangle, from its node a to its node b. */
drape_beyond drape_beyond_edge(const drape_cloth_view *cloth, int32_t triangle, int32_t edge, int32_t a,
                               int32_t b);

/* The patch of a triangle, from its corners in its plane, flat (3 x 2). */
void drape_patch_around(const drape_cloth_view *cloth, int32_t triangle, const double flat[6],
                        drape_patch *out);

/* The smallest c (n) with sum_j c_j m_j = target, for m (3 x n), by the eigenvalues of m m'. Directions of
 * the target that m hardly has, with an eigenvalue below 1e-4 of the largest, are left out. */
void drape_least_solution(const double *m, int n, const double target[3], double *c);

#endif
