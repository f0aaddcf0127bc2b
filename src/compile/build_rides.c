/* build_rides.c: pins that colliders carry: at which point of its collider a pin begins. */
#include "colliders/deformed.h"
#include "compile/stages.h"
#include "model/ride.h"

#include <string.h>

/* The number of the collider that the pin names, which must have the triangle. */
static drape_status find_carrier(const drape_model *model, const char *pointer, const drape_pin_def *def,
                                 int32_t *number)
{
    if (!def->attach)
        return drape_fail_below(
            model->ctx, pointer, "triangle",
            "a triangle is one of a collider, which \"attach\" names; there is no attach");
    for (*number = 0; *number < model->collider_count; ++*number)
        if (strcmp(model->colliders[*number].name, def->attach) == 0)
            break;
    if (*number == model->collider_count)
        return drape_fail_below(model->ctx, pointer, "attach", "there is no collider \"%.60s\"", def->attach);
    const drape_collider *collider = &model->colliders[*number];
    const bool deforms = collider->frames.frame_count > 0;
    if (def->triangle < 0 || (deforms && def->triangle < collider->shape.triangle_count))
        return DRAPE_OK;
    if (!deforms)
        return drape_fail_below(
            model->ctx, pointer, "triangle",
            "%d is not allowed: \"%.60s\" is a %s, which is rigid and carries pins as a whole",
            (int)def->triangle, collider->name, collider->ops->entry.name);
    return drape_fail_below(model->ctx, pointer, "triangle",
                            "there is no triangle %d; \"%.60s\" has the triangles 0 to %d",
                            (int)def->triangle, collider->name, (int)collider->shape.triangle_count - 1);
}

/* The nodes of a pin begin where the cloth starts. */
static drape_status attach(drape_model *model, const drape_motion *motion, const drape_pin *pin,
                           int32_t collider, int32_t triangle)
{
    int32_t *on = drape_arena_take(&model->scratch, (size_t)pin->node_count, sizeof *on);
    if (!on)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < pin->node_count; i++)
        on[i] = triangle;
    if (triangle < 0)
        DRAPE_TRY(drape_deformed_nearest(model->ctx, motion, collider, 0, pin->node_count, pin->node,
                                         model->start, on));
    for (int32_t i = 0; i < pin->node_count; i++)
        drape_motion_ride_from(motion, collider, on[i], 0, model->start + 3 * (size_t)pin->node[i],
                               &model->ride[pin->node[i]]);
    return DRAPE_OK;
}

drape_status drape_compile_rides(drape_model *model, const drape_scene_def *def)
{
    drape_motion *motion = NULL;
    bool any = false;
    for (size_t c = 0; c < def->cloth_count; c++)
        for (size_t p = 0; p < def->cloths[c].pin_count; p++)
            any = any || def->cloths[c].pins[p].attach || def->cloths[c].pins[p].triangle >= 0;
    if (!any)
        return DRAPE_OK;
    drape_ride *ride = drape_arena_take(&model->arena, (size_t)model->node_count, sizeof *ride);
    if (!ride)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < model->node_count; i++)
        ride[i] = drape_ride_none();
    DRAPE_TRY(drape_motion_create(&model->scratch, model, &motion)); /* of the colliders */
    model->ride = ride;
    const drape_pin *pin = model->pins;
    for (size_t c = 0; c < def->cloth_count; c++)
        for (size_t p = 0; p < def->cloths[c].pin_count; p++, pin++) {
            const drape_pin_def *from = &def->cloths[c].pins[p];
            int32_t collider = -1;
            if (!from->attach && from->triangle < 0)
                continue;
            const char *pointer = DRAPE_FORMAT("/cloth/%zu/pins/%zu", c, p);
            DRAPE_TRY(find_carrier(model, pointer, from, &collider));
            DRAPE_TRY(attach(model, motion, pin, collider, from->triangle));
        }
    return DRAPE_OK;
}
