/* form.h: parameters and objects of a scene as JSON, from their tables, so that `drape info` shows every new
 * key. All functions return new references and are NULL if memory runs out. */
#ifndef DRAPE_CLI_FORM_H
#define DRAPE_CLI_FORM_H

#include "model/model.h"
#include "model/scene.h"

#include <jansson.h>

/* A described value is an object with "value", "unit", "plain": true and, where it is known, "default"; plain
 * JSON has the value alone in its place. Takes the reference to the value. */
json_t *cli_described(json_t *value, const char *unit);
bool cli_is_described(const json_t *value); /* or a parameter, which has no "plain" */

/* Replaces all described values inside an object or array. */
void cli_make_plain(json_t *value);

/* The value of a parameter, which is this text if it is one; NULL: an empty one. */
json_t *cli_value_json(const drape_param *param, const double *value, const char *text);

/* Each parameter with "value", "unit" and "default". choice: what the scene said; NULL: not known, a value
 * that equals the default counts as one, and texts are empty. */
json_t *cli_params_json(const drape_param *params, int param_count, const double *values,
                        const drape_choice *choice);

/* The parameters of an entry as described values. derived: also those that follow from others. */
json_t *cli_values_json(const drape_entry *entry, const double *values, bool derived);

/* Adds the keys that have a value, described and with "default", except names, which are shown where they are
 * used, and children. */
json_t *cli_with_keys(json_t *object, const drape_scene_object *form, const void *def);

/* An object of a scene with all values of its def, those by default included; an array of such. */
json_t *cli_form_json(const drape_scene_object *form, const void *def);
json_t *cli_forms_json(const drape_scene_object *form, const void *defs, size_t count);

#endif
