/* scene_def.c: the values of keys in defs: defaults, storing and reading; and descriptions of keys as
 * text. */
#include "model/scene.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/def.h"
#include "base/vec3.h"
#include "model/scene_text.h"

/* ---- Keys by name and pointer ---- */

const drape_scene_key *drape_scene_key_of(const drape_scene_object *object, const char *name)
{
    for (size_t i = 0; i < object->key_count; i++)
        if (strcmp(object->keys[i].param.name, name) == 0)
            return &object->keys[i];
    return NULL;
}

const drape_scene_key *drape_scene_key_at(const char *pointer)
{
    const drape_scene_object *object = &drape_form_scene;
    const drape_scene_key *key = NULL;
    char name[DRAPE_POINTER_SIZE];
    while (object && *pointer) {
        pointer = drape_pointer_next(pointer, name);
        key = pointer ? drape_scene_key_of(object, name) : NULL;
        if (!key)
            return NULL;
        object = key->child;
        if (object && key->shape != DRAPE_SCENE_OBJECT && *pointer) /* skip the index of an element */
            pointer = drape_pointer_next(pointer, name);
        if (!pointer)
            return NULL;
    }
    return key;
}

/* ---- Values ---- */

bool drape_scene_value(const drape_scene_key *key, const void *def, drape_setting *out)
{
    const char *at = (const char *)def + key->offset;
    int32_t integer = 0;
    bool boolean = false;
    *out = (drape_setting){.name = key->param.name};
    switch (key->param.kind) {
    case DRAPE_PARAM_NUMBER:
        memcpy(&out->number, at, sizeof out->number);
        return !isnan(out->number) || !key->param.derived;
    case DRAPE_PARAM_INTEGER:
        memcpy(&integer, at, sizeof integer);
        out->number = integer;
        return integer >= key->param.min || integer < -1 || !isnan(key->param.default_value);
    case DRAPE_PARAM_BOOLEAN:
        memcpy(&boolean, at, sizeof boolean);
        out->number = boolean;
        return true;
    case DRAPE_PARAM_VECTOR:
    case DRAPE_PARAM_TURN:
        out->vector = (const double *)(const void *)at;
        out->vector_count = key->param.kind == DRAPE_PARAM_TURN ? 4 : 3;
        return !isnan(*out->vector);
    case DRAPE_PARAM_CHOICE:
    case DRAPE_PARAM_TEXT:
        memcpy(&out->text, at, sizeof out->text);
        break;
    case DRAPE_PARAM_POINTS: /* only settings are points */
        break;
    }
    return out->text;
}

size_t drape_scene_texts(const drape_scene_key *key, const void *def, const char *const **texts)
{
    size_t count;
    memcpy(texts, (const char *)def + key->offset, sizeof *texts);
    memcpy(&count, (const char *)def + key->count_offset, sizeof count);
    return key->param.kind == DRAPE_PARAM_TEXT ? count : 0;
}

void drape_scene_store(const drape_scene_key *key, const drape_setting *setting, const double *values,
                       void *def)
{
    char *at = (char *)def + key->offset;
    const bool given = !isnan(*values);
    const int32_t integer = given ? (int32_t)*values : -1;
    const bool boolean = *values != 0;
    const char *word = NULL;
    double rotation[4] = {0};
    switch (key->param.kind) {
    case DRAPE_PARAM_NUMBER:
        memcpy(at, values, sizeof *values);
        return;
    case DRAPE_PARAM_INTEGER:
        memcpy(at, &integer, sizeof integer);
        return;
    case DRAPE_PARAM_BOOLEAN:
        memcpy(at, &boolean, sizeof boolean);
        return;
    case DRAPE_PARAM_VECTOR:
        memcpy(at, values, 3 * sizeof *values);
        return;
    case DRAPE_PARAM_TURN: /* axis and angle exactly as given, not converted as in `values` */
        memcpy(rotation, setting->vector, setting->vector_count * sizeof *rotation);
        if (setting->vector_count == 3)
            rotation[3] = vec3_norm(rotation);
        memcpy(at, rotation, sizeof rotation);
        return;
    case DRAPE_PARAM_CHOICE:
        word = given ? key->param.choices[(int)*values] : NULL;
        break;
    case DRAPE_PARAM_TEXT:
        word = setting->text;
        break;
    case DRAPE_PARAM_POINTS:
        return;
    }
    memcpy(at, &word, sizeof word);
}

/* ---- Defaults ---- */

