/* embed.h: binds points to a triangle mesh, which then carries them. */
#ifndef DRAPE_GEOMETRY_EMBED_H
#define DRAPE_GEOMETRY_EMBED_H

#include "geometry/nearest.h"
#include "model/render_mesh.h"

/* Binds a point to the nearest triangle of a tree that is fitted to x (node_count x 3): bound, it is where it
 * was. With normals (node_count x 3) it is along those, unless it is beyond their centre of curvature; NULL:
 * it is flat. Returns its distance from the triangle [m]. triangle is its number in the tree. */
double drape_embed(const drape_bvh *tree, const double *x, const double *normals, const double point[3],
                   drape_embedded *to);

#endif
