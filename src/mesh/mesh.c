/* mesh.c: makes a mesh from its def, stage by stage, and frees it. */
#include "mesh/mesh.h"
#include "base/vec3.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

drape_status drape_mesh_fail(drape_context *ctx, const drape_mesh_source *source, int64_t line,
                             const char *format, ...)
{
    char text[DRAPE_MESSAGE_SIZE];
    const locale_t old = drape_locale_enter();
    va_list args;
    va_start(args, format);
    const int used = snprintf(text, sizeof text, "%s", source->part ? source->part : "");
    vsnprintf(text + used, sizeof text - (size_t)used, format, args);
    va_end(args);
    drape_locale_leave(old);

    if (!source->file)
        return drape_refuse(ctx, source->pointer, "%s", text);
    if (line == 0)
        return drape_fail_at(ctx, DRAPE_E_PARSE, source->pointer, "%s: %s", source->file, text);
    return drape_fail_at(ctx, DRAPE_E_PARSE, source->pointer, "%s:%lld: %s", source->file, (long long)line,
                         text);
}

drape_status drape_mesh_allocate(drape_context *ctx, const drape_mesh_source *source, size_t node_count,
                                 size_t triangle_count, drape_mesh *mesh)
{
    if (node_count > DRAPE_MAX_NODES)
        return drape_mesh_fail(ctx, source, 0, "%zu nodes; at most %d are allowed", node_count,
                               DRAPE_MAX_NODES);
    if (triangle_count > DRAPE_MAX_TRIANGLES)
        return drape_mesh_fail(ctx, source, 0, "%zu triangles; at most %d are allowed", triangle_count,
                               DRAPE_MAX_TRIANGLES);
    mesh->arena = drape_arena_of(ctx);
    mesh->x = drape_arena_take(&mesh->arena, node_count, 3 * sizeof *mesh->x);
    mesh->triangle = drape_arena_take(&mesh->arena, triangle_count, 3 * sizeof *mesh->triangle);
    mesh->node_count = (int32_t)node_count;
    mesh->triangle_count = (int32_t)triangle_count;
    return drape_arena_status(&mesh->arena);
}

drape_status drape_mesh_from_arrays(drape_context *ctx, const char *pointer, const double *x,
                                    size_t node_count, const int32_t *triangle, size_t triangle_count,
                                    drape_mesh *mesh)
{
    const drape_mesh_source source = {.pointer = pointer};
    if (!x || !triangle)
        return drape_mesh_fail(ctx, &source, 0, "\"%s\" is missing: a mesh needs positions and triangles",
                               x ? "triangles" : "positions");
    DRAPE_TRY(drape_mesh_allocate(ctx, &source, node_count, triangle_count, mesh));
    memcpy(mesh->x, x, 3 * node_count * sizeof *x);
    memcpy(mesh->triangle, triangle, 3 * triangle_count * sizeof *triangle);
    return DRAPE_OK;
}

/* Areas of triangles |(x1 - x0) x (x2 - x0)| / 2, lengths of edges, and the area lumped to each node, a third
 * of each triangle around it (so that these sum to the area of the sheet). */