/* Arrays without a default stay empty, as in a zeroed def; a list has at most one text as its default. */
void drape_scene_set_defaults(const drape_scene_object *object, void *def)
{
    static const double no_rotation[4] = {0};
    const size_t one = 1;
    if (object->least_size)
        memcpy(def, &object->def_size, sizeof object->def_size);
    for (size_t i = 0; i < object->key_count; i++) {
        const drape_scene_key *key = &object->keys[i];
        const char *const *text = &key->param.derived;
        double values[DRAPE_PARAM_WIDEST];
        const drape_setting setting = {
            .text = key->literal ? *text : NULL, .vector = no_rotation, .vector_count = 4};
        if (key->shape == DRAPE_SCENE_OBJECT && key->child->key_count > 0)
            drape_scene_set_defaults(key->child, (char *)def + key->offset);
        if (key->shape == DRAPE_SCENE_LIST && key->literal) {
            memcpy((char *)def + key->offset, &text, sizeof text);
            memcpy((char *)def + key->count_offset, &one, sizeof one);
        }
        if (key->shape != DRAPE_SCENE_VALUE)
            continue;
        drape_param_default(&key->param, values);
        drape_scene_store(key, &setting, key->vector ? key->vector : values, def);
    }
}

/* Two defaults of hosts differ from the table of keys. A text must give a duration, so its key has no
 * default; a host need not, as it may step for as long as it likes. `drape run` writes the frames of a text
 * to files by default; a host reads the states itself, so it starts without formats. */
void drape_scene_def_init(drape_scene_def *def, size_t struct_size)
{
    drape_scene_def defaults = {.struct_size = 0};
    drape_scene_set_defaults(&drape_form_scene, &defaults);
    defaults.struct_size = struct_size;
    defaults.duration = 1;
    defaults.formats = NULL;
    defaults.format_count = 0;
    drape_def_fill(def, struct_size, &defaults, sizeof defaults);
}

void drape_mesh_def_init(drape_mesh_def *def, size_t struct_size)
{
    drape_mesh_def defaults = {.file = NULL};
    drape_scene_set_defaults(&drape_form_mesh, &defaults);
    drape_def_fill(def, struct_size, &defaults, sizeof defaults);
}

/* Defines drape_NAME_def_init, for a struct whose defaults are all in the table of keys. */
#define DEFINE_INIT(name)                                                                                    \
    void drape_##name##_def_init(drape_##name##_def *def, size_t struct_size)                                \
    {                                                                                                        \
        drape_##name##_def defaults = {.struct_size = 0};                                                    \
        drape_scene_set_defaults(&drape_form_##name, &defaults);                                             \
        defaults.struct_size = struct_size;                                                                  \
        drape_def_fill(def, struct_size, &defaults, sizeof defaults);                                        \
    }
DEFINE_INIT(cloth)
DEFINE_INIT(collider)
DEFINE_INIT(event)
DEFINE_INIT(seam)
DEFINE_INIT(pin)
DEFINE_INIT(history)
DEFINE_INIT(mass)
DEFINE_INIT(periodic)

/* ---- Keys as text ---- */

const char *drape_scene_takes_text(const drape_scene_key *key, char *text, size_t size)
{
    static const char *const shapes[] = {[DRAPE_SCENE_VALUE] = "",
                                         [DRAPE_SCENE_LIST] = "an array, each ",
                                         [DRAPE_SCENE_VERSION] = "the number 1",
                                         [DRAPE_SCENE_REMARK] = "a string",
                                         [DRAPE_SCENE_BOX] = "two corners, [[x, y, z], [x, y, z]]",
                                         [DRAPE_SCENE_TRACK] = "an array of [time, [x, y, z]]",
                                         [DRAPE_SCENE_QUATERNION] = "four numbers, [w, x, y, z]",
                                         [DRAPE_SCENE_OBJECT] = "an object",
                                         [DRAPE_SCENE_OBJECTS] = "an array of objects",
                                         [DRAPE_SCENE_ENTRIES] =
                                             "an array of names, or objects with a \"type\""};
    const bool has_values = key->shape == DRAPE_SCENE_VALUE || key->shape == DRAPE_SCENE_LIST;
    const bool has_unit = !has_values && strcmp(key->param.unit, "1") != 0;
    snprintf(text, size, "%s%s%s%s%s%s", shapes[key->shape], has_values ? DRAPE_PARAM_TAKES(&key->param) : "",
             has_unit ? ", in " : "", has_unit ? key->param.unit : "", key->at_least ? ", at least one" : "",
             key->at_most ? DRAPE_FORMAT(", at most %zu", key->at_most) : "");
    return text;
}

const char *drape_scene_one_of_text(const drape_scene_object *object, char *text, size_t size)
{
    snprintf(text, size, "%s%s", object->one_of ? "exactly one of " : "",
             object->one_of ? object->one_of[0] : "");
    for (int i = 1; object->one_of && object->one_of[i]; i++)
        drape_list_add(text, size, object->one_of[i]);
    return text;
}

void drape_scene_default_text(const drape_scene_key *key, char *text, size_t size)
{
    double values[DRAPE_PARAM_WIDEST];
    drape_param_default(&key->param, values);
    if (key->literal)
        snprintf(text, size, "\"%s\"", key->param.derived);
    else
        drape_param_value_text(&key->param, key->vector ? key->vector : values, text, size);
}
