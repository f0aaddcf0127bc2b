/* scene_json.c: walks the tree of a scene along the tables of scene_keys.c, with one reader per shape of
 * key. */
#include "model/scene_json.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model/scene.h"

#define MAX_KEYS  24  /* of one object, for the lists in messages */
#define MAX_TAKES 600 /* bytes of the description of what a key accepts */

typedef struct reader {
    drape_context *ctx;
    drape_arena *arena;
    drape_pointer at; /* pointer to the value that is being read */
} reader;

/* Reads the value of a key into def, the def of the object that contains the key. */
typedef drape_status read_function(reader *r, const drape_scene_key *key, json_t *value, char *def);
static read_function read_value;

/* ---- Texts for messages ---- */

/* Quotes a string, shortened if it is long. */
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
        drape_number_text(json_number_value(value), text, size);
        break;
    case JSON_TRUE:
    case JSON_FALSE:
        snprintf(text, size, "%s", json_is_true(value) ? "true" : "false");
        break;
    case JSON_NULL:
        snprintf(text, size, "null");
    }
}

/* ---- Faults ---- */

drape_status drape_json_refuse(drape_context *ctx, const drape_pointer *at, json_t *value, const char *what,
                               const char *expected)
{
    char given[80];
    drape_json_describe(value, given, sizeof given);
    return drape_refuse(ctx, at->text, "%s is not allowed; %s is %s", given, what, expected);
}

static drape_status refuse(reader *r, const drape_scene_key *key, json_t *value)
{
    char expected[MAX_TAKES];
    drape_scene_takes_text(key, expected, sizeof expected);
    return drape_json_refuse(r->ctx, &r->at, value, key->param.name, expected);
}

static drape_status refuse_element(reader *r, size_t index, json_t *value, const char *what,
                                   const char *expected)
{
    drape_pointer_push_index(&r->at, index);
    return drape_json_refuse(r->ctx, &r->at, value, what, expected);
}

static drape_status missing(reader *r, const drape_scene_key *key)
{
    char expected[MAX_TAKES];
    drape_scene_takes_text(key, expected, sizeof expected);
    drape_pointer_push(&r->at, key->param.name);
    return drape_refuse(r->ctx, r->at.text, "\"%s\" is missing: %s; %s", key->param.name, key->param.help,
                        expected);
}

/* "a, b, c" */
static void list_names(const char *const *names, size_t count, char *text, size_t size)
{
    size_t used = 0;
    *text = 0;
    for (size_t i = 0; i < count && used < size; i++)
        used += (size_t)snprintf(text + used, size - used, "%s%s", i ? ", " : "", names[i]);
}

static drape_status unknown_key(reader *r, const drape_scene_object *object, const char *name)
{
    const char *known[MAX_KEYS];
    size_t count = 0;
    for (; count < object->key_count && count < MAX_KEYS; count++)
        known[count] = object->keys[count].param.name;
    char given[80], list[300];
    quote(name, given, sizeof given);
    list_names(known, count, list, sizeof list);
    const char *meant = drape_did_you_mean(name, known, count);
    drape_pointer_push(&r->at, name);
    if (meant)
        return drape_refuse(r->ctx, r->at.text, "unknown key %s; did you mean \"%s\"? Known: %s", given,
                            meant, list);
    if (object->open_with)
        return drape_refuse(r->ctx, r->at.text, "unknown key %s without \"%s\"; known: %s", given,
                            object->open_with, list);
    return drape_refuse(r->ctx, r->at.text, "unknown key %s; known: %s", given, list);
}

/* ---- Values ---- */

static drape_status read_version(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    (void)def;
    if (!json_is_number(value))
        return refuse(r, key, value);
    if (json_number_value(value) == DRAPE_SCENE_FORM)
        return DRAPE_OK;
    char given[40];
    drape_number_text(json_number_value(value), given, sizeof given);
    return drape_fail_at(r->ctx, DRAPE_E_VERSION, r->at.text,
                         "a scene of version %s; this library reads version %d", given, DRAPE_SCENE_FORM);
}

static drape_status read_remark(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    (void)def;
    return json_is_string(value) ? DRAPE_OK : refuse(r, key, value);
}

