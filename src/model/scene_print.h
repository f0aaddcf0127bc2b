/* scene_print.h: prints a JSON tree as text. */
#ifndef DRAPE_MODEL_SCENE_PRINT_H
#define DRAPE_MODEL_SCENE_PRINT_H

#include <jansson.h>

#include "model/scene.h"

/* The locale must be "C". */
void drape_json_print(json_t *value, drape_text_sink *sink, void *user);

#endif
