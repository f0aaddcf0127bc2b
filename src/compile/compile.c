/* compile.c: the stages of a compilation, in order: cloths, whole-model arrays, pins, contact, colliders,
 * terms, pattern. */
#include "compile/compile.h"

#include "base/vec3.h"

#include "compile/stages.h"
#include "model/periodic.h"
#include "model/scene.h"

#include <math.h>
#include <string.h>

drape_status drape_compile_name(drape_model *model, const char *pointer, const char *kind, const char *many,
                                const char *given, int32_t index, char **name, size_t size)
{
    const char *own = DRAPE_FORMAT("%s%d", kind, (int)index);
    const char *wanted = given ? given : own;
    for (size_t i = 1; i <= (size_t)index; i++)
        if (strcmp(*(char **)(void *)((char *)name - i * size), wanted) == 0)
            return drape_fail_below(model->ctx, pointer, "name", "two %s have the name \"%.60s\"", many,
                                    wanted);
    *name = drape_arena_text(&model->arena, wanted);
    return drape_arena_status(&model->arena);
}

drape_status drape_compile_choice(drape_model *model, const drape_entry_def *def, const char *fallback,
                                  drape_choice *choice)
{
    choice->type = drape_arena_text(&model->arena, def->type ? def->type : fallback);
    choice->settings = drape_arena_take(&model->arena, def->setting_count, sizeof *choice->settings);
    if (!choice->type || !choice->settings)
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < def->setting_count; i++) {
        const drape_setting *from = &def->settings[i];
        drape_setting *to = &choice->settings[i];
        double *vector =
            from->vector ? drape_arena_take(&model->arena, from->vector_count, sizeof *vector) : NULL;
        if (vector)
            memcpy(vector, from->vector, from->vector_count * sizeof *vector);
        *to = (drape_setting){.number = from->number,
                              .name = drape_arena_text(&model->arena, from->name),
                              .text = from->text ? drape_arena_text(&model->arena, from->text) : NULL,
                              .vector = vector,
                              .vector_count = vector ? from->vector_count : 0};
    }
    choice->setting_count = def->setting_count;
    return drape_arena_status(&model->arena);
}

static drape_status copy_scene(drape_model *model, const drape_scene_def *def)
{
    memcpy(model->gravity, def->gravity, sizeof model->gravity);
    model->duration = def->duration;
    model->frame_rate = def->frame_rate;
    model->integrator_named = def->integrator.type != NULL;
    if (def->accuracy && !drape_distance_read(def->accuracy, &model->accuracy))
        return drape_fail_at(model->ctx, DRAPE_E_ARGUMENT, "/accuracy", "is \"%.60s\"; it must be %s",
                             def->accuracy, DRAPE_DISTANCE_FORM);
    model->z_up = def->up && strcmp(def->up, "z") == 0;
    DRAPE_TRY(drape_compile_choice(model, &def->integrator, "be", &model->integrator));
    DRAPE_TRY(drape_compile_choice(model, &def->controller, "halving", &model->controller));
    model->formats = drape_arena_take(&model->arena, def->format_count, sizeof *model->formats);
    if (!model->formats)
        return DRAPE_E_MEMORY;
    model->format_count = def->format_count;
    for (size_t i = 0; i < def->format_count; i++)
        model->formats[i] = drape_arena_text(&model->arena, def->formats[i]);
    return drape_arena_status(&model->arena);
}

static drape_status compile_cloth(drape_model *model, int32_t c, const drape_scene_def *scene)
{
    const drape_cloth_def *def = &scene->cloths[c];
    drape_cloth *cloth = &model->cloths[c];
    const char *pointer = DRAPE_FORMAT("/cloth/%d", (int)c);
    DRAPE_TRY(
        drape_compile_name(model, pointer, "cloth", "cloths", def->name, c, &cloth->name, sizeof *cloth));
    const char *at = DRAPE_FORMAT("%s/mesh", pointer);
    DRAPE_TRY(drape_mesh_make(model->ctx, at, &def->mesh, scene->folder, &cloth->mesh));
    DRAPE_TRY(drape_compile_choice(model, &def->mesh.grid, "", &cloth->grid));
    if (def->mesh.file && !(cloth->file = drape_arena_text(&model->arena, def->mesh.file)))
        return DRAPE_E_MEMORY;
    DRAPE_TRY(drape_compile_material(model, pointer, def, cloth));
    DRAPE_TRY(drape_compile_masses(model, pointer, def, cloth));
    memcpy(cloth->scale, def->mesh.scale, sizeof cloth->scale);
    memcpy(cloth->rotate, def->mesh.rotate, sizeof cloth->rotate);
    memcpy(cloth->translate, def->mesh.translate, sizeof cloth->translate);
    memcpy(cloth->velocity, def->velocity, sizeof cloth->velocity);
    return DRAPE_OK;
}

static void copy_numbers(int32_t *to, const int32_t *from, size_t count, int32_t first)
{
    for (size_t i = 0; i < count; i++)
        to[i] = from[i] + first;
}

/* Of the box around points (count x 3). */
static double diagonal_of(const double *x, size_t count)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < 3 * count; i++) {
        low[i % 3] = fmin(low[i % 3], x[i]);
        high[i % 3] = fmax(high[i % 3], x[i]);
    }
    for (int k = 0; k < 3; k++)
        high[k] -= low[k];
    return sqrt(high[0] * high[0] + high[1] * high[1] + high[2] * high[2]);
}

