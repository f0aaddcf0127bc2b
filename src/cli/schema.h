/* schema.h: the form of a scene as a JSON Schema, draft 2020-12, from the tables that the reader uses. */
#ifndef DRAPE_CLI_SCHEMA_H
#define DRAPE_CLI_SCHEMA_H

#include "model/scene.h"

#include <jansson.h>

json_t *cli_schema(void); /* a new reference; NULL: out of memory */

/* Whether a key is one of the alternatives of its object. */
bool cli_is_one_of(const drape_scene_object *form, const drape_scene_key *key);

#endif
