/* select.c: see select.h. */
#include "compile/select.h"

#include "model/scene.h"
#include "terms/load_edges.h"

#include <math.h>
#include <string.h>

/* Takes nodes (row, column) of a grid within the ranges [first, last]. */
static drape_status take_range(const drape_selection *s, const char *key, int32_t first_row, int32_t last_row,
                               int32_t first_column, int32_t last_column)
{
    for (int32_t r = first_row; r <= last_row; r++)
        for (int32_t c = first_column; c <= last_column; c++)
            DRAPE_TRY(s->take(s->user, key, r * s->mesh->columns + c));
    return DRAPE_OK;
}

/* Narrows first and last row, first and last column to the side with which the text begins. */
static void narrow(const char *side, const drape_mesh *mesh, int32_t range[4])
{
    static const struct {
        const char *name;
        int bound; /* index of the bound that is set to the opposite one */
    } sides[] = {{"top", 1}, {"bottom", 0}, {"left", 3}, {"right", 2}};
    const int32_t opposite[4] = {mesh->rows - 1, 0, mesh->columns - 1, 0};
    for (size_t i = 0; i < sizeof sides / sizeof *sides; i++)
        if (strncmp(sides[i].name, side, strlen(sides[i].name)) == 0)
            range[sides[i].bound] = opposite[sides[i].bound];
}

/* first, second: the sides that meet in a corner; equal for a whole side. */
static drape_status take_sides(const drape_selection *s, const char *key, const char *first,
                               const char *second)
{
    const drape_mesh *mesh = s->mesh;
    int32_t range[4] = {0, mesh->rows - 1, 0, mesh->columns - 1};
    narrow(first, mesh, range);
    narrow(second, mesh, range);
    return take_range(s, key, range[0], range[1], range[2], range[3]);
}

static drape_status take_box(const drape_selection *s)
{
    const double *low = s->box_min, *high = s->box_max;
    for (int k = 0; k < 3; k++)
        if (!(low[k] <= high[k]))
            return drape_fail_below(s->ctx, s->pointer, "box", "min must not be above max in any coordinate");
    DRAPE_TRY(drape_check_cancel_after(s->ctx, 8 * (size_t)s->mesh->node_count));
    int32_t taken = 0;
    const int32_t count = s->taken ? s->mesh->node_count : drape_mesh_given(s->mesh)->node_count;
    for (int32_t i = 0; i < count; i++) {
        const double *x = s->mesh->x + 3 * (size_t)i;
        bool inside = true;
        for (int k = 0; k < 3; k++) {
            /* relative: a coordinate that is meant to lie on the boundary of a box counts as inside */
            double slack = DRAPE_BOX_SLACK * fmax(fabs(x[k]), fmax(fabs(low[k]), fabs(high[k])));
            inside = inside && low[k] - slack <= x[k] && x[k] <= high[k] + slack;
        }
        taken += inside;
        if (inside)
            DRAPE_TRY(s->take(s->user, "box", i));
    }
    if (taken == 0)
        return drape_fail_below(s->ctx, s->pointer, "box", "no node lies in the box");
    return DRAPE_OK;
}

static drape_status select_given(const drape_selection *s)
{
    const char *on_grid = s->corner ? "corner" : s->edge ? "edge" : s->row >= 0 ? "row" : NULL;
    int given = (s->nodes != NULL) + (s->corner != NULL) + (s->edge != NULL) + (s->row >= 0) + s->has_box;
    if (given != 1) {
        char wanted[128];
        return drape_refuse(s->ctx, s->pointer, "%s is needed",
                            drape_scene_one_of_text(s->form, wanted, sizeof wanted));
    }
    if (on_grid && s->mesh->rows == 0)
        return drape_fail_below(
            s->ctx, s->pointer, on_grid,
            "only a grid has rows, corners and edges; use \"nodes\" or \"box\" for this mesh");
    for (size_t i = 0; s->nodes && i < s->node_count; i++) {
        const int32_t node = s->nodes[i], count = s->mesh->node_count;
        const char *key = DRAPE_FORMAT("nodes/%zu", i);
        DRAPE_TRY(node >= 0 && node < count
                      ? s->take(s->user, key, node)
                      : drape_fail_below(s->ctx, s->pointer, key,
                                         "node %d is not in the mesh; its nodes are 0 to %d", (int)node,
                                         (int)count - 1));
    }
    if (s->nodes)
        return DRAPE_OK;
    if (s->corner)
        return take_sides(s, "corner", s->corner, strchr(s->corner, '-') + 1);
    if (s->edge)
        return take_sides(s, "edge", s->edge, s->edge);
    if (s->has_box)
        return take_box(s);
    if (s->row >= s->mesh->rows)
        return drape_fail_below(s->ctx, s->pointer, "row", "row %d is not in the mesh; its rows are 0 to %d",
                                (int)s->row, (int)s->mesh->rows - 1);
    return take_range(s, "row", s->row, s->row, 0, s->mesh->columns - 1);
}

drape_status drape_select_nodes(const drape_selection *s)
{
    const drape_mesh *mesh = s->mesh;
    const int32_t first = drape_mesh_given(mesh)->node_count;
    DRAPE_TRY(select_given(s));
    for (int32_t i = first; s->taken && i < mesh->node_count; i++) {
        const int32_t *between = mesh->parent + 2 * (size_t)(i - first);
        if (!s->taken[i] && s->taken[between[0]] && s->taken[between[1]])
            DRAPE_TRY(s->take(s->user, "nodes", i));
    }
    return DRAPE_OK;
}

int drape_compare_along(const void *a, const void *b)
{
    const drape_node_along *p = a, *q = b;
    return p->along != q->along ? (p->along > q->along) - (p->along < q->along)
                                : (p->node > q->node) - (p->node < q->node);
}
