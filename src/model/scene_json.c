/* scene_json.c: walks the tree of a scene along the tables of scene_keys.c: one reader a kind of key. */
#include "model/scene_json.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/param.h"
#include "base/vec3.h"
#include "model/scene.h"
#include "model/scene_text.h"

#define MOST_KEYS 16 /* of one object, for the lists in messages */

typedef struct reader {
    drape_context *ctx;
    drape_arena *arena;
    drape_pointer at; /* of the value that is being read */
} reader;

/* Reads the value of a key into def, the def of the object that has the key. */
typedef drape_status read_function(reader *r, const drape_scene_key *key, json_t *value, char *def);
static read_function read_value;

/* ---- Words for messages ---- */

/* The shortest text that reads back as the number. */
static void describe_number(double number, char *text, size_t size)
{
    for (int digits = 6; digits <= 17; digits++) {
        snprintf(text, size, "%.*g", digits, number);
        if (strtod(text, NULL) == number)
            return;
    }
}

/* In quotes, shortened if it is long. */
static void quote(const char *string, char *text, size_t size)
{
    char some[61];
    snprintf(some, sizeof some, "%s", string);
    drape_text_mend_end(some);
    snprintf(text, size, "\"%s%s\"", some, strlen(some) < strlen(string) ? "..." : "");
}

void drape_json_describe(json_t *value, char *text, size_t size)
{
    switch (json_typeof(value)) {
    case JSON_OBJECT:
        snprintf(text, size, "an object");
        break;
    case JSON_ARRAY:
        if (json_array_size(value) == 0)
            snprintf(text, size, "an empty array");
        else
            snprintf(text, size, "an array of %zu", json_array_size(value));
        break;
    case JSON_STRING:
        quote(json_string_value(value), text, size);
        break;
    case JSON_INTEGER:
    case JSON_REAL:
        describe_number(json_number_value(value), text, size);
        break;
    case JSON_TRUE:
    case JSON_FALSE:
        snprintf(text, size, "%s", json_is_true(value) ? "true" : "false");
        break;
    case JSON_NULL:
        snprintf(text, size, "null");
    }
}

static const char *kind_text(drape_scene_kind kind)
{
    switch (kind) {
    case DRAPE_SCENE_VERSION:
        return "the number 1";
    case DRAPE_SCENE_TEXT:
        return "a string";
    case DRAPE_SCENE_WORD:
        return "a string, not empty";
    case DRAPE_SCENE_WORDS:
        return "an array of strings, none empty";
    case DRAPE_SCENE_BOOLEAN:
        return "true or false";
    case DRAPE_SCENE_NUMBER:
        return "a number";
    case DRAPE_SCENE_INTEGER:
        return "an integer";
    case DRAPE_SCENE_INTEGERS:
        return "an array of integers";
    case DRAPE_SCENE_VECTOR:
        return "three numbers, [x, y, z]";
    case DRAPE_SCENE_SCALE:
        return "a number, or three, [x, y, z]";
    case DRAPE_SCENE_ROTATION:
        return "axis and angle, [x, y, z, angle], or a rotation vector, [x, y, z]";
    case DRAPE_SCENE_BOX:
        return "two corners, [[x, y, z], [x, y, z]]";
    case DRAPE_SCENE_TRACK:
        return "an array of [time, [x, y, z]]";
    case DRAPE_SCENE_OBJECT:
        return "an object";
    case DRAPE_SCENE_OBJECTS:
        return "an array of objects";
    case DRAPE_SCENE_ROWS:
        return "an array of names, or objects with a \"type\"";
    }
    return "";
}

