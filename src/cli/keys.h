/* keys.h: the objects of a scene and where they lie, from the tables that the reader uses, for `drape
 * list`. */
#ifndef DRAPE_CLI_KEYS_H
#define DRAPE_CLI_KEYS_H

#include "model/scene.h"

#define CLI_MAX_OBJECTS 32

/* An object of a scene that has keys of its own. */
typedef struct cli_object {
    const drape_scene_object *form;
    char pointer[64]; /* "/cloth/N/mesh"; "" for the scene itself */
} cli_object;

/* The objects of a scene, each before those inside it, in the order of their keys. Returns their number. */
int cli_objects(cli_object objects[CLI_MAX_OBJECTS]);

/* Whether a key is one of the alternatives of its object. */
bool cli_is_one_of(const drape_scene_object *form, const drape_scene_key *key);

#endif
