/* tree.h: the nearest point of a closed triangle mesh, by a tree of boxes, and the side that a point is on. */
#ifndef DRAPE_COLLIDERS_TREE_H
#define DRAPE_COLLIDERS_TREE_H

#include "colliders/colliders.h"

typedef struct drape_tree drape_tree;

/* Of the triangles of a shape; it lives as long as the shape's model. NULL: out of memory. */
const drape_tree *drape_tree_make(drape_collider_shape *shape);

/* As the function distance of a row. */
double drape_tree_distance(const drape_tree *tree, const drape_collider_shape *shape, const double *x,
                           double *normal, double *curvature);

#endif