/* "a number in (0, 1000000000] s", "three numbers, [x, y, z], in m": what a key may be. */
static void expectation(const drape_scene_key *key, char *text, size_t size)
{
    char range[100] = "";
    const char *unit = key->unit ? key->unit : "1";
    bool ranged = key->max > 0;
    if (ranged) {
        const drape_param param = {.kind = DRAPE_PARAM_NUMBER,
                                   .unit = unit,
                                   .min = key->min,
                                   .max = key->max,
                                   .open_min = key->kind == DRAPE_SCENE_NUMBER && !key->closed};
        drape_param_range_text(&param, range, sizeof range);
    }
    snprintf(text, size, "%s%s%s%s%s%s", kind_text(key->kind), ranged ? " in " : "", range,
             !ranged && key->unit ? ", in " : "", !ranged && key->unit ? key->unit : "",
             key->at_least ? ", at least one" : "");
}

/* ---- Faults ---- */

static drape_status refuse_as(reader *r, json_t *value, const char *what, const char *expected)
{
    char given[80];
    drape_json_describe(value, given, sizeof given);
    return drape_fail_at(r->ctx, DRAPE_E_ARGUMENT, r->at.text, "%s is not allowed; %s is %s", given, what,
                         expected);
}

static drape_status refuse(reader *r, const drape_scene_key *key, json_t *value)
{
    char expected[200];
    expectation(key, expected, sizeof expected);
    return refuse_as(r, value, key->name, expected);
}

static drape_status refuse_element(reader *r, size_t index, json_t *value, const char *what,
                                   const char *expected)
{
    drape_pointer_push_index(&r->at, index);
    return refuse_as(r, value, what, expected);
}

static drape_status missing(reader *r, const drape_scene_key *key)
{
    char expected[200];
    expectation(key, expected, sizeof expected);
    drape_pointer_push(&r->at, key->name);
    return drape_fail_at(r->ctx, DRAPE_E_ARGUMENT, r->at.text, "\"%s\" is missing: %s; %s", key->name,
                         key->help, expected);
}

/* "a, b, c" */
static void list_words(const char *const *words, size_t count, char *text, size_t size)
{
    size_t used = 0;
    *text = 0;
    for (size_t i = 0; i < count && used < size; i++)
        used += (size_t)snprintf(text + used, size - used, "%s%s", i ? ", " : "", words[i]);
}

static drape_status unknown_key(reader *r, const drape_scene_object *object, const char *name)
{
    const char *known[MOST_KEYS];
    size_t count = 0;
    for (; count < object->key_count && count < MOST_KEYS; count++)
        known[count] = object->keys[count].name;
    char given[80], list[300];
    quote(name, given, sizeof given);
    list_words(known, count, list, sizeof list);
    const char *meant = drape_did_you_mean(name, known, count);
    drape_pointer_push(&r->at, name);
    if (meant)
        return drape_fail_at(r->ctx, DRAPE_E_ARGUMENT, r->at.text, "unknown key %s; did you mean \"%s\"?",
                             given, meant);
    if (object->open_with)
        return drape_fail_at(r->ctx, DRAPE_E_ARGUMENT, r->at.text, "unknown key %s without \"%s\"; known: %s",
                             given, object->open_with, list);
    return drape_fail_at(r->ctx, DRAPE_E_ARGUMENT, r->at.text, "unknown key %s; known: %s", given, list);
}

/* ---- Numbers ---- */

static drape_status read_version(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    (void)def;
    if (!json_is_number(value))
        return refuse(r, key, value);
    if (json_number_value(value) == DRAPE_SCENE_FORM)
        return DRAPE_OK;
    char given[40];
    describe_number(json_number_value(value), given, sizeof given);
    return drape_fail_at(r->ctx, DRAPE_E_VERSION, r->at.text,
                         "a scene of version %s; this library reads version %d", given, DRAPE_SCENE_FORM);
}

static drape_status read_boolean(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    bool given = json_is_true(value);
    if (!json_is_boolean(value))
        return refuse(r, key, value);
    memcpy(def + key->offset, &given, sizeof given);
    return DRAPE_OK;
}

