/* scene_cs184.h: scenes of the CS184 cloth simulator, as scenes of our form. */
#ifndef DRAPE_MODEL_SCENE_CS184_H
#define DRAPE_MODEL_SCENE_CS184_H

#include <jansson.h>

#include "base/context.h"

/* Whether the tree of a scene has the shape of theirs: "cloth" is one object, and no "drape" says
 * otherwise. */
bool drape_scene_is_cs184(json_t *root);

/* The same scene in our form, a new reference in *out. Faults are at pointers into root. Errors:
 * DRAPE_E_ARGUMENT, DRAPE_E_MEMORY. */
drape_status drape_scene_from_cs184(drape_context *ctx, json_t *root, json_t **out);

#endif