/* Reads the elements of an array, as many as out has room for. */
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

/* Reads three numbers inside another array; `what` is their name in messages. */
static drape_status read_three(reader *r, json_t *value, const char *what, double *out)
{
    return json_array_size(value) == 3
               ? read_numbers(r, value, out)
               : drape_json_refuse(r->ctx, &r->at, value, what, "three numbers, [x, y, z]");
}

/* Booleans become texts, so that no parameter mistakes them for numbers. */
static drape_status read_setting(reader *r, const char *name, json_t *value, drape_setting *out)
{
    *out = (drape_setting){.name = name};
    if (json_is_boolean(value))
        out->text = json_is_true(value) ? "true" : "false";
    if (json_is_number(value))
        out->number = json_number_value(value);
    if (json_is_string(value))
        out->text = json_string_value(value);
    if (!json_is_array(value))
        return DRAPE_OK;
    const bool pairs = json_is_array(json_array_get(value, 0));
    double *numbers = drape_arena_take(r->arena, (pairs ? 2 : 1) * json_array_size(value), sizeof *numbers);
    out->number = pairs ? 2 : 0;
    out->vector = numbers;
    out->vector_count = (pairs ? 2 : 1) * json_array_size(value);
    if (!numbers)
        return DRAPE_E_MEMORY;
    if (!pairs)
        return read_numbers(r, value, numbers);
    const size_t mark = r->at.length;
    drape_status status = DRAPE_OK;
    for (size_t i = 0; !status && i < json_array_size(value); i++) {
        json_t *one = json_array_get(value, i);
        drape_pointer_push_index(&r->at, i);
        status = json_array_size(one) == 2
                     ? read_numbers(r, one, numbers + 2 * i)
                     : drape_json_refuse(r->ctx, &r->at, one, "an element", "an array of two numbers");
        if (!status)
            drape_pointer_cut(&r->at, mark);
    }
    return status;
}

static drape_status read_param(reader *r, const drape_param *param, json_t *value, drape_setting *setting,
                               double *values)
{
    char given[80];
    /* drape_param_value checks the rest */
    const bool writable = json_is_array(value)
                              ? drape_param_width(param) > 1 || param->kind == DRAPE_PARAM_POINTS
                          : json_is_boolean(value) ? param->kind == DRAPE_PARAM_BOOLEAN
                          : json_is_string(value)  ? param->kind != DRAPE_PARAM_BOOLEAN
                                                   : json_is_number(value);
    if (!writable) {
        drape_json_describe(value, given, sizeof given);
        return drape_param_refuse(r->ctx, r->at.text, param, given);
    }
    drape_status status = read_setting(r, param->name, value, setting);
    return status ? status : drape_param_value(r->ctx, r->at.text, param, setting, values);
}

drape_status drape_json_check(drape_context *ctx, const drape_pointer *at, const drape_param *param,
                              json_t *value)
{
    drape_arena arena = drape_arena_of(ctx);
    reader r = {.ctx = ctx, .arena = &arena, .at = *at};
    drape_setting setting;
    double values[DRAPE_PARAM_WIDEST];
    drape_status status = read_param(&r, param, value, &setting, values);
    drape_arena_free(&arena);
    return status;
}

static drape_status read_one(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    drape_setting setting;
    double values[DRAPE_PARAM_WIDEST];
    drape_status status = read_param(r, &key->param, value, &setting, values);
    if (!status)
        drape_scene_store(key, &setting, values, def);
    return status;
}

static drape_status read_box(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    const bool given = true;
    double low_high[6];
    if (json_array_size(value) != 2)
        return refuse(r, key, value);
    size_t mark = r->at.length;
    for (size_t i = 0; i < 2; i++) {
        drape_pointer_push_index(&r->at, i);
        drape_status status = read_three(r, json_array_get(value, i), "a corner", low_high + 3 * i);
        if (status)
            return status;
        drape_pointer_cut(&r->at, mark);
    }
    memcpy(def + key->offset, low_high, sizeof low_high);
    memcpy(def + key->count_offset, &given, sizeof given);
    return DRAPE_OK;
}