drape_status drape_mesh_measure(drape_mesh *mesh)
{
    drape_arena *arena = &mesh->arena;
    mesh->triangle_area = drape_arena_take(arena, (size_t)mesh->triangle_count, sizeof *mesh->triangle_area);
    mesh->edge_length = drape_arena_take(arena, (size_t)mesh->edge_count, sizeof *mesh->edge_length);
    mesh->node_area = drape_arena_take(arena, (size_t)mesh->node_count, sizeof *mesh->node_area);
    DRAPE_TRY(drape_arena_status(arena));
    for (int32_t triangle = 0; triangle < mesh->triangle_count; triangle++) {
        const int32_t *n = mesh->triangle + 3 * (size_t)triangle;
        double area[3];
        vec3_triangle_area(n, mesh->x, area);
        mesh->triangle_area[triangle] = vec3_norm(area) / 2;
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

static drape_status place(drape_context *ctx, const char *pointer, const drape_mesh_def *def,
                          const char *folder, drape_mesh *mesh)
{
    const drape_mesh_source source = {.pointer = DRAPE_FORMAT("%s%s", pointer, def->file ? "/file" : ""),
                                      .file = def->file},
                            moved = {.pointer = DRAPE_FORMAT("%s/transform", pointer)};
    const bool arrays = def->positions || def->triangles;
    const int count = (def->grid.type != NULL) + (def->file != NULL) + arrays;
    if (count != 1)
        return drape_refuse(ctx, pointer, "%d sources%s%s%s; a mesh has exactly one of grid, file, positions",
                            count, def->grid.type ? ", grid" : "", def->file ? ", file" : "",
                            arrays ? ", positions" : "");
    DRAPE_TRY(drape_mesh_check_transform(ctx, pointer, def->scale, def->rotate, def->translate));
    DRAPE_TRY(def->grid.type ? drape_mesh_from_grid(ctx, pointer, &def->grid, mesh)
              : def->file    ? drape_mesh_from_file(ctx, pointer, folder, def->file, mesh)
                             : drape_mesh_from_arrays(ctx, pointer, def->positions, def->node_count,
                                                      def->triangles, def->triangle_count, mesh));
    DRAPE_TRY(drape_check_cancel(ctx));
    /* Positions are also checked before the transform, because a rotation spreads one coordinate that is not
     * a number to all three. */
    DRAPE_TRY(drape_mesh_validate_positions(ctx, &source, mesh));
    drape_mesh_transform(mesh, def->scale, def->rotate, def->translate);
    return drape_mesh_validate_positions(ctx, &moved, mesh);
}

static drape_status make(drape_context *ctx, const char *pointer, const drape_mesh_def *def,
                         const char *folder, drape_mesh *mesh)
{
    const drape_mesh_source source = {.pointer = DRAPE_FORMAT("%s%s", pointer, def->file ? "/file" : ""),
                                      .file = def->file};
    DRAPE_TRY(place(ctx, pointer, def, folder, mesh));
    DRAPE_TRY(drape_mesh_validate_triangles(ctx, &source, mesh));
    DRAPE_TRY(drape_check_cancel(ctx));
    DRAPE_TRY(drape_mesh_connect(ctx, &source, mesh));
    DRAPE_TRY(drape_check_cancel(ctx));
    DRAPE_TRY(drape_mesh_validate_nodes(ctx, &source, mesh));
    DRAPE_TRY(drape_mesh_subdivide(ctx, &source, def->subdivide, mesh));
    return drape_mesh_measure(mesh);
}

static drape_status freed_after(drape_status status, drape_mesh *mesh)
{
    if (status)
        drape_mesh_free(mesh);
    return status;
}

drape_status drape_mesh_place(drape_context *ctx, const char *pointer, const drape_mesh_def *def,
                              const char *folder, drape_mesh *mesh)
{
    *mesh = (drape_mesh){0};
    return freed_after(place(ctx, pointer, def, folder, mesh), mesh);
}

drape_status drape_mesh_make(drape_context *ctx, const char *pointer, const drape_mesh_def *def,
                             const char *folder, drape_mesh *mesh)
{
    *mesh = (drape_mesh){0};
    return freed_after(make(ctx, pointer, def, folder, mesh), mesh);
}

void drape_mesh_drop_topology(drape_mesh *mesh)
{
    drape_arena_release(&mesh->arena, mesh->edge_triangle);
    drape_arena_release(&mesh->arena, mesh->triangle_edge);
    drape_arena_release(&mesh->arena, mesh->hinge);
    drape_arena_release(&mesh->arena, mesh->hinge_edge);
    mesh->edge_triangle = mesh->triangle_edge = mesh->hinge = mesh->hinge_edge = NULL;
}

void drape_mesh_free(drape_mesh *mesh)
{
    drape_arena_free(&mesh->arena);
    *mesh = (drape_mesh){0};
}
