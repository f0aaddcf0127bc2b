/*
 * grid_irregular.c: a rectangle of columns x rows nodes at irregular positions. Node (r, c) is that of the
 * grid "square", displaced by up to `jitter` of a cell, in both directions inside and along the sides on the
 * boundary; cells are split along their shorter diagonal. This removes the symmetry of a regular mesh and so
 * reveals results that depend on it.
 */
#include <math.h>

#include "base/elementary.h"
#include "mesh/grid.h"

enum { JITTER = GRID_RECTANGLE_COUNT, SEED, ORIENTATION, PARAM_COUNT };

static const drape_param params[PARAM_COUNT] = {
    GRID_RECTANGLE,
    [JITTER] =
        DRAPE_NUMBER("jitter", "1", 0.25, 0, 0.4, "largest displacement of nodes, as a fraction of a cell"),
    [SEED] = DRAPE_INTEGER("seed", "1", 1, 0, 1e9, "seed of the displacements"),
    [ORIENTATION] = GRID_ORIENTATION,
};

static double distance(const drape_mesh *mesh, int32_t a, int32_t b)
{
    const double *p = mesh->x + 3 * (size_t)a, *q = mesh->x + 3 * (size_t)b;
    return drape_hypot(drape_hypot(p[0] - q[0], p[1] - q[1]), p[2] - q[2]);
}

static drape_status generate(drape_context *ctx, const char *pointer, const double *values, drape_mesh *mesh)
{
    const bool vertical = values[ORIENTATION] == GRID_VERTICAL;
    const int32_t columns = (int32_t)values[GRID_COLUMNS], rows = (int32_t)values[GRID_ROWS];
    DRAPE_TRY(drape_grid_allocate(ctx, pointer, rows, columns, mesh));
    const int32_t last_row = mesh->rows - 1, last_column = mesh->columns - 1;
    const double jitter = values[JITTER];
    uint64_t seed = (uint64_t)values[SEED];
    double *x = mesh->x;
    for (int32_t r = 0; r < mesh->rows; r++)
        for (int32_t c = 0; c < mesh->columns; c++, x += 3) {
            const double along = jitter * drape_grid_random(&seed), down = jitter * drape_grid_random(&seed);
            const double u = c == 0 || c == last_column ? c : c + along,
                         w = r == 0 || r == last_row ? r : r + down;
            x[0] = u * values[GRID_WIDTH] / last_column;
            x[vertical ? 1 : 2] = -w * values[GRID_HEIGHT] / last_row;
        }
    /* Triangles are counterclockwise as seen from +y or +z. */
    int32_t *next = mesh->triangle;
    for (int32_t r = 0; r + 1 < mesh->rows; r++)
        for (int32_t k = 0; k + 1 < mesh->columns; k++) {
            const int32_t a = r * mesh->columns + k, c = a + mesh->columns;
            const bool falling = distance(mesh, a, c + 1) <= distance(mesh, a + 1, c);
            next = drape_grid_split(next, a, mesh->columns, falling, vertical);
        }
    return DRAPE_OK;
}

const drape_grid_ops drape_grid_irregular = {
    .entry = {.name = "irregular",
              .summary = "a rectangle of columns x rows nodes at irregular positions, to reveal results that "
                         "depend on the mesh",
              DRAPE_PARAMS(params)},
    .generate = generate,
};
