/*
 * read_def.c: the defs of a host that was built against an older header, whose structs ended earlier. Each def begins with its
 * size as the host knew it, which in an array is the way to the next; what the host did not know has its default.
 */
#include "compile/stages.h"

#include <stddef.h>
#include <string.h>

/* One kind of def: its size here, one that is all defaults, who makes those, and how many there may be. */
typedef struct kind {
    const char *init;
    size_t size, most;
    const void *defaults;
} kind;

static size_t size_at(const void *def)
{
    size_t size;
    memcpy(&size, def, sizeof size);
    return size;
}

/* *out: count defs as they are here, in the arena. NULL, or more than there may be, is not read: drape_compile_check_def
 * finds what is missing, and refuses such a count. */
static drape_status widen(drape_context *ctx, drape_arena *arena, const kind *k, const void *given,
                          size_t count, const void **out)
{
    *out = given;
    if (!given || count == 0 || count > k->most)
        return DRAPE_OK;
    size_t stride = size_at(given);
    const char *from = given;
    for (size_t i = 0; i < count && stride > 0 && stride <= k->size; i++)
        if (size_at(from + i * stride) != stride)
            stride = 0;
    if (stride < sizeof(size_t) || stride > k->size)
        return drape_fail(ctx, DRAPE_E_VERSION, "a def was not initialised by %s of this version", k->init);
    char *to = drape_arena_take(arena, count, k->size);
    *out = to;
    for (size_t i = 0; to && i < count; i++) {
        memcpy(to + i * k->size, k->defaults, k->size);
        memcpy(to + i * k->size, from + i * stride, stride);
        memcpy(to + i * k->size, &k->size, sizeof k->size);
    }
    return to ? DRAPE_OK : DRAPE_E_MEMORY;
}

static drape_status read_pins(drape_context *ctx, drape_arena *arena, drape_cloth_def *cloth)
{
    drape_pin_def defaults;
    const void *pins;
    drape_pin_def_init(&defaults, sizeof defaults);
    const kind k = {"drape_pin_def_init", sizeof defaults, SIZE_MAX, &defaults};
    drape_status status = widen(ctx, arena, &k, cloth->pins, cloth->pin_count, &pins);
    cloth->pins = pins;
    return status;
}

static drape_status read_cloths(drape_context *ctx, drape_arena *arena, drape_scene_def *def)
{
    drape_cloth_def defaults;
    const void *list;
    drape_cloth_def_init(&defaults, sizeof defaults);
    const kind k = {"drape_cloth_def_init", sizeof defaults, DRAPE_MOST_CLOTHS, &defaults};
    drape_status status = widen(ctx, arena, &k, def->cloths, def->cloth_count, &list);
    drape_cloth_def *own = (drape_cloth_def *)(list == def->cloths ? NULL : list);
    def->cloths = list;
    for (size_t c = 0; !status && own && c < def->cloth_count; c++)
        status = read_pins(ctx, arena, &own[c]);
    return status;
}

static drape_status read_colliders(drape_context *ctx, drape_arena *arena, drape_scene_def *def)
{
    drape_collider_def defaults;
    const void *list;
    drape_collider_def_init(&defaults, sizeof defaults);
    const kind k = {"drape_collider_def_init", sizeof defaults, DRAPE_MOST_COLLIDERS, &defaults};
    drape_status status = widen(ctx, arena, &k, def->colliders, def->collider_count, &list);
    def->colliders = list;
    return status;
}

drape_status drape_compile_read_def(drape_context *ctx, drape_arena *arena, const drape_scene_def *given,
                                    drape_scene_def *out)
{
    if (!given || given->struct_size < offsetof(drape_scene_def, cloths) || given->struct_size > sizeof *out)
        return drape_fail(ctx, DRAPE_E_VERSION,
                          "the scene def was not initialised by drape_scene_def_init of this version");
    drape_scene_def_init(out, sizeof *out);
    memcpy(out, given, given->struct_size);
    out->struct_size = sizeof *out;
    drape_status status = read_cloths(ctx, arena, out);
    return status ? status : read_colliders(ctx, arena, out);
}