static drape_status read_number(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    double number = json_number_value(value);
    bool high_enough = key->closed ? number >= key->min : number > key->min;
    if (!json_is_number(value) || !high_enough || !(number <= key->max))
        return refuse(r, key, value);
    memcpy(def + key->offset, &number, sizeof number);
    return DRAPE_OK;
}

/* Every number of the tree is a double: 3.0 is an integer as much as 3, and 2^53 + 1 is out of range anyway.
 */
static bool integer_of(const drape_scene_key *key, json_t *value, int32_t *integer)
{
    double number = json_number_value(value);
    if (!json_is_number(value) || !(number >= key->min && number <= key->max) || number != floor(number))
        return false;
    *integer = (int32_t)number;
    return true;
}

static drape_status read_integer(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    int32_t integer;
    if (!integer_of(key, value, &integer))
        return refuse(r, key, value);
    memcpy(def + key->offset, &integer, sizeof integer);
    return DRAPE_OK;
}

/* The elements of an array, which has as many as out. */
static drape_status read_numbers(reader *r, json_t *array, double *out)
{
    for (size_t i = 0; i < json_array_size(array); i++) {
        json_t *one = json_array_get(array, i);
        if (!json_is_number(one))
            return refuse_element(r, i, one, "an element", "a number");
        out[i] = json_number_value(one);
    }
    return DRAPE_OK;
}

/* Three numbers inside of another array, whose key would say too much. */
static drape_status read_three(reader *r, json_t *value, const char *what, double *out)
{
    return json_array_size(value) == 3 ? read_numbers(r, value, out)
                                       : refuse_as(r, value, what, kind_text(DRAPE_SCENE_VECTOR));
}

static drape_status read_vector(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    double vector[3];
    if (json_array_size(value) != 3) /* 0 if it is no array */
        return refuse(r, key, value);
    drape_status status = read_numbers(r, value, vector);
    if (!status)
        memcpy(def + key->offset, vector, sizeof vector);
    return status;
}

static drape_status read_scale(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    if (!json_is_number(value))
        return read_vector(r, key, value, def);
    double number = json_number_value(value), vector[3] = {number, number, number};
    memcpy(def + key->offset, vector, sizeof vector);
    return DRAPE_OK;
}

static drape_status read_rotation(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    double rotation[4] = {0};
    size_t count = json_array_size(value); /* 0 if it is none */
    if (count != 3 && count != 4)
        return refuse(r, key, value);
    drape_status status = read_numbers(r, value, rotation);
    if (status)
        return status;
    if (count == 3)
        rotation[3] = vec3_norm(rotation);
    if (!isfinite(rotation[3]))
        return drape_fail_at(r->ctx, DRAPE_E_ARGUMENT, r->at.text, "the rotation vector is too long");
    memcpy(def + key->offset, rotation, sizeof rotation);
    return DRAPE_OK;
}

static drape_status read_box(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    drape_pin_def *pin = (drape_pin_def *)(void *)def;
    double *const corners[2] = {pin->box_min, pin->box_max};
    if (json_array_size(value) != 2)
        return refuse(r, key, value);
    size_t mark = r->at.length;
    for (size_t i = 0; i < 2; i++) {
        drape_pointer_push_index(&r->at, i);
        drape_status status = read_three(r, json_array_get(value, i), "a corner", corners[i]);
        if (status)
            return status;
        drape_pointer_cut(&r->at, mark);
    }
    pin->has_box = true;
    return DRAPE_OK;
}

/* ---- Arrays ---- */

/* Takes the memory of an array with as many elements as value and puts it into the def; refuses what is no
 * array, or too short. */
static drape_status take_array(reader *r, const drape_scene_key *key, json_t *value, size_t size, char *def,
                               void *array)
{
    size_t count = json_array_size(value);
    if (!json_is_array(value) || count < key->at_least)
        return refuse(r, key, value);
    void *memory = count ? drape_arena_take(r->arena, count, size) : NULL;
    if (count && !memory)
        return DRAPE_E_MEMORY;
    memcpy(def + key->offset, &memory, sizeof memory);
    memcpy(def + key->count_offset, &count, sizeof count);
    memcpy(array, &memory, sizeof memory);
    return DRAPE_OK;
}

