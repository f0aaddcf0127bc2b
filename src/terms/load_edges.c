/* load_edges.c: see load_edges.h. */
#include "terms/load_edges.h"

#include "terms/terms.h"

#include <math.h>

enum { ALL, TOP, BOTTOM, LEFT, RIGHT };
const char *const drape_load_edges[] = {
    [ALL] = "all", [TOP] = "top", [BOTTOM] = "bottom", [LEFT] = "left", [RIGHT] = "right", NULL};

bool drape_load_in_box(const double *x, const double *low, const double *high)
{
    for (int k = 0; k < 3; k++) {
        const double slack = DRAPE_BOX_SLACK * fmax(fabs(x[k]), 1);
        if (!(x[k] >= low[k] - slack && x[k] <= high[k] + slack))
            return false;
    }
    return true;
}

static bool on_side(const drape_cloth_view *cloth, int side, int32_t node)
{
    if (node >= cloth->given_count) {
        const int32_t *between = cloth->parent + 2 * (size_t)(node - cloth->given_count);
        return on_side(cloth, side, between[0]) && on_side(cloth, side, between[1]);
    }
    const int32_t row = node / cloth->columns, column = node % cloth->columns;
    return side == TOP      ? row == 0
           : side == BOTTOM ? row == cloth->rows - 1
           : side == LEFT   ? column == 0
                            : column == cloth->columns - 1;
}

bool drape_load_takes(const drape_cloth_view *cloth, const double *values, int32_t e)
{
    const int side = (int)values[DRAPE_LOAD_EDGE];
    const int32_t *end = cloth->edge + 2 * (size_t)e;
    if (!drape_on_boundary(cloth, e))
        return false;
    for (int k = 0; k < 2; k++)
        if ((side != ALL && !on_side(cloth, side, end[k])) ||
            !drape_load_in_box(cloth->rest + 3 * (size_t)end[k], values + DRAPE_LOAD_BOX_MIN,
                               values + DRAPE_LOAD_BOX_MAX))
            return false;
    return true;
}

drape_status drape_load_count(const drape_cloth_view *cloth, const double *values,
                              drape_term_builder *builder, int32_t *count)
{
    const int side = (int)values[DRAPE_LOAD_EDGE];
    *count = 0;
    if (side != ALL && cloth->columns == 0)
        return drape_term_refuse(
            builder, "\"edge\": \"%s\" is a side of a grid, and this mesh is not a grid: give a box",
            drape_load_edges[side]);
    for (int32_t e = 0; e < cloth->edge_count; e++)
        *count += drape_load_takes(cloth, values, e);
    if (*count == 0)
        return drape_term_refuse(
            builder, cloth->edge_image
                         ? "no edge of the boundary of the mesh lies in the box; periodic edges are none"
                         : "no edge of the boundary of the mesh lies in the box");
    return DRAPE_OK;
}

/* Whether triangle t goes from node a to node b. */
static bool goes(const drape_cloth_view *cloth, int32_t t, int32_t a, int32_t b)
{
    const int32_t *corner = cloth->triangle + 3 * (size_t)t;
    bool found = false;
    for (int k = 0; k < 3; k++)
        found = found || (corner[k] == a && corner[(k + 1) % 3] == b);
    return found;
}

drape_status drape_load_check_faces(const drape_cloth_view *cloth, drape_term_builder *builder)
{
    for (int32_t e = 0; e < cloth->edge_count; e++) {
        const int32_t *end = cloth->edge + 2 * (size_t)e, *beside = cloth->edge_triangle + 2 * (size_t)e;
        if (beside[1] >= 0 &&
            goes(cloth, beside[0], end[0], end[1]) == goes(cloth, beside[1], end[0], end[1]))
            return drape_term_refuse(
                builder,
                "triangles %d and %d beside the edge between nodes %d and %d have opposite "
                "orientations, with normals on different sides of the sheet: orient all faces "
                "of the mesh alike",
                (int)beside[0], (int)beside[1], (int)end[0], (int)end[1]);
    }
    return DRAPE_OK;
}
