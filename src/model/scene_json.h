/* scene_json.h: the JSON tree of a scene: converts it to defs, or from the form of CS184 to ours, and prints
 * it. */
#ifndef DRAPE_MODEL_SCENE_JSON_H
#define DRAPE_MODEL_SCENE_JSON_H

#include <jansson.h>

#include "base/arena.h"
#include "model/scene.h"
#include "model/scene_text.h"

/* Strings of the defs are those of the tree; arrays are allocated in the arena. root must be an object.
 * Faults are reported at pointers. The locale must be "C". Errors: DRAPE_E_ARGUMENT, DRAPE_E_VERSION,
 * DRAPE_E_MEMORY. */
drape_status drape_scene_read(drape_context *ctx, drape_arena *arena, json_t *root, drape_scene_def *def);

/* Checks the value at a pointer against its parameter. */
drape_status drape_json_check(drape_context *ctx, const drape_pointer *at, const drape_param *param,
                              json_t *value);

/* Refuses a value at a pointer: "-1 is not allowed; radius is a number above 0". */
drape_status drape_json_refuse(drape_context *ctx, const drape_pointer *at, json_t *value, const char *what,
                               const char *expected);

/* Describes a value briefly, for messages: -1, "be", an array of 2, an object. */
const char *drape_json_describe(json_t *value, char text[DRAPE_POINTER_SIZE]);
#define DRAPE_JSON_DESCRIBE(value) drape_json_describe(value, (char[DRAPE_POINTER_SIZE]){0})

/* Whether the tree of a scene has the form of CS184: "cloth" is one object, and there is no "drape" key. */
bool drape_scene_is_cs184(json_t *root);

/* Converts the scene to our format; *out receives a new reference. Faults are reported at pointers into root.
 * Errors: DRAPE_E_ARGUMENT, DRAPE_E_MEMORY. */
drape_status drape_scene_from_cs184(drape_context *ctx, json_t *root, json_t **out);

/* Prints a tree as text. The locale must be "C". */
void drape_json_print(json_t *value, drape_text_sink *sink, void *user);

#endif