static drape_status read_integers(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    int32_t *integers = NULL;
    drape_status status = take_array(r, key, value, sizeof *integers, def, &integers);
    if (status)
        return status;
    for (size_t i = 0; i < json_array_size(value); i++)
        if (!integer_of(key, json_array_get(value, i), &integers[i])) {
            drape_scene_key one = *key;
            one.kind = DRAPE_SCENE_INTEGER;
            one.at_least = 0;
            drape_pointer_push_index(&r->at, i);
            char expected[100];
            expectation(&one, expected, sizeof expected);
            return refuse_as(r, json_array_get(value, i), "an element", expected);
        }
    return DRAPE_OK;
}

static bool is_word(json_t *value)
{
    return json_is_string(value) && json_string_length(value) > 0;
}

static drape_status read_words(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    const char **words = NULL;
    drape_status status = take_array(r, key, value, sizeof *words, def, &words);
    for (size_t i = 0; !status && i < json_array_size(value); i++) {
        json_t *one = json_array_get(value, i);
        words[i] = json_string_value(one);
        if (!is_word(one))
            status = refuse_element(r, i, one, "an element", kind_text(DRAPE_SCENE_WORD));
    }
    return status;
}

static drape_status read_track_key(reader *r, json_t *value, const drape_track_key *before,
                                   drape_track_key *out)
{
    if (json_array_size(value) != 2)
        return refuse_as(r, value, "a key of a track", "[time, [x, y, z]]");
    json_t *time = json_array_get(value, 0);
    if (!json_is_number(time))
        return refuse_element(r, 0, time, "the time of a key", "a number");
    out->time = json_number_value(time);
    if (before && !(out->time > before->time)) {
        char expected[100] = "greater than that of the key before, ";
        describe_number(before->time, expected + strlen(expected), 40);
        return refuse_element(r, 0, time, "the time of a key", expected);
    }
    drape_pointer_push_index(&r->at, 1);
    return read_three(r, json_array_get(value, 1), "a displacement", out->displacement);
}

static drape_status read_track(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    drape_track_key *keys = NULL;
    drape_status status = take_array(r, key, value, sizeof *keys, def, &keys);
    size_t mark = r->at.length;
    for (size_t i = 0; !status && i < json_array_size(value); i++) {
        drape_pointer_push_index(&r->at, i);
        status = read_track_key(r, json_array_get(value, i), i ? &keys[i - 1] : NULL, &keys[i]);
        if (!status)
            drape_pointer_cut(&r->at, mark);
    }
    return status;
}

/* ---- Strings ---- */

static drape_status read_text(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    (void)def;
    return json_is_string(value) ? DRAPE_OK : refuse(r, key, value);
}

static drape_status read_word(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    const char *word = json_string_value(value);
    if (!is_word(value))
        return refuse(r, key, value);
    memcpy(def + key->offset, &word, sizeof word);
    return DRAPE_OK;
}

/* ---- Objects ---- */

static bool has_key(const drape_scene_object *object, const char *name)
{
    for (size_t i = 0; i < object->key_count; i++)
        if (strcmp(object->keys[i].name, name) == 0)
            return true;
    return false;
}

static drape_status read_vector_setting(reader *r, json_t *value, drape_setting *out)
{
    double *numbers = drape_arena_take(r->arena, json_array_size(value), sizeof *numbers);
    if (!numbers)
        return DRAPE_E_MEMORY;
    out->vector = numbers;
    out->vector_count = json_array_size(value);
    return read_numbers(r, value, numbers);
}

