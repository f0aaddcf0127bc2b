/*
 * midedge.h: the shape operator of a triangle from the angles of the hinges around it, with the local nodes
 * and hinges of patch.h.
 */
#ifndef DRAPE_TERMS_MIDEDGE_H
#define DRAPE_TERMS_MIDEDGE_H

#include "drape/extend.h"
#include "terms/patch.h"

enum { MIDEDGE_NODES = DRAPE_PATCH_NODES, MIDEDGE_HINGES = DRAPE_PATCH_HINGES };

typedef struct drape_midedge {
    int32_t node[MIDEDGE_NODES];  /* local to the cloth; -1: there is none */
    int32_t edge[MIDEDGE_HINGES]; /* of each hinge, -1: there is none */
    bool turned[MIDEDGE_HINGES];  /* the inner triangle of the hinge is the second one beside its edge */
    bool shifted[MIDEDGE_HINGES]; /* it has nodes that are displaced (patch.h) */
    double at_rest[MIDEDGE_NODES][3], shift[MIDEDGE_NODES][3]; /* [m] */
    bool clamped[3], free[3]; /* own edges: with a fixed normal; on the boundary and not clamped */
    int rank;                 /* number of squares in the energy: 3 less the free edges */
    /* E = 1/2 sum k (q - q0)^2 [J], q = l . K = sum c theta; theta of a clamped edge is the angle to its
     * direction. */
    double k[3], l[9], c[3][MIDEDGE_HINGES];
} drape_midedge;

/* The shape operator of a triangle. law: C of orthotropic.h [N m]; values: those of orthotropic.h. False if
 * the warp is normal to the triangle. */
bool drape_midedge_of(const drape_cloth_view *cloth, int32_t triangle, const double *values,
                      const double law[9], drape_midedge *out);

#endif
