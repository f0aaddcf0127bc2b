/* scene_def.c: the defaults of the defs of a scene.
 *
 * struct_size is the caller's sizeof: a caller built against an older header has a shorter struct, whose
 * members are the first ones of ours; of a longer one, the members that we do not know become zero. */
#include <string.h>

#include "drape/drape.h"

static void give(void *def, size_t struct_size, const void *defaults, size_t size)
{
    if (!def)
        return;
    memset(def, 0, struct_size);
    memcpy(def, defaults, struct_size < size ? struct_size : size);
}

void drape_scene_def_init(drape_scene_def *def, size_t struct_size)
{
    const drape_scene_def defaults = {
        .struct_size = struct_size,
        .gravity = {0, -9.81, 0},
        .integrator = {.type = "be"},
        .controller = {.type = "halving"},
        .duration = 1,
        .frame_rate = 60,
    };
    give(def, struct_size, &defaults, sizeof defaults);
}

void drape_mesh_def_init(drape_mesh_def *def, size_t struct_size)
{
    const drape_mesh_def defaults = {.scale = {1, 1, 1}};
    give(def, struct_size, &defaults, sizeof defaults);
}

void drape_cloth_def_init(drape_cloth_def *def, size_t struct_size)
{
    drape_cloth_def defaults = {.struct_size = struct_size};
    drape_mesh_def_init(&defaults.mesh, sizeof defaults.mesh);
    give(def, struct_size, &defaults, sizeof defaults);
}

void drape_collider_def_init(drape_collider_def *def, size_t struct_size)
{
    const drape_collider_def defaults = {.struct_size = struct_size};
    give(def, struct_size, &defaults, sizeof defaults);
}

void drape_pin_def_init(drape_pin_def *def, size_t struct_size)
{
    const drape_pin_def defaults = {.struct_size = struct_size, .row = -1};
    give(def, struct_size, &defaults, sizeof defaults);
}
