/* keys.c: see keys.h. */
#include "cli/keys.h"

#include <stdio.h>
#include <string.h>

/* ---- Objects ---- */

static bool is_list(const drape_scene_key *key)
{
    return key->kind == DRAPE_SCENE_OBJECTS || key->kind == DRAPE_SCENE_ROWS;
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
        snprintf(inside, sizeof inside, "%.40s/%.18s%s", pointer, key->name, is_list(key) ? "/N" : "");
        if (key->child)
            count = add_objects(objects, count, key->child, inside);
    }
    return count;
}

int cli_objects(cli_object objects[CLI_MAX_OBJECTS])
{
    return add_objects(objects, 0, &drape_scene_form, "");
}

/* ---- Keys ---- */

/* What does not depend on more than the kind. */
static const char *const forms[] = {
    [DRAPE_SCENE_VERSION] = "1",
    [DRAPE_SCENE_TEXT] = "a text",
    [DRAPE_SCENE_WORD] = "a word",
    [DRAPE_SCENE_WORDS] = "a list of words",
    [DRAPE_SCENE_BOOLEAN] = "true or false",
    [DRAPE_SCENE_NUMBER] = "a number",
    [DRAPE_SCENE_INTEGER] = "an integer",
    [DRAPE_SCENE_INTEGERS] = "a list of integers",
    [DRAPE_SCENE_VECTOR] = "[x, y, z]",
    [DRAPE_SCENE_SCALE] = "a number or [x, y, z]",
    [DRAPE_SCENE_ROTATION] = "[x, y, z, angle] or [x, y, z]",
    [DRAPE_SCENE_BOX] = "[[x, y, z], [x, y, z]]",
    [DRAPE_SCENE_TRACK] = "[[t, [x, y, z]], ...]",
    [DRAPE_SCENE_OBJECT] = "an object",
    [DRAPE_SCENE_OBJECTS] = "a list of objects",
    [DRAPE_SCENE_ROWS] = "a list of names, or of objects with a \"type\"",
};

/* Appends printf style, as far as there is room. */
static void append(char *text, size_t size, const char *format, const char *word)
{
    size_t length = strlen(text);
    snprintf(text + length, size - length, format, word);
}

static void append_range(const drape_scene_key *key, char *text, size_t size)
{
    char bound[32];
    if (key->kind == DRAPE_SCENE_NUMBER || key->min > 0 || key->max < INT32_MAX) {
        snprintf(bound, sizeof bound, "%.9g", key->min);
        append(text, size, key->kind == DRAPE_SCENE_NUMBER && !key->closed ? " above %s" : " from %s", bound);
        snprintf(bound, sizeof bound, "%.9g", key->max);
        append(text, size, " to %s", bound);
    } else {
        append(text, size, "%s", " from 0");
    }
}

void cli_key_text(const drape_scene_key *key, char *text, size_t size)
{
    const bool bounded = key->kind == DRAPE_SCENE_NUMBER || key->kind == DRAPE_SCENE_INTEGER ||
                         key->kind == DRAPE_SCENE_INTEGERS;
    snprintf(text, size, "%s", key->words ? "" : forms[key->kind]);
    for (int i = 0; key->words && key->words[i]; i++)
        append(text, size, i ? ", \"%s\"" : "\"%s\"", key->words[i]);
    if (bounded)
        append_range(key, text, size);
    if (key->required)
        append(text, size, "%s", "; required");
}

void cli_one_of_text(const drape_scene_object *form, char *text, size_t size)
{
    *text = 0;
    for (int i = 0; form->one_of && form->one_of[i]; i++)
        append(text, size, i ? ", %s" : "exactly one of %s", form->one_of[i]);
}

bool cli_is_one_of(const drape_scene_object *form, const drape_scene_key *key)
{
    for (int i = 0; form->one_of && form->one_of[i]; i++)
        if (strcmp(form->one_of[i], key->name) == 0)
            return true;
    return false;
}
