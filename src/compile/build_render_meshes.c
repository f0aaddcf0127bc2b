/* build_render_meshes.c: reads the render meshes of cloths, binds their vertices to the simulated triangles
 * at rest, and gathers what frames show. */
#include "compile/stages.h"
#include "geometry/embed.h"

#include <math.h>

/* The limit is also the sign that both meshes are not at the same place. */
static drape_status bind_vertices(drape_model *model, const drape_mesh_source *source, const drape_bvh *tree,
                                  const double *normals, drape_cloth *cloth)
{
    const drape_mesh *mesh = &cloth->render_mesh;
    for (int32_t i = 0; i < mesh->node_count; i++) {
        const double *point = mesh->x + 3 * (size_t)i;
        const double distance = drape_embed(tree, model->rest, normals, point, &cloth->bound[i]);
        cloth->bound[i].triangle += cloth->first_triangle;
        if (!(distance <= cloth->max_distance))
            return drape_mesh_fail(model->ctx, source, 0,
                                   "vertex %d, at (%g, %g, %g) m, is %g m from the simulated mesh at rest; "
                                   "max_distance is %g m; remedy: bring both meshes to the same place and "
                                   "size, as by a transform, or raise max_distance",
                                   (int)i, point[0], point[1], point[2], distance, cloth->max_distance);
        DRAPE_TRY(drape_check_cancel_after(model->ctx, 256 + (size_t)tree->count));
    }
    return DRAPE_OK;
}

/* normals: (node_count x 3) at rest. */
static drape_status bind_cloth(drape_model *model, int32_t c, const drape_scene_def *scene,
                               const double *normals)
{
    const drape_render_mesh_def *def = &scene->cloths[c].render_mesh;
    drape_cloth *cloth = &model->cloths[c];
    const char *pointer = DRAPE_FORMAT("/cloth/%d/render_mesh", (int)c);
    const char *place = DRAPE_FORMAT("%s%s", pointer, def->mesh.file ? "/file" : "");
    const drape_mesh_source source = {.pointer = place, .file = def->mesh.file};
    double sum = 0;
    for (int32_t i = 0; i < cloth->mesh.edge_count; i++)
        sum += cloth->mesh.edge_length[i];
    cloth->max_distance = isnan(def->max_distance) ? sum / cloth->mesh.edge_count : def->max_distance;

    DRAPE_TRY(drape_mesh_place(model->ctx, pointer, &def->mesh, scene->folder, &cloth->render_mesh));
    DRAPE_TRY(drape_mesh_validate_indices(model->ctx, &source, &cloth->render_mesh));
    if (def->mesh.file)
        cloth->render_file = drape_arena_text(&model->arena, def->mesh.file);
    cloth->bound =
        drape_arena_take(&model->arena, (size_t)cloth->render_mesh.node_count, sizeof *cloth->bound);
    DRAPE_TRY(drape_arena_status(&model->arena));
    drape_bvh tree;
    DRAPE_TRY(drape_bvh_build(&model->scratch, cloth->mesh.triangle_count, 3,
                              model->triangle + 3 * (size_t)cloth->first_triangle, model->rest, &tree));
    drape_bvh_fit(&tree, model->rest);
    return bind_vertices(model, &source, &tree, normals, cloth);
}

/* Lists the mesh that frames show of each cloth, and where its nodes and triangles are. */
static drape_status list_cloths(drape_model *model)
{
    drape_render_surface *s = &model->surface;
    int64_t nodes = 0, triangles = 0;
    s->cloths = drape_arena_take(&model->arena, (size_t)model->cloth_count, sizeof *s->cloths);
    if (!s->cloths)
        return DRAPE_E_MEMORY;
    s->cloth_count = model->cloth_count;
    for (int32_t c = 0; c < model->cloth_count; c++) {
        const drape_cloth *cloth = &model->cloths[c];
        const drape_mesh *mesh = cloth->bound ? &cloth->render_mesh : &cloth->mesh;
        s->cloths[c] = (drape_render_cloth){.name = cloth->name,
                                            .mesh = mesh,
                                            .first_node = (int32_t)nodes,
                                            .first_triangle = (int32_t)triangles,
                                            .bound = cloth->bound};
        nodes += mesh->node_count;
        triangles += mesh->triangle_count;
        if (nodes > DRAPE_MAX_NODES || triangles > DRAPE_MAX_TRIANGLES)
            return drape_refuse(model->ctx, "/cloth",
                                "the render meshes have more than %d vertices or %d triangles together",
                                DRAPE_MAX_NODES, DRAPE_MAX_TRIANGLES);
    }
    s->node_count = (int32_t)nodes;
    s->triangle_count = (int32_t)triangles;
    return DRAPE_OK;
}

/* Concatenates their arrays; those of the model serve if no cloth has a render mesh. */
static drape_status gather(drape_model *model)
{
    drape_render_surface *s = &model->surface;
    s->triangle = model->triangle;
    s->rest = model->rest;
    if (!s->bound)
        return DRAPE_OK;
    int32_t *triangle = drape_arena_take(&model->arena, (size_t)s->triangle_count, 3 * sizeof *triangle);
    double *rest = drape_arena_take(&model->arena, (size_t)s->node_count, 3 * sizeof *rest);
    if (!triangle || !rest)
        return DRAPE_E_MEMORY;
    s->triangle = triangle;
    s->rest = rest;
    for (int32_t c = 0; c < s->cloth_count; c++) {
        const drape_mesh *mesh = s->cloths[c].mesh;
        for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
            *triangle++ = mesh->triangle[i] + s->cloths[c].first_node;
        for (size_t i = 0; i < 3 * (size_t)mesh->node_count; i++)
            *rest++ = mesh->x[i];
    }
    return DRAPE_OK;
}

drape_status drape_compile_render_meshes(drape_model *model, const drape_scene_def *def)
{
    double *normals = NULL;
    for (int32_t c = 0; c < model->cloth_count; c++) {
        const drape_mesh_def *given = &def->cloths[c].render_mesh.mesh;
        if (!given->grid.type && !given->file && !given->positions && !given->triangles)
            continue;
        if (!normals) {
            normals = drape_arena_take(&model->scratch, (size_t)model->node_count, 3 * sizeof *normals);
            if (!normals)
                return DRAPE_E_MEMORY;
            drape_model_normals(model, model->rest, normals);
        }
        DRAPE_TRY(bind_cloth(model, c, def, normals));
        model->surface.bound = true;
    }
    DRAPE_TRY(list_cloths(model));
    return gather(model);
}
