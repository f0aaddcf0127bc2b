/* build_colliders.c: colliders by name, with their parameters, shapes, tracks and rotations. */
#include "base/def.h"
#include "colliders/colliders.h"
#include "compile/stages.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"

/* How far a polygon may lie inside a curved surface, as a fraction of the activation distance: an edge of the
 * cloth that rests on the polygon is then pushed away nearly as by the surface. */
#define SHARE_OF_DISTANCE 0.1

/* The given pivot, or the middle of the box around the points of the shape; and how far these are from it. */
static drape_status set_pivot(drape_model *model, const char *pointer, const double given[3],
                              drape_collider *to)
{
    const drape_collider_shape *shape = &to->shape;
    const bool is_given = !isnan(given[0]);
    to->pivot_given = is_given;
    for (int k = 0; k < 3; k++) {
        double low = shape->point_count > 0 ? INFINITY : 0, high = -low;
        for (int32_t i = 0; i < shape->point_count; i++) {
            low = fmin(low, shape->point[3 * (size_t)i + (size_t)k]);
            high = fmax(high, shape->point[3 * (size_t)i + (size_t)k]);
        }
        to->pivot[k] = is_given ? given[k] : (low + high) / 2;
        if (!(fabs(to->pivot[k]) <= DRAPE_MOST))
            return drape_fail_below(model->ctx, pointer, "pivot", "%g is not allowed; it is within %g m",
                                    to->pivot[k], DRAPE_MOST);
    }
    for (int32_t i = 0; i < shape->point_count; i++) {
        double from[3];
        vec3_sub(shape->point + 3 * (size_t)i, to->pivot, from);
        to->radius = fmax(to->radius, vec3_norm(from));
    }
    if (shape->point_count == 0)
        to->radius = model->length;
    return DRAPE_OK;
}

static drape_status compile_collider(drape_model *model, size_t i, const drape_scene_def *scene)
{
    const drape_collider_def *def = &scene->colliders[i];
    drape_collider *to = &model->colliders[i];
    int kind = 0;
    const char *pointer = DRAPE_FORMAT("/colliders/%zu", i);
    const char *type = DRAPE_FORMAT("%s/type", pointer);
    DRAPE_TRY(drape_compile_name(model, pointer, "collider", "colliders", def->name, (int32_t)i, &to->name,
                                 sizeof *to));
    to->index = (int32_t)i;
    to->friction = def->friction;
    to->restitution = def->restitution;
    DRAPE_TRY(drape_registry_choose(model->ctx, &drape_collider_registry, type, def->entry.type, &kind));
    const int built_in = drape_registry_count(&drape_collider_registry);
    to->ops = kind < built_in ? drape_colliders[kind] : &model->ctx->host_colliders[kind - built_in];
    DRAPE_TRY(drape_compile_choice(model, &def->entry, "", &to->choice));
    if (def->key_count > 0)
        DRAPE_TRY(drape_compile_track(model, pointer, def->track, def->key_count, &to->track));
    if (def->turn_count > 0)
        DRAPE_TRY(drape_compile_turns(model, pointer, def->turns, def->turn_count, &to->turns));
    DRAPE_TRY(drape_collider_build(model->ctx, &model->arena, pointer, scene->folder,
                                   SHARE_OF_DISTANCE * model->contact.distance, to));
    return set_pivot(model, pointer, def->pivot, to);
}

drape_status drape_compile_colliders(drape_model *model, const drape_scene_def *def)
{
    drape_status status = DRAPE_OK;
    if (def->collider_count == 0)
        return DRAPE_OK;
    model->colliders = drape_arena_take(&model->arena, def->collider_count, sizeof *model->colliders);
    if (!model->colliders)
        return DRAPE_E_MEMORY;
    for (size_t i = 0; !status && i < def->collider_count; i++)
        status = drape_check_cancel(model->ctx) ? DRAPE_E_STOPPED : compile_collider(model, i, def);
    model->collider_count = status ? 0 : (int32_t)def->collider_count;
    for (int32_t i = 0; i < model->collider_count; i++)
        if (model->colliders[i].friction > 0 || model->colliders[i].restitution < 1)
            model->has_dissipation = model->has_own_dissipation = true;
    return status;
}

drape_status drape_compile_take_ops(drape_context *ctx, const char *what, const void *given, size_t least,
                                    void *own, size_t size)
{
    size_t bytes;
    if (!ctx)
        return DRAPE_E_ARGUMENT;
    if (!given)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "drape_context_add_%s: there are no ops", what);
    memcpy(&bytes, given, sizeof bytes); /* struct_size is the first member */
    if (!drape_def_fits(bytes, least, size))
        return drape_fail(
            ctx, DRAPE_E_VERSION,
            "the ops of a %s have %zu bytes; this library's have %zu, an older one's %zu or more", what,
            bytes, size, least);
    memcpy(own, given, bytes);
    return DRAPE_OK;
}

/* The size of the function table in its first version: `smooth` may be missing, and cloth then meets the
 * collider through its triangles. */
#define MIN_SIZE offsetof(drape_collider_ops, smooth)

drape_status drape_context_add_collider(drape_context *ctx, const drape_collider_ops *given)
{
    drape_collider_ops own = {0}, *ops = &own;
    DRAPE_TRY(drape_compile_take_ops(ctx, "collider", given, MIN_SIZE, &own, sizeof own));
    if (!ops->entry.name || !ops->entry.summary || !ops->entry.reference || !ops->shape || !ops->distance ||
        !drape_params_are_well_formed(ops->entry.params, ops->entry.param_count))
        return drape_fail(
            ctx, DRAPE_E_ARGUMENT,
            "the ops of collider \"%s\" are not well formed: name, summary, reference, shape, "
            "distance; at most %d values of parameters, each with name and unit, a choice with choices",
            ops->entry.name ? ops->entry.name : "?", DRAPE_MAX_PARAMS);
    if (drape_registry_find(&drape_collider_registry, ctx, ops->entry.name) >= 0)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "there is a collider \"%s\" already", ops->entry.name);
    if (ctx->host_collider_count == DRAPE_MAX_HOST_COLLIDERS)
        return drape_fail(ctx, DRAPE_E_ARGUMENT,
                          "collider \"%s\": a context holds at most %d user-defined colliders",
                          ops->entry.name, DRAPE_MAX_HOST_COLLIDERS);
    ctx->host_colliders[ctx->host_collider_count++] = own;
    return DRAPE_OK;
}
