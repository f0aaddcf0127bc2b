/* schema.h: the form of a scene as a JSON Schema, draft 2020-12, from the tables that the reader uses; and
 * values of its parameters as JSON. */
#ifndef DRAPE_CLI_SCHEMA_H
#define DRAPE_CLI_SCHEMA_H

#include "model/scene.h"

#include <jansson.h>

json_t *cli_schema(void); /* a new reference; NULL: out of memory */

/* The value of a parameter, which is this text if it is one; NULL: an empty one. */
json_t *cli_value_json(const drape_param *param, const double *value, const char *text);

/* Whether a key is one of the alternatives of its object. */
bool cli_is_one_of(const drape_scene_object *form, const drape_scene_key *key);

#endif
