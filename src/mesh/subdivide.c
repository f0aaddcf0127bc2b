/* subdivide.c: each triangle in four, by the middles of its edges. Nodes keep their numbers, and the middle
 * of edge e follows with the number node_count + e, so that a boundary, a hole and a fold stay as they are.
 * Piece k < 3 of triangle t, number 4 t + k, has the corner k of t as its own; piece 3 is between them. */
#include "mesh/mesh.h"

#include <string.h>

static drape_status split(drape_context *ctx, const drape_mesh_source *source, drape_mesh *mesh)
{
    const size_t nodes = (size_t)mesh->node_count, edges = (size_t)mesh->edge_count,
                 triangles = (size_t)mesh->triangle_count, parents = nodes - (size_t)mesh->given->node_count;
    double *x = drape_arena_resize(&mesh->arena, mesh->x, nodes + edges, 3 * sizeof *x);
    mesh->x = x ? x : mesh->x;
    int32_t *parent = drape_arena_resize(&mesh->arena, mesh->parent, parents + edges, 2 * sizeof *parent),
            *piece = drape_arena_take(&mesh->arena, 4 * triangles, 3 * sizeof *piece);
    if (!x || !parent || !piece)
        return DRAPE_E_MEMORY;
    memcpy(parent + 2 * parents, mesh->edge, 2 * edges * sizeof *parent);
    for (size_t t = 0; t < triangles; t++)
        for (size_t k = 0; k < 3; k++) {
            int32_t *of = piece + 12 * t;
            const int32_t middle = mesh->node_count + mesh->triangle_edge[3 * t + k];
            of[3 * k + k] = mesh->triangle[3 * t + k];
            of[3 * k + (k + 1) % 3] = middle;
            of[3 * ((k + 1) % 3) + k] = middle;
            of[9 + k] = middle;
        }
    drape_mesh_drop_topology(mesh);
    drape_arena_release(&mesh->arena, mesh->edge);
    mesh->parent = parent;
    mesh->triangle = piece;
    mesh->node_count += mesh->edge_count;
    mesh->triangle_count *= 4;
    drape_mesh_fill_middles(mesh, mesh->x);
    return drape_mesh_connect(ctx, source, mesh);
}

drape_status drape_mesh_subdivide(drape_context *ctx, const drape_mesh_source *source, int times,
                                  drape_mesh *mesh)
{
    int64_t nodes = mesh->node_count, edges = mesh->edge_count, triangles = mesh->triangle_count;
    mesh->subdivided = times;
    if (times == 0)
        return DRAPE_OK;
    for (int i = 0; i < times; i++) { /* before any of them is made */
        nodes += edges;
        edges = 2 * edges + 3 * triangles;
        triangles *= 4;
        if (nodes > DRAPE_MAX_NODES)
            return drape_mesh_fail(ctx, source, 0, "subdivided, it has more than %d nodes", DRAPE_MAX_NODES);
    }
    if (!(mesh->given = drape_arena_take(&mesh->arena, 1, sizeof *mesh->given)))
        return DRAPE_E_MEMORY;
    *mesh->given = (drape_mesh){.node_count = mesh->node_count,
                                .triangle_count = mesh->triangle_count,
                                .triangle = mesh->triangle,
                                .faces = mesh->faces};
    mesh->faces = (drape_faces){0};
    for (int i = 0; i < times; i++) {
        DRAPE_TRY(drape_check_cancel(ctx));
        DRAPE_TRY(split(ctx, source, mesh));
    }
    return DRAPE_OK;
}

void drape_mesh_fill_middles(const drape_mesh *mesh, double *values)
{
    const size_t first = (size_t)drape_mesh_given(mesh)->node_count;
    for (size_t i = first; i < (size_t)mesh->node_count; i++) {
        const int32_t *of = mesh->parent + 2 * (i - first);
        for (size_t k = 0; k < 3; k++)
            values[3 * i + k] = (values[3 * (size_t)of[0] + k] + values[3 * (size_t)of[1] + k]) / 2;
    }
}
