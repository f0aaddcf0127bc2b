/* load.c: from a scene to a model, after checking its choice of integrator and controller. */
#include "compile/compile.h"
#include "model/scene.h"
#include "sim/choose.h"

static drape_status compile(drape_context *ctx, const drape_scene_def *def, drape_model **out)
{
    drape_chosen chosen;
    drape_status status = drape_compile(ctx, def, out);
    if (!status)
        status = drape_choose(ctx, *out, NULL, &chosen);
    if (status)
        drape_model_destroy(out);
    return status;
}

drape_status drape_model_create(drape_context *ctx, const drape_scene_def *given, drape_model **out)
{
    drape_scene_def def;
    drape_arena arena = drape_arena_of(ctx);
    if (!ctx)
        return DRAPE_E_ARGUMENT;
    if (!out)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "drape_model_create: out is NULL");
    *out = NULL;
    drape_status status = drape_compile_read_def(ctx, &arena, given, &def);
    if (!status)
        status = compile(ctx, &def, out);
    drape_arena_free(&arena);
    return status;
}

drape_status drape_scene_compile(drape_scene *scene, drape_model **out)
{
    drape_scene_def def;
    if (out)
        *out = NULL;
    if (!scene)
        return DRAPE_E_ARGUMENT;
    if (!out)
        return drape_fail(drape_scene_context(scene), DRAPE_E_ARGUMENT, "drape_scene_compile: out is NULL");
    drape_status status = drape_scene_to_def(scene, &def);
    if (!status)
        status = compile(drape_scene_context(scene), &def, out);
    if (status && status != DRAPE_E_MEMORY)
        drape_scene_locate_fault(scene);
    return status;
}

drape_status drape_model_load(drape_context *ctx, const char *scene_path, drape_model **out)
{
    drape_scene *scene = NULL;
    if (out)
        *out = NULL;
    if (!ctx)
        return DRAPE_E_ARGUMENT;
    if (!out)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "drape_model_load: out is NULL");
    drape_status status = drape_scene_load(ctx, scene_path, &scene);
    if (!status)
        status = drape_scene_compile(scene, out);
    drape_scene_destroy(&scene);
    return status;
}
