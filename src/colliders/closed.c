/* closed.c: a mesh file as the surface of a solid: every edge has two triangles, which run along it in
 * opposite directions, and the volume inside is positive. */
#include "colliders/colliders.h"

#include "base/vec3.h"
#include "mesh/remedy.h"

#include <stdio.h>
#include <string.h>

/* Whether triangle t runs along its edge from a to b, not from b to a. */
static bool runs_along(const drape_mesh *mesh, int32_t t, int32_t a, int32_t b)
{
    const int32_t *n = mesh->triangle + 3 * (size_t)t;
    return (n[0] == a && n[1] == b) || (n[1] == a && n[2] == b) || (n[2] == a && n[0] == b);
}

drape_status drape_shape_check_volume(drape_context *ctx, const drape_mesh_source *source,
                                      const drape_mesh *mesh)
{
    /* The sum of the tetrahedra with the first node as apex, which is near to all others, as the origin need
     * not be. */
    double sum = 0, side[3][3], cross[3];
    for (int32_t t = 0; t < mesh->triangle_count; t++) {
        for (int k = 0; k < 3; k++)
            vec3_sub(mesh->x + 3 * (size_t)mesh->triangle[3 * (size_t)t + (size_t)k], mesh->x, side[k]);
        vec3_cross(side[0], side[1], cross);
        sum += vec3_dot(cross, side[2]);
    }
    const double volume = sum / 6;
    if (volume > 0)
        return drape_check_cancel_after(ctx, 8 * (size_t)mesh->triangle_count);
    return drape_mesh_fail(ctx, source, 0,
                           "the mesh is inside out: its volume is %g m3; triangles go counterclockwise seen "
                           "from outside; remedy: turn all faces over (flip normals)",
                           volume);
}

drape_status drape_shape_check_mesh(drape_context *ctx, const drape_mesh_source *source, bool closed,
                                    drape_mesh *mesh)
{
    drape_status status = drape_mesh_validate_triangles(ctx, source, mesh);
    if (!status)
        status = drape_mesh_connect(ctx, source, mesh);
    if (!status)
        status = drape_mesh_validate_nodes(ctx, source, mesh);
    if (status || !closed)
        return status;
    for (int32_t e = 0; e < mesh->edge_count; e++) {
        const int32_t *ends = mesh->edge + 2 * (size_t)e, *beside = mesh->edge_triangle + 2 * (size_t)e;
        if (beside[1] < 0) {
            char remedy[DRAPE_REMEDY_SIZE];
            drape_remedy_open(ctx, mesh, remedy);
            return drape_mesh_fail(ctx, source, 0,
                                   "the mesh is not closed: edge %d %d has one triangle, %d; a collider is a "
                                   "closed surface, unless it is an animated_mesh with \"open\": true%s",
                                   (int)ends[0], (int)ends[1], (int)beside[0], remedy);
        }
        if (runs_along(mesh, beside[0], ends[0], ends[1]) == runs_along(mesh, beside[1], ends[0], ends[1]))
            return drape_mesh_fail(
                ctx, source, 0,
                "triangles %d and %d are not oriented alike: both go along edge %d %d in the "
                "same direction; remedy: let all faces look outwards (recalculate normals)",
                (int)beside[0], (int)beside[1], (int)ends[0], (int)ends[1]);
    }
    return drape_shape_check_volume(ctx, source, mesh);
}

drape_status drape_shape_copy_mesh(const drape_mesh *mesh, drape_collider_shape *shape)
{
    drape_status status =
        drape_shape_reserve(shape, mesh->node_count, mesh->edge_count, mesh->triangle_count);
    if (status)
        return status;
    memcpy(shape->point, mesh->x, 3 * (size_t)mesh->node_count * sizeof *mesh->x);
    memcpy(shape->segment, mesh->edge, 2 * (size_t)mesh->edge_count * sizeof *mesh->edge);
    memcpy(shape->triangle, mesh->triangle, 3 * (size_t)mesh->triangle_count * sizeof *mesh->triangle);
    return DRAPE_OK;
}

const char *drape_shape_text(const drape_collider_shape *shape, const char *parameter)
{
    const drape_choice *choice = shape->builder->choice;
    for (size_t i = 0; i < choice->setting_count; i++)
        if (strcmp(choice->settings[i].name, parameter) == 0)
            return choice->settings[i].text;
    return NULL;
}

drape_status drape_shape_read_mesh(drape_collider_shape *shape, const char *parameter, const double scale[3],
                                   const double turn[3], const double translate[3])
{
    const struct drape_shape_builder *builder = shape->builder;
    const char *file = drape_shape_text(shape, parameter);
    const double rotate[4] = {turn[0], turn[1], turn[2], vec3_norm(turn)};
    char at[sizeof builder->ctx->pointer];
    drape_mesh mesh = {0};
    if (!file)
        return drape_shape_refuse(shape, parameter, "the name of a mesh file is needed");
    snprintf(at, sizeof at, "%s/%s", builder->pointer, parameter);
    const drape_mesh_source source = {.pointer = at, .file = file};
    const drape_mesh_source transformed = {.pointer = builder->pointer};
    drape_status status = drape_mesh_from_file(builder->ctx, builder->pointer, builder->folder, file, &mesh);
    if (!status)
        status = drape_mesh_validate_positions(builder->ctx, &source, &mesh);
    if (!status) {
        drape_mesh_transform(&mesh, scale, rotate, translate);
        status = drape_mesh_validate_positions(builder->ctx, &transformed, &mesh);
    }
    if (!status)
        status = drape_shape_check_mesh(builder->ctx, &source, true, &mesh);
    if (!status)
        status = drape_shape_copy_mesh(&mesh, shape);
    drape_mesh_free(&mesh);
    return status;
}