static drape_status read_quaternion(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    double q[4];
    if (json_array_size(value) != 4)
        return refuse(r, key, value);
    const drape_status status = read_numbers(r, value, q);
    if (!status && q[0] == 0 && q[1] == 0 && q[2] == 0 && q[3] == 0)
        return drape_json_refuse(r->ctx, &r->at, value, key->param.name,
                                 "four numbers, [w, x, y, z], not all of them 0");
    memcpy(def + key->offset, q, sizeof q);
    return status;
}

/* ---- Arrays ---- */

/* Allocates an array with as many elements as value and stores it in the def; refuses a value that is not an
 * array, too short or too long. */
static drape_status take_array(reader *r, const drape_scene_key *key, json_t *value, size_t size, char *def,
                               void *array)
{
    size_t count = json_array_size(value);
    if (!json_is_array(value) || count < key->at_least || (key->at_most && count > key->at_most))
        return refuse(r, key, value);
    void *memory = count ? drape_arena_take(r->arena, count, size) : NULL;
    if (count && !memory)
        return DRAPE_E_MEMORY;
    memcpy(def + key->offset, &memory, sizeof memory);
    memcpy(def + key->count_offset, &count, sizeof count);
    memcpy(array, &memory, sizeof memory);
    return DRAPE_OK;
}

/* Each element is stored like a key of its own. */
static drape_status read_list(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    const size_t size = key->param.kind == DRAPE_PARAM_INTEGER  ? sizeof(int32_t)
                        : key->param.kind == DRAPE_PARAM_NUMBER ? sizeof(double)
                                                                : sizeof(const char *);
    const size_t mark = r->at.length;
    drape_scene_key element = {.param = key->param};
    element.param.name = "an element";
    char *elements = NULL;
    drape_status status = take_array(r, key, value, size, def, &elements);
    for (size_t i = 0; !status && i < json_array_size(value); i++) {
        drape_pointer_push_index(&r->at, i);
        status = read_one(r, &element, json_array_get(value, i), elements + i * size);
        if (!status)
            drape_pointer_cut(&r->at, mark);
    }
    return status;
}

