/* scene_cs184.h: converts scenes of the CS184 cloth simulator to our format. */
#ifndef DRAPE_MODEL_SCENE_CS184_H
#define DRAPE_MODEL_SCENE_CS184_H

#include <jansson.h>

#include "base/context.h"

/* Whether the tree of a scene has the form of CS184: "cloth" is one object, and there is no "drape" key. */
bool drape_scene_is_cs184(json_t *root);

/* Converts the scene to our format; *out receives a new reference. Faults are reported at pointers into root.
 * Errors: DRAPE_E_ARGUMENT, DRAPE_E_MEMORY. */
drape_status drape_scene_from_cs184(drape_context *ctx, json_t *root, json_t **out);

#endif