/* Concatenates the arrays of all cloths. */
static drape_status gather(drape_model *model)
{
    drape_arena *arena = &model->arena;
    size_t nodes = (size_t)model->node_count, edges = (size_t)model->edge_count, first_edge = 0;
    model->rest = drape_arena_take(arena, 3 * nodes, sizeof *model->rest);
    model->velocity = drape_arena_take(arena, 3 * nodes, sizeof *model->velocity);
    model->mass = drape_arena_take(arena, nodes, sizeof *model->mass);
    model->triangle = drape_arena_take(arena, 3 * (size_t)model->triangle_count, sizeof *model->triangle);
    model->edge = drape_arena_take(arena, 2 * edges, sizeof *model->edge);
    model->edge_length = drape_arena_take(arena, edges, sizeof *model->edge_length);
    DRAPE_TRY(drape_arena_status(arena));
    for (int32_t c = 0; c < model->cloth_count; c++) {
        const drape_cloth *cloth = &model->cloths[c];
        const drape_mesh *mesh = &cloth->mesh;
        const size_t count = (size_t)mesh->node_count, first = (size_t)cloth->first_node;
        memcpy(model->rest + 3 * first, mesh->x, 3 * count * sizeof *mesh->x);
        memcpy(model->mass + first, cloth->node_mass, count * sizeof *cloth->node_mass);
        for (size_t i = 0; i < 3 * count; i++)
            model->velocity[3 * first + i] = cloth->velocity[i % 3];
        copy_numbers(model->triangle + 3 * (size_t)cloth->first_triangle, mesh->triangle,
                     3 * (size_t)mesh->triangle_count, cloth->first_node);
        copy_numbers(model->edge + 2 * first_edge, mesh->edge, 2 * (size_t)mesh->edge_count,
                     cloth->first_node);
        memcpy(model->edge_length + first_edge, mesh->edge_length,
               (size_t)mesh->edge_count * sizeof *mesh->edge_length);
        first_edge += (size_t)mesh->edge_count;
    }
    for (int32_t c = 0; c < model->cloth_count; c++)
        model->cloths[c].diagonal = diagonal_of(model->rest + 3 * (size_t)model->cloths[c].first_node,
                                                (size_t)model->cloths[c].mesh.node_count);
    model->length = diagonal_of(model->rest, nodes);
    return DRAPE_OK;
}

static drape_status compile_cloths(drape_model *model, const drape_scene_def *def)
{
    if (def->cloth_count == 0)
        return drape_refuse(model->ctx, "/cloth", "the scene has no cloth");
    model->cloths = drape_arena_take(&model->arena, def->cloth_count, sizeof *model->cloths);
    if (!model->cloths)
        return DRAPE_E_MEMORY;
    for (size_t c = 0; c < def->cloth_count; c++) {
        model->cloth_count = (int32_t)c + 1; /* count an unfinished cloth, too, so that it is freed */
        DRAPE_TRY(drape_check_cancel(model->ctx));
        DRAPE_TRY(compile_cloth(model, (int32_t)c, def));
    }
    int64_t nodes = 0, triangles = 0, edges = 0;
    for (int32_t c = 0; c < model->cloth_count; c++) {
        model->cloths[c].first_node = (int32_t)nodes;
        model->cloths[c].first_triangle = (int32_t)triangles;
        nodes += model->cloths[c].mesh.node_count;
        triangles += model->cloths[c].mesh.triangle_count;
        edges += model->cloths[c].mesh.edge_count;
        if (nodes > DRAPE_MAX_NODES)
            return drape_refuse(model->ctx, "/cloth", "the cloths have more than %d nodes together",
                                DRAPE_MAX_NODES);
    }
    model->node_count = (int32_t)nodes;
    model->triangle_count = (int32_t)triangles;
    model->edge_count = (int32_t)edges;
    return gather(model);
}

/* The initial velocity applies only to free nodes, and to those with supports without what is along the
 * directions that are held. That of pins which move is of their motion, which a sim has. */
static void stop_pinned(drape_model *model)
{
    for (int32_t i = 0; i < model->node_count; i++)
        if (model->pinned[i])
            memset(model->velocity + 3 * (size_t)i, 0, 3 * sizeof *model->velocity);
    for (int32_t i = 0; i < model->support_count; i++)
        for (int d = 0; d < model->supports[i].count; d++) {
            const double *n = model->supports[i].direction[d];
            double *v = model->velocity + 3 * (size_t)model->supports[i].node;
            vec3_add_scaled(-vec3_dot(n, v), n, v);
        }
    drape_periodic_project(model, model->velocity);
}

drape_status drape_compile(drape_context *ctx, const drape_scene_def *def, drape_model **out)
{
    static drape_status (*const stages[])(drape_model *, const drape_scene_def *) = {
        copy_scene,           compile_cloths,          drape_compile_render_meshes,
        drape_compile_start,  drape_compile_periodic,  drape_compile_pins,
        drape_compile_events, drape_compile_contact,   drape_compile_colliders,
        drape_compile_rides,  drape_compile_ignored,   drape_compile_contact_stiffness,
        drape_compile_seams,  drape_compile_histories, drape_compile_terms,
        drape_compile_images};
    *out = NULL;
    drape_model *model = drape_alloc(ctx, 1, sizeof *model);
    if (!model)
        return DRAPE_E_MEMORY;
    model->arena = model->scratch = drape_arena_of(ctx);
    model->ctx = ctx;
    drape_status status = drape_compile_check_def(ctx, def);
    for (size_t i = 0; !status && i < sizeof stages / sizeof *stages; i++) {
        status = drape_check_cancel(ctx) ? DRAPE_E_STOPPED : stages[i](model, def);
        drape_arena_free(&model->scratch);
    }
    if (!status)
        status = drape_compile_pattern(model);
    for (int32_t c = 0; c < model->cloth_count; c++) /* a scene without bending keeps no hinges */
        drape_mesh_drop_topology(&model->cloths[c].mesh);
    if (!status)
        stop_pinned(model);
    if (status)
        drape_model_destroy(&model);
    *out = model;
    return status;
}