static drape_status read_track_key(reader *r, json_t *value, const drape_track_key *before,
                                   drape_track_key *out)
{
    if (json_array_size(value) != 2)
        return drape_json_refuse(r->ctx, &r->at, value, "a key of a track", "[time, [x, y, z]]");
    json_t *time = json_array_get(value, 0);
    if (!json_is_number(time))
        return refuse_element(r, 0, time, "the time of a key", "a number");
    out->time = json_number_value(time);
    if (before && !(out->time > before->time)) {
        char expected[100] = "greater than that of the key before, ";
        drape_number_text(before->time, expected + strlen(expected), 40);
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

/* ---- Objects ---- */

/* Members that are not keys are settings in an open object, and faults in other objects. */
static drape_status read_others(reader *r, const drape_scene_object *object, json_t *value, char *def)
{
    drape_setting *settings = NULL;
    size_t count = 0, mark = r->at.length;
    bool open = object->open && (!object->open_with || json_object_get(value, object->open_with));
    if (open) {
        settings = drape_arena_take(r->arena, json_object_size(value), sizeof *settings);
        if (!settings)
            return DRAPE_E_MEMORY;
    }
    for (void *it = json_object_iter(value); it; it = json_object_iter_next(value, it)) {
        const char *name = json_object_iter_key(it);
        json_t *member = json_object_iter_value(it);
        if (drape_scene_key_of(object, name))
            continue;
        if (!open)
            return unknown_key(r, object, name);
        drape_pointer_push(&r->at, name);
        if (json_is_object(member) || json_is_null(member))
            return drape_json_refuse(r->ctx, &r->at, member, "a setting",
                                     "a number, true, false, a string or an array of numbers or pairs");
        const drape_status status = read_setting(r, name, member, &settings[count++]);
        if (status)
            return status;
        drape_pointer_cut(&r->at, mark);
    }
    if (open) { /* an object without settings differs from a missing object */
        memcpy(def + object->settings_offset, &settings, sizeof settings);
        memcpy(def + object->settings_count_offset, &count, sizeof count);
    }
    return DRAPE_OK;
}

static drape_status check_one_of(reader *r, const drape_scene_object *object, json_t *value)
{
    const char *given[MAX_KEYS];
    size_t count = 0, given_count = 0;
    for (; object->one_of && object->one_of[count]; count++)
        if (json_object_get(value, object->one_of[count]))
            given[given_count++] = object->one_of[count];
    if (count == 0 || given_count == 1)
        return DRAPE_OK;
    char wanted[200], found[200] = "none";
    drape_scene_one_of_text(object, wanted, sizeof wanted);
    if (given_count)
        list_names(given, given_count, found, sizeof found);
    return drape_refuse(r->ctx, r->at.text, "%s is needed; given: %s", wanted, found);
}

/* Unknown keys are reported first: a missing key may be there under a misspelled name. */
static drape_status read_object(reader *r, const drape_scene_object *object, json_t *value, char *def)
{
    drape_status status = read_others(r, object, value, def);
    if (!status)
        status = check_one_of(r, object, value);
    const size_t mark = r->at.length;
    for (size_t i = 0; !status && i < object->key_count; i++) {
        const drape_scene_key *key = &object->keys[i];
        json_t *member = json_object_get(value, key->param.name);
        if (!member && drape_param_is_required(&key->param))
            return missing(r, key);
        if (!member)
            continue;
        drape_pointer_push(&r->at, key->param.name);
        status = read_value(r, key, member, def);
        if (!status)
            drape_pointer_cut(&r->at, mark);
    }
    return status;
}

static drape_status read_child(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    return json_is_object(value) ? read_object(r, key->child, value, def + key->offset)
                                 : refuse(r, key, value);
}

static drape_status read_element(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    drape_scene_set_defaults(key->child, def);
    if (key->shape == DRAPE_SCENE_ENTRIES && json_string_length(value) > 0)
        return read_value(r, &key->child->keys[0], value, def); /* the key "type" */
    if (!json_is_object(value))
        return drape_json_refuse(r->ctx, &r->at, value, "an element",
                                 key->shape == DRAPE_SCENE_ENTRIES ? "a name, or an object with a \"type\""
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
        [DRAPE_SCENE_VALUE] = read_one,        [DRAPE_SCENE_LIST] = read_list,
        [DRAPE_SCENE_VERSION] = read_version,  [DRAPE_SCENE_REMARK] = read_remark,
        [DRAPE_SCENE_BOX] = read_box,          [DRAPE_SCENE_TRACK] = read_track,
        [DRAPE_SCENE_OBJECT] = read_child,     [DRAPE_SCENE_OBJECTS] = read_children,
        [DRAPE_SCENE_ENTRIES] = read_children, [DRAPE_SCENE_QUATERNION] = read_quaternion,
    };
    return readers[key->shape](r, key, value, def);
}

/* ---- The scene ---- */

/* Checks that no two cloths have the same name, including the names that the library assigns. */
static drape_status check_names(reader *r, const drape_scene_def *def)
{
    json_t *names = json_object(); /* used as a set */
    drape_status status = names ? DRAPE_OK : drape_fail_memory(r->ctx, 1);
    for (size_t i = 0; !status && i < def->cloth_count; i++) {
        const char *own = DRAPE_FORMAT("cloth%zu", i);
        const char *name = def->cloths[i].name ? def->cloths[i].name : own;
        if (json_object_get(names, name)) {
            char given[80];
            quote(name, given, sizeof given);
            drape_pointer_push(&r->at, "cloth");
            drape_pointer_push_index(&r->at, i);
            drape_pointer_push(&r->at, "name");
            status = drape_refuse(r->ctx, r->at.text, "%s is the name of another cloth", given);
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
    memset(def, 0, sizeof *def);
    drape_scene_set_defaults(&drape_form_scene, def);
    /* The version is checked first, because other versions have other keys. */
    const drape_scene_key *key = &drape_form_scene.keys[0];
    json_t *version = json_object_get(root, key->param.name);
    if (!version)
        return missing(&r, key);
    drape_pointer_push(&r.at, key->param.name);
    drape_status status = read_value(&r, key, version, NULL);
    if (!status)
        drape_pointer_cut(&r.at, 0);
    if (!status)
        status = read_object(&r, &drape_form_scene, root, (char *)def);
    if (!status)
        status = check_names(&r, def);
    return status;
}
