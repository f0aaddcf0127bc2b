/*
 * grid_square.c: a rectangle of columns x rows nodes. With u = c width / (columns - 1) and w = r height /
 * (rows - 1), node (r, c) is at
 *
 *     horizontal: (u, 0, -w), normal +y        vertical: (u, -w, 0), normal +z.
 *
 * noise moves each node off the plane by up to that distance, so that a sheet that would otherwise stand on
 * its edge for ever falls.
 *
 * The diagonals of the cells are either parallel, from (r, c) to (r+1, c+1), or alternate with r + c,
 * beginning with that one. Alternating diagonals avoid a sheet that is stiffer along one diagonal than along
 * the other.
 */
#include <math.h>

#include "mesh/grid.h"

enum { DIAGONALS = GRID_RECTANGLE_COUNT, ORIENTATION, NOISE, PARAM_COUNT };
enum { ALTERNATING, PARALLEL };

static const char *const diagonals[] = {[ALTERNATING] = "alternating", [PARALLEL] = "parallel", NULL};

static const drape_param params[PARAM_COUNT] = {
    GRID_RECTANGLE,
    [DIAGONALS] = DRAPE_CHOICE("diagonals", ALTERNATING, diagonals, "how the cells are split into triangles"),
    [ORIENTATION] = GRID_ORIENTATION,
    [NOISE] = DRAPE_NUMBER(
        "noise", "m", 0, 0, 1e9,
        "largest offset of nodes from the plane, pseudo-random and reproducible: breaks symmetry"),
};

static drape_status generate(drape_context *ctx, const char *pointer, const double *values, drape_mesh *mesh)
{
    static const bool falling[][2][2] = {
        [ALTERNATING] = {{true, false}, {false, true}}, [PARALLEL] = {{true, true}, {true, true}}};
    const int32_t columns = (int32_t)values[GRID_COLUMNS], rows = (int32_t)values[GRID_ROWS];
    const bool vertical = values[ORIENTATION] == GRID_VERTICAL;

    DRAPE_TRY(drape_grid_allocate(ctx, pointer, rows, columns, mesh));
    mesh->rectangular = true;
    double *x = mesh->x;
    for (int32_t row = 0; row < mesh->rows; row++)
        for (int32_t column = 0; column < mesh->columns; column++, x += 3) {
            const double down = -row * values[GRID_HEIGHT] / (mesh->rows - 1);
            x[0] = column * values[GRID_WIDTH] / (mesh->columns - 1);
            x[1] = vertical ? down : 0;
            x[2] = vertical ? 0 : down;
        }
    uint64_t seed = 1;
    for (size_t i = 0; values[NOISE] > 0 && i < (size_t)mesh->node_count; i++)
        mesh->x[3 * i + (vertical ? 2 : 1)] += values[NOISE] * drape_grid_random(&seed);
    /* Rows of a vertical sheet go down; those of grid.h go up. */
    drape_grid_triangulate(mesh, falling[(int)values[DIAGONALS]], vertical);
    return DRAPE_OK;
}

const drape_grid_ops drape_grid_square = {
    .entry = {.name = "square",
              .summary = "a rectangle of columns x rows nodes, horizontal or vertical",
              DRAPE_PARAMS(params)},
    .generate = generate,
};
