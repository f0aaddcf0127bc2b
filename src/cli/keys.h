/* keys.h: the keys of a scene, seen as `drape list` shows tables: objects, where they lie, and what each key
 * takes, from the tables that the reader uses. */
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

/* What a key takes, in words: "a number above 0, at most 1e+09". */
void cli_key_text(const drape_scene_key *key, char *text, size_t size);

/* Which keys of an object stand for each other: "exactly one of grid, file"; "" for none. */
void cli_one_of_text(const drape_scene_object *form, char *text, size_t size);

bool cli_is_one_of(const drape_scene_object *form, const drape_scene_key *key);

#endif