static drape_status read_setting(reader *r, const char *name, json_t *value, drape_setting *out)
{
    size_t mark = r->at.length;
    *out = (drape_setting){.name = name};
    if (json_is_boolean(value)) {
        out->text = json_is_true(value) ? "true" : "false"; /* so that no number takes it */
    } else if (json_is_number(value)) {
        out->number = json_number_value(value);
    } else if (json_is_string(value)) {
        out->text = json_string_value(value);
    } else {
        drape_pointer_push(&r->at, name);
        drape_status status =
            json_is_array(value)
                ? read_vector_setting(r, value, out)
                : refuse_as(r, value, "a setting", "a number, true, false, a string or an array of numbers");
        if (status)
            return status;
        drape_pointer_cut(&r->at, mark);
    }
    return DRAPE_OK;
}

/* The members that are no keys: settings in an open object, faults in others. */
static drape_status read_others(reader *r, const drape_scene_object *object, json_t *value, char *def)
{
    drape_setting *settings = NULL;
    size_t count = 0;
    bool open = object->open && (!object->open_with || json_object_get(value, object->open_with));
    if (open) {
        settings = drape_arena_take(r->arena, json_object_size(value), sizeof *settings);
        if (!settings)
            return DRAPE_E_MEMORY;
    }
    for (void *it = json_object_iter(value); it; it = json_object_iter_next(value, it)) {
        const char *name = json_object_iter_key(it);
        if (has_key(object, name))
            continue;
        drape_status status = open ? read_setting(r, name, json_object_iter_value(it), &settings[count])
                                   : unknown_key(r, object, name);
        if (status)
            return status;
        count++;
    }
    if (open) { /* none is not the same as no object */
        memcpy(def + object->settings_offset, &settings, sizeof settings);
        memcpy(def + object->settings_count_offset, &count, sizeof count);
    }
    return DRAPE_OK;
}

static drape_status check_one_of(reader *r, const drape_scene_object *object, json_t *value)
{
    const char *given[MOST_KEYS];
    size_t count = 0, given_count = 0;
    for (; object->one_of && object->one_of[count]; count++)
        if (json_object_get(value, object->one_of[count]))
            given[given_count++] = object->one_of[count];
    if (count == 0 || given_count == 1)
        return DRAPE_OK;
    char wanted[200], found[200] = "none";
    list_words(object->one_of, count, wanted, sizeof wanted);
    if (given_count)
        list_words(given, given_count, found, sizeof found);
    return drape_fail_at(r->ctx, DRAPE_E_ARGUMENT, r->at.text, "exactly one of %s is needed; given: %s",
                         wanted, found);
}

static drape_status read_members(reader *r, const drape_scene_object *object, json_t *value, char *def)
{
    size_t mark = r->at.length;
    for (size_t i = 0; i < object->key_count; i++) {
        const drape_scene_key *key = &object->keys[i];
        json_t *member = json_object_get(value, key->name);
        if (!member && key->required)
            return missing(r, key);
        if (!member)
            continue;
        drape_pointer_push(&r->at, key->name);
        drape_status status = read_value(r, key, member, def);
        if (status)
            return status;
        drape_pointer_cut(&r->at, mark);
    }
    return DRAPE_OK;
}

/* Unknown keys first: what is missing may be there under a misspelt name. */
static drape_status read_object(reader *r, const drape_scene_object *object, json_t *value, char *def)
{
    drape_status status = read_others(r, object, value, def);
    if (!status)
        status = check_one_of(r, object, value);
    if (!status)
        status = read_members(r, object, value, def);
    return status;
}

static drape_status read_child(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    return json_is_object(value) ? read_object(r, key->child, value, def + key->offset)
                                 : refuse(r, key, value);
}

static drape_status read_element(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    if (key->child->init)
        key->child->init(def);
    if (key->kind == DRAPE_SCENE_ROWS && is_word(value))
        return read_value(r, &key->child->keys[0], value, def); /* its "type" */
    if (!json_is_object(value))
        return refuse_as(r, value, "an element",
                         key->kind == DRAPE_SCENE_ROWS ? "a name, or an object with a \"type\""
                                                       : "an object");
    return read_object(r, key->child, value, def);
}

