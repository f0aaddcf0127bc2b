/* mesh_distance.h: the signed distance from a closed triangle mesh. */
#ifndef DRAPE_GEOMETRY_MESH_DISTANCE_H
#define DRAPE_GEOMETRY_MESH_DISTANCE_H

#include "base/arena.h"
#include "drape/extend.h"

typedef struct drape_mesh_distance drape_mesh_distance;

/* Prepares the points, segments and triangles of a shape; segments are the edges of its triangles, sorted by
 * (lower, higher) point, the lower one first. Returns NULL if memory is out. */
const drape_mesh_distance *drape_mesh_distance_create(drape_arena *arena, const drape_collider_shape *shape);

/* Implements the function distance of drape_collider_ops. */
double drape_mesh_distance_at(const drape_mesh_distance *mesh, const drape_collider_shape *shape,
                              const double *x, double *normal, double *curvature);

#endif
