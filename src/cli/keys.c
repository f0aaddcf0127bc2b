/* keys.c: see keys.h. */
#include "cli/keys.h"

#include <stdio.h>
#include <string.h>

static bool is_array(const drape_scene_key *key)
{
    return key->shape == DRAPE_SCENE_OBJECTS || key->shape == DRAPE_SCENE_ENTRIES;
}

static int add_objects(cli_object *objects, int count, const drape_scene_object *form, const char *pointer)
{
    if (count == CLI_MAX_OBJECTS || form->key_count == 0)
        return count;
    cli_object *object = &objects[count++];
    object->form = form;
    snprintf(object->pointer, sizeof object->pointer, "%s", pointer);
    for (size_t i = 0; i < form->key_count; i++) {
        const drape_scene_key *key = &form->keys[i];
        char inside[sizeof object->pointer];
        snprintf(inside, sizeof inside, "%.40s/%.18s%s", pointer, key->param.name, is_array(key) ? "/N" : "");
        if (key->child)
            count = add_objects(objects, count, key->child, inside);
    }
    return count;
}

int cli_objects(cli_object objects[CLI_MAX_OBJECTS])
{
    return add_objects(objects, 0, &drape_form_scene, "");
}

bool cli_is_one_of(const drape_scene_object *form, const drape_scene_key *key)
{
    for (int i = 0; form->one_of && form->one_of[i]; i++)
        if (strcmp(form->one_of[i], key->param.name) == 0)
            return true;
    return false;
}
