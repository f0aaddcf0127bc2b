/* scene_json.h: the JSON tree of a scene as defs. */
#ifndef DRAPE_MODEL_SCENE_JSON_H
#define DRAPE_MODEL_SCENE_JSON_H

#include <jansson.h>

#include "base/arena.h"
#include "model/scene_text.h"

/* Strings of the defs are those of the tree, arrays are in the arena. root is an object. Faults are at
 * pointers. Errors: DRAPE_E_ARGUMENT, DRAPE_E_VERSION, DRAPE_E_MEMORY. The locale must be "C". */
drape_status drape_scene_read(drape_context *ctx, drape_arena *arena, json_t *root, drape_scene_def *def);

/* Checks the value at a pointer against its parameter. */
drape_status drape_json_check(drape_context *ctx, const drape_pointer *at, const drape_param *param,
                              json_t *value);

/* A value in a few words, for messages: -1, "be", an array of 2, an object. */
void drape_json_describe(json_t *value, char *text, size_t size);

#endif
