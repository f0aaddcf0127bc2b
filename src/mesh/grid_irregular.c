/*
 * grid_irregular.c: a rectangle of columns x rows nodes out of line. Node (r, c) is that of the grid
 * "square", inside moved by up to `jitter` of a cell in both directions, on the sides along them; cells are
 * split along their shorter diagonal. What a scheme owes to the symmetry of a mesh is lost here: so do
 * results that depend on it show.
 */
#include <math.h>
#include <stdio.h>

#include "mesh/grid.h"

enum { COLUMNS, ROWS, WIDTH, HEIGHT, JITTER, SEED, ORIENTATION, PARAM_COUNT };
enum { HORIZONTAL, VERTICAL };

static const char *const orientations[] = {[HORIZONTAL] = "horizontal", [VERTICAL] = "vertical", NULL};

static const drape_param params[PARAM_COUNT] = {
    [COLUMNS] = {.name = "columns",
                 .kind = DRAPE_PARAM_INTEGER,
                 .unit = "1",
                 .default_value = NAN,
                 .min = 2,
                 .max = DRAPE_MAX_NODES / 2,
                 .help = "nodes along the width; columns x rows is at most 2^28"},
    [ROWS] = {.name = "rows",
              .kind = DRAPE_PARAM_INTEGER,
              .unit = "1",
              .default_value = NAN,
              .min = 2,
              .max = DRAPE_MAX_NODES / 2,
              .help = "nodes along the height"},
    [WIDTH] = {.name = "width",
               .kind = DRAPE_PARAM_NUMBER,
               .unit = "m",
               .default_value = NAN,
               .min = 0,
               .max = 1e9,
               .open_min = true,
               .help = "size along x"},
    [HEIGHT] = {.name = "height",
                .kind = DRAPE_PARAM_NUMBER,
                .unit = "m",
                .default_value = NAN,
                .min = 0,
                .max = 1e9,
                .open_min = true,
                .help = "size along -z, or along -y if vertical"},
    [JITTER] = {.name = "jitter",
                .kind = DRAPE_PARAM_NUMBER,
                .unit = "1",
                .default_value = 0.25,
                .min = 0,
                .max = 0.4,
                .help = "how far nodes are out of line, as a share of a cell"},
    [SEED] = {.name = "seed",
              .kind = DRAPE_PARAM_INTEGER,
              .unit = "1",
              .default_value = 1,
              .min = 0,
              .max = 1e9,
              .help = "another mesh of the same kind"},
    [ORIENTATION] = {.name = "orientation",
                     .kind = DRAPE_PARAM_CHOICE,
                     .unit = "1",
                     .default_value = HORIZONTAL,
                     .choices = orientations,
                     .help = "the plane of the sheet: y = 0 or z = 0"},
};

/* Numbers in [-1, 1) from a linear congruential generator (Knuth's MMIX): the same everywhere. */
static double next_random(uint64_t *seed)
{
    *seed = *seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(*seed >> 11) / 4503599627370496.0 - 1;
}

static void place_nodes(const double *values, bool vertical, drape_mesh *mesh)
{
    const int32_t last_row = mesh->rows - 1, last_column = mesh->columns - 1;
    const double jitter = values[JITTER];
    uint64_t seed = (uint64_t)values[SEED];
    double *x = mesh->x;
    for (int32_t r = 0; r < mesh->rows; r++)
        for (int32_t c = 0; c < mesh->columns; c++, x += 3) {
            const double along = jitter * next_random(&seed), down = jitter * next_random(&seed);
            const double u = c == 0 || c == last_column ? c : c + along,
                         w = r == 0 || r == last_row ? r : r + down;
            x[0] = u * values[WIDTH] / last_column;
            x[vertical ? 1 : 2] = -w * values[HEIGHT] / last_row;
        }
}

static double distance(const drape_mesh *mesh, int32_t a, int32_t b)
{
    const double *p = mesh->x + 3 * (size_t)a, *q = mesh->x + 3 * (size_t)b;
    return hypot(hypot(p[0] - q[0], p[1] - q[1]), p[2] - q[2]);
}

/* Triangles turn counterclockwise seen from +y or +z. */
static void split_cells(bool vertical, drape_mesh *mesh)
{
    int32_t *next = mesh->triangle;
    for (int32_t r = 0; r + 1 < mesh->rows; r++)
        for (int32_t k = 0; k + 1 < mesh->columns; k++) {
            const int32_t a = r * mesh->columns + k, b = a + 1, c = a + mesh->columns, d = c + 1;
            const bool falling = distance(mesh, a, d) <= distance(mesh, b, c);
            const int32_t triangles[6] = {a, b, falling ? d : c, falling ? a : b, d, c};
            for (int i = 0; i < 6; i++)
                next[vertical && i % 3 > 0 ? i + 3 - 2 * (i % 3) : i] = triangles[i];
            next += 6;
        }
}

static drape_status generate(drape_context *ctx, const char *pointer, const double *values, drape_mesh *mesh)
{
    const bool vertical = values[ORIENTATION] == VERTICAL;
    if (values[COLUMNS] * values[ROWS] > DRAPE_MAX_NODES) {
        char place[sizeof ctx->pointer];
        snprintf(place, sizeof place, "%s/columns", pointer);
        return drape_fail_at(ctx, DRAPE_E_ARGUMENT, place,
                             "%.0f columns x %.0f rows; at most %d nodes are allowed", values[COLUMNS],
                             values[ROWS], DRAPE_MAX_NODES);
    }
    drape_status status =
        drape_grid_allocate(ctx, pointer, (int32_t)values[ROWS], (int32_t)values[COLUMNS], mesh);
    if (status)
        return status;
    place_nodes(values, vertical, mesh);
    split_cells(vertical, mesh);
    return DRAPE_OK;
}

const drape_grid_ops drape_grid_irregular = {
    .name = "irregular",
    .summary = "a rectangle of columns x rows nodes out of line, to show what depends on the mesh",
    .params = params,
    .param_count = PARAM_COUNT,
    .generate = generate,
};
