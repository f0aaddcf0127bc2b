/* nearest.h: the nearest triangle to a point, and the first one on a ray, in a tree of boxes. The result does
 * not depend on the shape of the tree: of equally near triangles, the one with the lowest number is found. */
#ifndef DRAPE_GEOMETRY_NEAREST_H
#define DRAPE_GEOMETRY_NEAREST_H

#include "geometry/bvh.h"

/* A place on a triangle. */
typedef struct drape_on_triangle {
    int32_t triangle;  /* -1: there is none */
    double distance;   /* [m] from the point, or along the ray */
    double weights[3]; /* of its corners */
} drape_on_triangle;

/* The nearest place to a point on a triangle of a tree that is fitted to x, if it is within a distance. */
drape_on_triangle drape_nearest_on(const drape_bvh *tree, const double *x, const double point[3],
                                   double within);

/* The first place that a ray meets, from its origin in a direction of length 1, up to `length`. */
drape_on_triangle drape_first_on_ray(const drape_bvh *tree, const double *x, const double origin[3],
                                     const double direction[3], double length);

#endif
