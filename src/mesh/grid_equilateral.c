/*
 * grid_equilateral.c: a sheet of equilateral triangles in the plane y = 0, with normal +y. With e edges of
 * length l in each row and s strips of triangles (default: s = e), node (r, c) is at
 *
 *     x = (c + (r odd ? 1/2 : 0)) l,    z = -r sqrt(3)/2 l,    0 <= c <= e,  0 <= r <= s.
 *
 * Each row is shifted by half an edge against the one before, alternately right and left, so the short
 * diagonal of the cells alternates: B-C from an even to an odd row, A-D from an odd to an even one (letters
 * as in grid.h). Every edge of the resulting cloth has length l; with s = e it has 2 e^2 triangles, e (3 e +
 * 2) edges and e (3 e - 2) hinges.
 */
#include <math.h>

#include "mesh/grid.h"

enum { EDGES, EDGE_LENGTH, STRIPS, PARAM_COUNT };

/* MAX_EDGES + 1 nodes along each side give DRAPE_MAX_NODES. */
#define MAX_EDGES 16383

static const drape_param params[PARAM_COUNT] = {
    [EDGES] = DRAPE_INTEGER("edges", "1", DRAPE_REQUIRED, 1, MAX_EDGES,
                            "edges along each side; the sheet has (edges + 1)^2 nodes, at most 2^28"),
    [EDGE_LENGTH] = GRID_LENGTH("edge_length", "length of every edge"),
    [STRIPS] = DRAPE_INTEGER("strips", "1", DRAPE_DERIVED("as many as edges"), 1, MAX_EDGES,
                             "strips of triangles, one less than rows of nodes"),
};

static drape_status generate(drape_context *ctx, const char *pointer, const double *values, drape_mesh *mesh)
{
    static const bool falling[2][2] = {{false, false}, {true, true}};
    const int32_t columns = (int32_t)values[EDGES] + 1,
                  rows = isnan(values[STRIPS]) ? columns : (int32_t)values[STRIPS] + 1;
    const double length = values[EDGE_LENGTH];

    DRAPE_TRY(drape_grid_allocate(ctx, pointer, rows, columns, mesh));
    double *x = mesh->x;
    for (int32_t row = 0; row < rows; row++)
        for (int32_t column = 0; column < columns; column++, x += 3) {
            x[0] = (column + (row % 2 ? 0.5 : 0.0)) * length;
            x[1] = 0;
            x[2] = -row * (sqrt(3.0) / 2 * length);
        }
    drape_grid_triangulate(mesh, falling, false);
    return DRAPE_OK;
}

const drape_grid_ops drape_grid_equilateral = {
    .entry = {.name = "equilateral",
              .summary = "equilateral triangles in rows, every second row shifted by half an edge",
              DRAPE_PARAMS(params)},
    .generate = generate,
};
