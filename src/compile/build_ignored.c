/* build_ignored.c: which cloths pass through which colliders and cloths. */
#include "compile/stages.h"

#include <string.h>

/* A name may be that of a collider and of a cloth: then both are meant. Pairs of cloths ignore each other. */
static drape_status ignore(drape_model *model, int32_t cloth, const char *pointer, const char *name)
{
    bool found = false;
    for (int32_t c = 0; c < model->collider_count; c++) {
        if (strcmp(model->colliders[c].name, name) != 0)
            continue;
        found = true;
        model->ignored[c * model->cloth_count + cloth] = 1;
    }
    for (int32_t c = 0; c < model->cloth_count; c++) {
        if (strcmp(model->cloths[c].name, name) != 0)
            continue;
        found = true;
        model->ignored[(model->collider_count + c) * model->cloth_count + cloth] = 1;
        model->ignored[(model->collider_count + cloth) * model->cloth_count + c] = 1;
    }
    return found ? drape_check_cancel_after(model->ctx,
                                            8 * (size_t)(model->collider_count + model->cloth_count))
                 : drape_refuse(model->ctx, pointer, "there is no collider and no cloth \"%.60s\"", name);
}

drape_status drape_compile_ignored(drape_model *model, const drape_scene_def *def)
{
    const int32_t rows = model->collider_count + model->cloth_count;
    bool any = false;
    for (size_t c = 0; c < def->cloth_count; c++)
        any = any || def->cloths[c].ignore_count > 0;
    for (size_t c = 0; c < def->collider_count; c++)
        any = any || !def->colliders[c].enabled;
    if (!any)
        return DRAPE_OK;
    model->ignored =
        drape_arena_take(&model->arena, (size_t)rows * (size_t)model->cloth_count, sizeof *model->ignored);
    model->cloth_of_node =
        drape_arena_take(&model->arena, (size_t)model->node_count, sizeof *model->cloth_of_node);
    if (!model->ignored || !model->cloth_of_node)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < model->node_count; i++)
        model->cloth_of_node[i] = drape_model_cloth_of(model, i);
    for (int32_t c = 0; c < model->collider_count; c++)
        memset(model->ignored + c * model->cloth_count, !def->colliders[c].enabled,
               (size_t)model->cloth_count);
    for (int32_t c = 0; c < model->cloth_count; c++)
        for (size_t i = 0; i < def->cloths[c].ignore_count; i++) {
            const char *pointer = DRAPE_FORMAT("/cloth/%d/ignore/%zu", (int)c, i);
            DRAPE_TRY(ignore(model, c, pointer, def->cloths[c].ignore[i]));
        }
    return DRAPE_OK;
}
