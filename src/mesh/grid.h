/* grid.h: what grids share: rows and columns of nodes, two triangles in each cell between them. */
#ifndef DRAPE_MESH_GRID_H
#define DRAPE_MESH_GRID_H

#include "mesh/mesh.h"

/* Room for rows x columns nodes and the triangles between them. Faults are reported at pointer. */
drape_status drape_grid_allocate(drape_context *ctx, const char *pointer, int32_t rows, int32_t columns,
                                 drape_mesh *mesh);

/*
 * Splits the cells. Node (r, c) is r * columns + c; the corners of cell (r, c) are
 *
 *     C (r+1, c)   D (r+1, c+1)
 *     A (r, c)     B (r, c+1)
 *
 * falling[r % 2][c % 2]: the cell is split from A to D into A B D and A D C, else from B to C into A B C and
 * B D C. Seen as drawn the triangles turn counterclockwise; with flip they turn clockwise. The triangles of a
 * cell follow each other, cells in the order of their A.
 */
void drape_grid_triangulate(drape_mesh *mesh, const bool falling[2][2], bool flip);

#endif
