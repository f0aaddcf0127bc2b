/* topology.c: unique edges, the triangles beside them, and hinges. Each triangle has three sides. Sorting the
 * sides by (lower node, higher node) forms runs, and each run is an edge: with one side on the boundary, and
 * with two sides inside, where the edge is a hinge. */
#include "mesh/mesh.h"

/* Radix sort: one stable counting sort per part of the key, from the last part to the first. It takes
 * O(parts (count + limit)) for any input; hash tables and quicksort have bad cases. */
int32_t *drape_order_by_keys(drape_arena *arena, const int32_t *key, int parts, int32_t count, int32_t limit)
{
    int32_t *order = drape_arena_take(arena, (size_t)count, sizeof *order);
    int32_t *other = drape_arena_take(arena, (size_t)count, sizeof *other);
    int32_t *start = drape_arena_take(arena, (size_t)limit + 1, sizeof *start);
    if (drape_arena_status(arena))
        return NULL;
    for (int32_t i = 0; i < count; i++)
        order[i] = i;
    for (int part = parts - 1; part >= 0; part--) {
        for (int32_t value = 0; value <= limit; value++)
            start[value] = 0;
        for (int32_t i = 0; i < count; i++)
            start[key[(size_t)i * (size_t)parts + (size_t)part] + 1]++;
        for (int32_t value = 0; value < limit; value++)
            start[value + 1] += start[value];
        for (int32_t i = 0; i < count; i++)
            other[start[key[(size_t)order[i] * (size_t)parts + (size_t)part]]++] = order[i];
        int32_t *sorted = other;
        other = order;
        order = sorted;
    }
    return order;
}

/* Returns the length of the run of equal sides that begins at place `first` of the order. */
static int32_t run_length(const int32_t *side, const int32_t *order, int32_t first, int32_t count)
{
    const int32_t *edge = side + 2 * (size_t)order[first];
    int32_t next = first + 1;
    while (next < count && side[2 * (size_t)order[next]] == edge[0] &&
           side[2 * (size_t)order[next] + 1] == edge[1])
        next++;
    return next - first;
}

static drape_status count_edges(drape_context *ctx, const drape_mesh_source *source, const int32_t *side,
                                const int32_t *order, drape_mesh *mesh)
{
    const int32_t count = 3 * mesh->triangle_count;
    int32_t wrong = 0, worst[5] = {0}; /* edges of more than two triangles; the first of them */
    mesh->edge_count = 0;
    mesh->hinge_count = 0;
    for (int32_t first = 0, length; first < count; first += length) {
        length = run_length(side, order, first, count);
        const int32_t *same = order + first, *edge = side + 2 * (size_t)same[0];
        if (length > 2 && wrong++ == 0)
            for (int k = 0; k < 5; k++)
                worst[k] = k < 2 ? edge[k] : same[k - 2] / 3;
        mesh->edge_count++;
        mesh->hinge_count += length == 2;
    }
    if (wrong == 0)
        return DRAPE_OK;
    const double *a = mesh->x + 3 * (size_t)worst[0], *b = mesh->x + 3 * (size_t)worst[1];
    return drape_mesh_fail(
        ctx, source, 0,
        "edge %d %d is shared by triangles %d, %d and %d; at most two may share an edge; remedy: "
        "delete the others, or give them an edge of their own, between (%.4g, %.4g, %.4g) and "
        "(%.4g, %.4g, %.4g) m, the first of %d such places",
        worst[0], worst[1], worst[2], worst[3], worst[4], a[0], a[1], a[2], b[0], b[1], b[2], wrong);
}

/* Returns the node of the triangle that is opposite to its side s. */
static int32_t apex(const drape_mesh *mesh, int32_t s)
{
    return mesh->triangle[s % 3 == 0 ? s + 2 : s - 1];
}

static void fill_edges(const int32_t *side, const int32_t *order, drape_mesh *mesh)
{
    const int32_t count = 3 * mesh->triangle_count;
    int32_t *hinge = mesh->hinge, *hinge_edge = mesh->hinge_edge;
    int32_t edge = 0;
    for (int32_t first = 0, length; first < count; first += length, edge++) {
        length = run_length(side, order, first, count);
        const int32_t *same = order + first, *ends = side + 2 * (size_t)same[0];
        mesh->edge[2 * (size_t)edge] = ends[0];
        mesh->edge[2 * (size_t)edge + 1] = ends[1];
        for (int32_t k = 0; k < length; k++)
            mesh->triangle_edge[same[k]] = edge;
        mesh->edge_triangle[2 * (size_t)edge] = same[0] / 3;
        mesh->edge_triangle[2 * (size_t)edge + 1] = length == 2 ? same[1] / 3 : -1;
        if (length == 2) {
            *hinge_edge++ = edge;
            *hinge++ = ends[0];
            *hinge++ = ends[1];
            *hinge++ = apex(mesh, same[0]);
            *hinge++ = apex(mesh, same[1]);
        }
    }
}

drape_status drape_mesh_connect(drape_context *ctx, const drape_mesh_source *source, drape_mesh *mesh)
{
    drape_status status = DRAPE_E_MEMORY;
    drape_arena scratch = drape_arena_of(ctx);
    /* (3 T x 2) Side s = 3 t + k of triangle t lies between its nodes k and k + 1, lower node first. */
    const size_t count = 3 * (size_t)mesh->triangle_count;
    int32_t *side = drape_arena_take(&scratch, count, 2 * sizeof *side), *order = NULL;
    for (size_t s = 0; side && s < count; s++) {
        const int32_t a = mesh->triangle[s], b = mesh->triangle[s % 3 == 2 ? s - 2 : s + 1];
        side[2 * s] = a < b ? a : b;
        side[2 * s + 1] = a < b ? b : a;
    }
    if (side)
        order = drape_order_by_keys(&scratch, side, 2, (int32_t)count, mesh->node_count);
    if (order)
        status = count_edges(ctx, source, side, order, mesh);
    if (!status) {
        drape_arena *arena = &mesh->arena;
        mesh->edge = drape_arena_take(arena, (size_t)mesh->edge_count, 2 * sizeof *mesh->edge);
        mesh->edge_triangle =
            drape_arena_take(arena, (size_t)mesh->edge_count, 2 * sizeof *mesh->edge_triangle);
        mesh->triangle_edge =
            drape_arena_take(arena, (size_t)mesh->triangle_count, 3 * sizeof *mesh->triangle_edge);
        mesh->hinge = drape_arena_take(arena, (size_t)mesh->hinge_count, 4 * sizeof *mesh->hinge);
        mesh->hinge_edge = drape_arena_take(arena, (size_t)mesh->hinge_count, sizeof *mesh->hinge_edge);
        status = drape_arena_status(arena);
    }
    if (!status)
        fill_edges(side, order, mesh);
    drape_arena_free(&scratch);
    return status;
}

int32_t drape_edge_between(const int32_t *edge, int32_t edge_count, int32_t a, int32_t b)
{
    const int32_t lower = a < b ? a : b, higher = a < b ? b : a;
    int32_t low = 0, high = edge_count;
    while (low < high) {
        const int32_t middle = low + (high - low) / 2, *end = edge + 2 * (size_t)middle;
        if (end[0] < lower || (end[0] == lower && end[1] < higher))
            low = middle + 1;
        else
            high = middle;
    }
    const int32_t *found = edge + 2 * (size_t)low;
    return low < edge_count && found[0] == lower && found[1] == higher ? low : -1;
}
