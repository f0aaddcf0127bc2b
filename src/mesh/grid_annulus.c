/*
 * grid_annulus.c: a ring between two circles about the y axis, in the plane y = 0, with normal +y. Rows are
 * circles from the inner to the outer one: pins on row 0 or the edge "top" hold the inner rim, "bottom" is
 * the outer rim. Columns are spokes, the last one next to the first. Every second circle is rotated by half a
 * spoke. Node (r, c) is at
 *
 *     R = inner + r (outer - inner)/(circles - 1),  a = 2 pi (c + (r odd ? 1/2 : 0))/spokes,
 *     x = R cos a,  z = -R sin a
 */
#include <math.h>

#include "base/elementary.h"
#include "mesh/grid.h"

enum { CIRCLES, SPOKES, INNER, OUTER, PARAM_COUNT };

static const drape_param params[PARAM_COUNT] = {
    [CIRCLES] =
        GRID_NODES("rows", 2, 3, "circles of nodes, the inner one first; columns x rows is at most 2^28"),
    [SPOKES] = GRID_NODES("columns", 3, 2, "nodes on each circle"),
    [INNER] = GRID_LENGTH("inner_radius", "radius of the hole"),
    [OUTER] = GRID_LENGTH("outer_radius", "radius of the rim; larger than inner_radius"),
};

static drape_status generate(drape_context *ctx, const char *pointer, const double *values, drape_mesh *mesh)
{
    const int32_t columns = (int32_t)values[SPOKES], rows = (int32_t)values[CIRCLES];
    const drape_mesh_source source = {.pointer = pointer};
    DRAPE_TRY(drape_grid_check_size(ctx, pointer, columns, rows));
    if (!(values[OUTER] > values[INNER]))
        return drape_fail_below(ctx, pointer, "outer_radius", "%g m; it is larger than inner_radius, %g m",
                                values[OUTER], values[INNER]);
    DRAPE_TRY(drape_mesh_allocate(ctx, &source, (size_t)rows * (size_t)columns,
                                  2 * (size_t)(rows - 1) * (size_t)columns, mesh));
    mesh->rows = rows;
    mesh->columns = columns;
    const double two_pi = 6.28318530717958647693, inner = values[INNER],
                 step = (values[OUTER] - inner) / (mesh->rows - 1);
    double *x = mesh->x;
    for (int32_t r = 0; r < mesh->rows; r++)
        for (int32_t c = 0; c < mesh->columns; c++, x += 3) {
            const double angle = two_pi * (c + (r % 2 ? 0.5 : 0)) / mesh->columns, radius = inner + r * step;
            double sine, cosine;
            drape_sin_cos(angle, &sine, &cosine);
            x[0] = radius * cosine;
            x[1] = 0;
            x[2] = -radius * sine;
        }
    /* Letters as in grid.h, with r outwards. A node of a rotated circle lies between two of the next one. */
    int32_t *next = mesh->triangle;
    for (int32_t r = 0; r + 1 < mesh->rows; r++)
        for (int32_t k = 0; k < mesh->columns; k++) {
            const int32_t after = (k + 1) % mesh->columns, row = r * mesh->columns;
            const int32_t a = row + k, b = row + after, c = a + mesh->columns, d = b + mesh->columns;
            next = drape_grid_put(next, a, r % 2 ? d : c, b, false);
            next = drape_grid_put(next, r % 2 ? a : b, c, d, false);
        }
    return DRAPE_OK;
}

const drape_grid_ops drape_grid_annulus = {
    .entry = {.name = "annulus",
              .summary =
                  "a ring between two circles, like the overhanging part of the cloth in a drape tester",
              DRAPE_PARAMS(params)},
    .generate = generate,
};
