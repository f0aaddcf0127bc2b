/*
 * intersect.h: finds the edges that pass through triangles: of a cloth with itself, or of cloth and a
 * collider.
 *
 * An edge passes through a triangle if its ends lie strictly on different sides of the triangle's plane,
 * and it meets the triangle, sides and corners included. The signs are exact (drape_orient), so the
 * answer is that for the positions as doubles, however near the parts are; parts that only touch do not
 * count.
 */
#ifndef DRAPE_GEOMETRY_INTERSECT_H
#define DRAPE_GEOMETRY_INTERSECT_H

#include "model/model.h"

/* On which side of the plane a b c the point d lies: the sign of the volume of the tetrahedron a b c d, 1 if
 * a, b, c are counterclockwise seen from d, -1 if clockwise, 0 if the four points lie in a plane. The sign is
 * exact as long as each coordinate is 0 or of a magnitude between 1e-90 and 1e90. */
int drape_orient(const double *a, const double *b, const double *c, const double *d);

/* Edges and triangles over positions x (any count x 3) [m], which must be finite. */
typedef struct drape_surface {
    const double *x;
    const int32_t *edge, *triangle; /* (edge_count x 2), (triangle_count x 3) nodes */
    int32_t edge_count, triangle_count;
    const drape_model *model; /* of the cloth, for what is sewn together; NULL: nothing is */
} drape_surface;

drape_surface drape_surface_of(const drape_model *model, const double *x); /* of the cloth */

/* Whether the edge p q passes through the triangle a b c. */
bool drape_intersect_edge(const double *p, const double *q, const double *a, const double *b,
                          const double *c);

/* Calls visit for each pair of an edge of `edges` and a triangle of `triangles` that the edge passes through,
 * edges in their order. If both surfaces have the same x, that of the cloth, pairs that share a node or have
 * nodes that are sewn together do not count. Errors: DRAPE_E_MEMORY. */
typedef void drape_intersection_visit(void *user, int32_t edge, int32_t triangle);
drape_status drape_intersect(drape_context *ctx, const drape_surface *edges, const drape_surface *triangles,
                             drape_intersection_visit *visit, void *user);

typedef struct drape_intersections {
    int64_t count;
    int32_t edge[2], triangle[3]; /* nodes of the first pair; -1 if there is none */
} drape_intersections;

/* Counts the edges of cloth that pass through triangles of cloth that they do not ignore. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_find_intersections(drape_context *ctx, const drape_model *model, const double *x,
                                      drape_intersections *found);

#endif
