/* grid.c: see grid.h; also generates the grid that a def names. */
#include "mesh/grid.h"

#include "base/param.h"

const char *const drape_grid_orientations[] = {
    [GRID_HORIZONTAL] = "horizontal", [GRID_VERTICAL] = "vertical", NULL};

drape_status drape_grid_check_size(drape_context *ctx, const char *pointer, int64_t columns, int64_t rows)
{
    if (columns * rows <= DRAPE_MAX_NODES)
        return DRAPE_OK;
    return drape_fail_below(
        ctx, pointer, "columns", "%lld columns x %lld rows are %lld nodes; at most %d are allowed",
        (long long)columns, (long long)rows, (long long)(columns * rows), DRAPE_MAX_NODES);
}

drape_status drape_grid_allocate(drape_context *ctx, const char *pointer, int32_t rows, int32_t columns,
                                 drape_mesh *mesh)
{
    const drape_mesh_source source = {.pointer = pointer};
    DRAPE_TRY(drape_grid_check_size(ctx, pointer, columns, rows));
    mesh->rows = rows;
    mesh->columns = columns;
    return drape_mesh_allocate(ctx, &source, (size_t)rows * (size_t)columns,
                               2 * (size_t)(rows - 1) * (size_t)(columns - 1), mesh);
}

double drape_grid_random(uint64_t *seed)
{
    *seed = *seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(*seed >> 11) / 4503599627370496.0 - 1;
}

int32_t *drape_grid_put(int32_t *triangle, int32_t a, int32_t b, int32_t c, bool flip)
{
    triangle[0] = a;
    triangle[1] = flip ? c : b;
    triangle[2] = flip ? b : c;
    return triangle + 3;
}

int32_t *drape_grid_split(int32_t *triangle, int32_t a, int32_t columns, bool falling, bool flip)
{
    const int32_t b = a + 1, c = a + columns, d = c + 1;
    int32_t *next = drape_grid_put(triangle, a, b, falling ? d : c, flip);
    return drape_grid_put(next, falling ? a : b, d, c, flip);
}

void drape_grid_triangulate(drape_mesh *mesh, const bool falling[2][2], bool flip)
{
    int32_t *next = mesh->triangle;
    for (int32_t row = 0; row + 1 < mesh->rows; row++)
        for (int32_t column = 0; column + 1 < mesh->columns; column++)
            next = drape_grid_split(next, row * mesh->columns + column, mesh->columns,
                                    falling[row % 2][column % 2], flip);
}

drape_status drape_mesh_from_grid(drape_context *ctx, const char *pointer, const drape_entry_def *grid,
                                  drape_mesh *mesh)
{
    int i;
    const char *place = DRAPE_FORMAT("%s/grid", pointer);
    DRAPE_TRY(drape_registry_choose(ctx, &drape_grid_registry, place, grid->type, &i));

    const drape_grid_ops *ops = drape_grids[i];
    double values[DRAPE_MAX_PARAMS];
    DRAPE_TRY(drape_params_resolve(ctx, pointer, &ops->entry, grid->settings, grid->setting_count, values));
    return ops->generate(ctx, pointer, values, mesh);
}
