/* rest.c: measures a mesh at rest: areas of triangles |(x1 - x0) x (x2 - x0)| / 2, lengths of edges, and the
 * area lumped to each node, a third of each triangle around it (so that these sum to the area of the
 * sheet). */
#include "base/vec3.h"
#include "mesh/mesh.h"

drape_status drape_mesh_measure(drape_mesh *mesh)
{
    drape_arena *arena = &mesh->arena;
    mesh->triangle_area = drape_arena_take(arena, (size_t)mesh->triangle_count, sizeof *mesh->triangle_area);
    mesh->edge_length = drape_arena_take(arena, (size_t)mesh->edge_count, sizeof *mesh->edge_length);
    mesh->node_area = drape_arena_take(arena, (size_t)mesh->node_count, sizeof *mesh->node_area);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    for (int32_t triangle = 0; triangle < mesh->triangle_count; triangle++) {
        const int32_t *n = mesh->triangle + 3 * (size_t)triangle;
        double u[3], v[3], normal[3];
        vec3_sub(mesh->x + 3 * (size_t)n[1], mesh->x + 3 * (size_t)n[0], u);
        vec3_sub(mesh->x + 3 * (size_t)n[2], mesh->x + 3 * (size_t)n[0], v);
        vec3_cross(u, v, normal);
        mesh->triangle_area[triangle] = vec3_norm(normal) / 2;
        for (int k = 0; k < 3; k++)
            mesh->node_area[n[k]] += mesh->triangle_area[triangle] / 3;
    }
    for (int32_t edge = 0; edge < mesh->edge_count; edge++) {
        const int32_t *n = mesh->edge + 2 * (size_t)edge;
        double along[3];
        vec3_sub(mesh->x + 3 * (size_t)n[1], mesh->x + 3 * (size_t)n[0], along);
        mesh->edge_length[edge] = vec3_norm(along);
    }
    return DRAPE_OK;
}