static drape_status read_children(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    char *children = NULL;
    drape_status status = take_array(r, key, value, key->child->def_size, def, &children);
    size_t mark = r->at.length;
    for (size_t i = 0; !status && i < json_array_size(value); i++) {
        drape_pointer_push_index(&r->at, i);
        status = read_element(r, key, json_array_get(value, i), children + i * key->child->def_size);
        if (!status)
            drape_pointer_cut(&r->at, mark);
    }
    return status;
}

static drape_status read_value(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    static read_function *const readers[] = {
        [DRAPE_SCENE_VERSION] = read_version,   [DRAPE_SCENE_TEXT] = read_text,
        [DRAPE_SCENE_WORD] = read_word,         [DRAPE_SCENE_WORDS] = read_words,
        [DRAPE_SCENE_NUMBER] = read_number,     [DRAPE_SCENE_INTEGER] = read_integer,
        [DRAPE_SCENE_INTEGERS] = read_integers, [DRAPE_SCENE_VECTOR] = read_vector,
        [DRAPE_SCENE_SCALE] = read_scale,       [DRAPE_SCENE_ROTATION] = read_rotation,
        [DRAPE_SCENE_BOX] = read_box,           [DRAPE_SCENE_TRACK] = read_track,
        [DRAPE_SCENE_OBJECT] = read_child,      [DRAPE_SCENE_OBJECTS] = read_children,
        [DRAPE_SCENE_ROWS] = read_children,     [DRAPE_SCENE_BOOLEAN] = read_boolean,
    };
    return readers[key->kind](r, key, value, def);
}

/* ---- The scene ---- */

/* The version before all else: in another version other keys would be right. */
static drape_status check_version(reader *r, json_t *root)
{
    const drape_scene_key *key = &drape_scene_form.keys[0];
    json_t *version = json_object_get(root, key->name);
    if (!version)
        return missing(r, key);
    drape_pointer_push(&r->at, key->name);
    drape_status status = read_value(r, key, version, NULL);
    if (!status)
        drape_pointer_cut(&r->at, 0);
    return status;
}

/* Names of cloths are their own, those that the library gives to nameless ones included. */
static drape_status check_names(reader *r, const drape_scene_def *def)
{
    json_t *names = json_object(); /* used as a set */
    drape_status status = names ? DRAPE_OK : drape_fail_memory(r->ctx, 1);
    for (size_t i = 0; !status && i < def->cloth_count; i++) {
        char own[40];
        snprintf(own, sizeof own, "cloth%zu", i);
        const char *name = def->cloths[i].name ? def->cloths[i].name : own;
        if (json_object_get(names, name)) {
            char given[80];
            quote(name, given, sizeof given);
            drape_pointer_push(&r->at, "cloth");
            drape_pointer_push_index(&r->at, i);
            drape_pointer_push(&r->at, "name");
            status =
                drape_fail_at(r->ctx, DRAPE_E_ARGUMENT, r->at.text, "%s is the name of another cloth", given);
        } else if (json_object_set_new(names, name, json_true())) {
            status = drape_fail_memory(r->ctx, strlen(name));
        }
    }
    json_decref(names);
    return status;
}

drape_status drape_scene_read(drape_context *ctx, drape_arena *arena, json_t *root, drape_scene_def *def)
{
    reader r = {.ctx = ctx, .arena = arena};
    static const char *const default_formats[] = {"npy"};
    drape_scene_def_init(def, sizeof *def);
    def->formats = default_formats;
    def->format_count = 1;
    drape_status status = check_version(&r, root);
    if (!status)
        status = read_object(&r, &drape_scene_form, root, (char *)def);
    if (!status)
        status = check_names(&r, def);
    return status;
}
