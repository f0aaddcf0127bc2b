/*
 * read_def.c: converts the defs of a host that was built against an older header, whose structs were shorter.
 * Each def begins with its size as the host knows it, which in an array is also the distance to the next def;
 * members that the host does not know get their defaults.
 */
#include "compile/stages.h"

#include <string.h>

#include "base/def.h"
#include "model/scene.h"

/* Returns the size with which all defs of an array begin; 0 if they differ. */
static size_t stride_of(const char *array, size_t count, size_t size)
{
    size_t stride, other;
    memcpy(&stride, array, sizeof stride);
    for (size_t i = 1; i < count && stride > 0 && stride <= size; i++) {
        memcpy(&other, array + i * stride, sizeof other);
        if (other != stride)
            return 0;
    }
    return stride;
}

/* Replaces arrays by defs of the present size, in the arena. A NULL array or one that is too long is not
 * read: drape_compile_check_def reports missing arrays and refuses such counts. */
static drape_status widen_arrays(drape_context *ctx, drape_arena *arena, const drape_scene_object *object,
                                 char *def)
{
    for (const drape_scene_key *key = object->keys; key < object->keys + object->key_count; key++) {
        const char *from;
        size_t count;
        if (key->shape != DRAPE_SCENE_OBJECTS || !key->child->least_size)
            continue;
        memcpy(&from, def + key->offset, sizeof from);
        memcpy(&count, def + key->count_offset, sizeof count);
        if (!from || count == 0 || (key->at_most && count > key->at_most))
            continue;
        const size_t size = key->child->def_size, stride = stride_of(from, count, size);
        if (!drape_def_fits(stride, key->child->least_size, size))
            return drape_fail(ctx, DRAPE_E_VERSION,
                              "a def was not initialised by drape_%s_def_init of this version",
                              key->child->name);
        char *to = drape_arena_take(arena, count, size);
        if (!to)
            return DRAPE_E_MEMORY;
        memcpy(def + key->offset, &to, sizeof to);
        for (size_t i = 0; i < count; i++) {
            drape_scene_set_defaults(key->child, to + i * size);
            memcpy(to + i * size, from + i * stride, stride);
            memcpy(to + i * size, &size, sizeof size);
            DRAPE_TRY(widen_arrays(ctx, arena, key->child, to + i * size));
        }
    }
    return DRAPE_OK;
}

drape_status drape_compile_read_def(drape_context *ctx, drape_arena *arena, const drape_scene_def *given,
                                    drape_scene_def *out)
{
    if (!given || !drape_def_fits(given->struct_size, drape_form_scene.least_size, sizeof *out))
        return drape_fail(ctx, DRAPE_E_VERSION,
                          "the scene def was not initialised by drape_scene_def_init of this version");
    drape_scene_def_init(out, sizeof *out);
    memcpy(out, given, given->struct_size);
    out->struct_size = sizeof *out;
    return widen_arrays(ctx, arena, &drape_form_scene, (char *)out);
}
