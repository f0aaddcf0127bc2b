/* remedy.h: what an author of a mesh can do about a fault, as the end of its message: "; remedy: ...". */
#ifndef DRAPE_MESH_REMEDY_H
#define DRAPE_MESH_REMEDY_H

#include "mesh/mesh.h"

#define DRAPE_REMEDY_SIZE 256

/* Of edges with one triangle, in a mesh that must be closed and has been connected: merging vertices, where
 * that closes it and these are far closer than the mesh is fine, with the distance to be given; otherwise
 * filling the hole, with its place. Without memory the second one. */
void drape_remedy_open(drape_context *ctx, const drape_mesh *mesh, char text[DRAPE_REMEDY_SIZE]);

/* Of a triangle without area: merging its two nearest corners or, if nodes must not be merged because other
 * things have their numbers, moving them apart; or moving the one on the line between the others; nothing for
 * a grid. */
void drape_remedy_degenerate(const drape_mesh *mesh, const int32_t *triangle, bool may_merge,
                             char text[DRAPE_REMEDY_SIZE]);

#endif
