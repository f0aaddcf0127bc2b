/* embed.h: binds points to a triangle mesh, which then carries them. */
#ifndef DRAPE_GEOMETRY_EMBED_H
#define DRAPE_GEOMETRY_EMBED_H

#include "geometry/nearest.h"
#include "model/render_mesh.h"

/* Binds a point to the nearest triangle of a tree that is fitted to x (node_count x 3), so that at x the
 * bound point is where the point is. Its height is along the interpolated normals (node_count x 3), unless
 * the point is beyond their centre of curvature, else along the normal of the triangle; normals NULL: always
 * that. Returns the distance from the triangle [m]. to->triangle is a number in the tree. */
double drape_embed(const drape_bvh *tree, const double *x, const double *normals, const double point[3],
                   drape_embedded *to);

/* The same, to a triangle that the caller has found; distance: of the point from it. */
void drape_embed_in(const drape_bvh *tree, const double *x, const double *normals, const double point[3],
                    int32_t triangle, double distance, drape_embedded *to);

#endif
