/* grid.h: what all grids share: rows and columns of nodes, with two triangles in each cell between them. */
#ifndef DRAPE_MESH_GRID_H
#define DRAPE_MESH_GRID_H

#include "mesh/mesh.h"

/* Checks that columns x rows is at most DRAPE_MAX_NODES; the fault is reported at pointer/columns. Errors:
 * DRAPE_E_ARGUMENT. */
drape_status drape_grid_check_size(drape_context *ctx, const char *pointer, int64_t columns, int64_t rows);

/* Returns a number in [-1, 1) from a linear congruential generator (Knuth's MMIX): the same on every
 * machine. */
double drape_grid_random(uint64_t *seed);

/* Checks that as drape_grid_check_size does; then allocates the nodes and the triangles between them. */
drape_status drape_grid_allocate(drape_context *ctx, const char *pointer, int32_t rows, int32_t columns,
                                 drape_mesh *mesh);

/*
 * Splits the cells into triangles. Node (r, c) is r * columns + c; the corners of cell (r, c) are
 *
 *     C (r+1, c)   D (r+1, c+1)
 *     A (r, c)     B (r, c+1)
 *
 * If falling[r % 2][c % 2] is true, the cell is split from A to D into A B D and A D C, otherwise from B to C
 * into A B C and B D C. Seen as drawn, the triangles are counterclockwise; with flip they are clockwise. The
 * triangles of a cell are consecutive, and cells are in the order of their A. drape_grid_split splits one
 * cell with the corner A = a, drape_grid_put writes one triangle; both return the place of the next one.
 */
int32_t *drape_grid_put(int32_t *triangle, int32_t a, int32_t b, int32_t c, bool flip);
int32_t *drape_grid_split(int32_t *triangle, int32_t a, int32_t columns, bool falling, bool flip);
void drape_grid_triangulate(drape_mesh *mesh, const bool falling[2][2], bool flip);

/* Parameters of grids: a number of nodes along one side, at most 2^28 / share; a length. */
#define GRID_NODES(name, min, share, help)                                                                   \
    DRAPE_INTEGER(name, "1", DRAPE_REQUIRED, min, DRAPE_MAX_NODES / (share), help)
#define GRID_LENGTH(name, help) DRAPE_NUMBER(name, "m", DRAPE_REQUIRED, DRAPE_ABOVE(0), 1e9, help)

/* Parameters of rectangles, the first ones of each rectangular grid, and the plane of the sheet. */
enum { GRID_COLUMNS, GRID_ROWS, GRID_WIDTH, GRID_HEIGHT, GRID_RECTANGLE_COUNT };
enum { GRID_HORIZONTAL, GRID_VERTICAL };
extern const char *const drape_grid_orientations[];
#define GRID_COLUMNS_HELP "nodes along the width, or on each circle; columns x rows is at most 2^28"
#define GRID_ROWS_HELP    "nodes along the height, or circles of nodes, the top one first"
#define GRID_RECTANGLE                                                                                       \
    [GRID_COLUMNS] = GRID_NODES("columns", 2, 2, GRID_COLUMNS_HELP),                                         \
    [GRID_ROWS] = GRID_NODES("rows", 2, 2, GRID_ROWS_HELP),                                                  \
    [GRID_WIDTH] = GRID_LENGTH("width", "size along x"),                                                     \
    [GRID_HEIGHT] = GRID_LENGTH("height", "size along -z, or along -y if vertical")
#define GRID_ORIENTATION                                                                                     \
    DRAPE_CHOICE("orientation", GRID_HORIZONTAL, drape_grid_orientations,                                    \
                 "the plane of the sheet: y = 0 or z = 0")

#endif
