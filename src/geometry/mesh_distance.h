/* mesh_distance.h: the signed distance from a closed triangle mesh, or the distance from an open one. */
#ifndef DRAPE_GEOMETRY_MESH_DISTANCE_H
#define DRAPE_GEOMETRY_MESH_DISTANCE_H

#include "base/arena.h"
#include "drape/extend.h"

typedef struct drape_mesh_distance drape_mesh_distance;

/* How the side of a point is found. */
typedef enum drape_mesh_side {
    DRAPE_SIDE_NORMAL, /* by the normal where it is nearest: closed meshes that do not intersect themselves */
    DRAPE_SIDE_WINDING, /* by how often the mesh winds around it: for all closed meshes */
    DRAPE_SIDE_NONE     /* every point is outside: for open meshes */
} drape_mesh_side;

/* Prepares the points, segments and triangles of a shape; segments are the edges of its triangles, sorted by
 * (lower, higher) point, the lower one first. Returns NULL if memory is out. */
drape_mesh_distance *drape_mesh_distance_create(drape_arena *arena, const drape_collider_shape *shape,
                                                drape_mesh_side side);

/* Follows points of the shape that have moved, without building the tree anew. */
void drape_mesh_distance_refit(drape_mesh_distance *mesh, const drape_collider_shape *shape);

drape_mesh_side drape_mesh_distance_side(const drape_mesh_distance *mesh);

/* The point of the mesh that is nearest to x: its triangle, and its barycentric coordinates there. */
void drape_mesh_distance_nearest(const drape_mesh_distance *mesh, const drape_collider_shape *shape,
                                 const double *x, int32_t *triangle, double weight[3]);

/* Implements the function distance of drape_collider_ops. */
double drape_mesh_distance_at(const drape_mesh_distance *mesh, const drape_collider_shape *shape,
                              const double *x, double *normal, double *curvature);

#endif
