/* scene_json.c: walks the tree of a scene along the tables of scene_keys.c, with one reader per shape of
 * key. */
#include "model/scene_json.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model/scene.h"

#define MAX_KEYS 24 /* of one object, for the lists in messages */

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
static const char *quote(const char *string, char text[DRAPE_POINTER_SIZE])
{
    char some[61];
    snprintf(some, sizeof some, "%s", string);
    drape_text_mend_end(some);
    return drape_format(text, "\"%s%s\"", some, strlen(some) < strlen(string) ? "..." : "");
}
#define QUOTED(string) quote(string, (char[DRAPE_POINTER_SIZE]){0})

const char *drape_json_describe(json_t *value, char text[DRAPE_POINTER_SIZE])
{
    if (json_is_string(value))
        return quote(json_string_value(value), text);
    if (json_is_number(value))
        return drape_number_text(json_number_value(value), text);
    if (json_array_size(value) > 0)
        return drape_format(text, "an array of %zu", json_array_size(value));
    return json_is_object(value)  ? "an object"
           : json_is_array(value) ? "an empty array"
           : json_is_true(value)  ? "true"
           : json_is_false(value) ? "false"
                                  : "null";
}

/* ---- Faults ---- */

drape_status drape_json_refuse(drape_context *ctx, const drape_pointer *at, json_t *value, const char *what,
                               const char *expected)
{
    return drape_refuse(ctx, at->text, "%s is not allowed; %s is %s", DRAPE_JSON_DESCRIBE(value), what,
                        expected);
}

static drape_status refuse(reader *r, const drape_scene_key *key, json_t *value)
{
    return drape_json_refuse(r->ctx, &r->at, value, key->param.name, DRAPE_KEY_TAKES(key));
}

static drape_status missing(reader *r, const drape_scene_key *key)
{
    drape_pointer_push(&r->at, key->param.name);
    return drape_refuse(r->ctx, r->at.text, "\"%s\" is missing: %s; %s", key->param.name, key->param.help,
                        DRAPE_KEY_TAKES(key));
}

static drape_status unknown_key(reader *r, const drape_scene_object *object, const char *name)
{
    const char *known[MAX_KEYS];
    size_t count = 0;
    const char *given = QUOTED(name);
    char list[300] = "";
    for (; count < object->key_count && count < MAX_KEYS; count++) {
        known[count] = object->keys[count].param.name;
        drape_list_add(list, sizeof list, known[count]);
    }
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
    return drape_fail_at(r->ctx, DRAPE_E_VERSION, r->at.text,
                         "a scene of version %s; this library reads version %d",
                         DRAPE_NUMBER_TEXT(json_number_value(value)), DRAPE_SCENE_FORM);
}

static drape_status read_remark(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    (void)def;
    return json_is_string(value) ? DRAPE_OK : refuse(r, key, value);
}

/* Reads the elements of an array, each as if it were the value of a key, to places `size` bytes apart. */
static drape_status read_each(reader *r, read_function *read, const drape_scene_key *key, json_t *array,
                              void *out, size_t size)
{
    const size_t mark = r->at.length;
    for (size_t i = 0; i < json_array_size(array); i++) {
        drape_pointer_push_index(&r->at, i);
        DRAPE_TRY(read(r, key, json_array_get(array, i), (char *)out + i * size));
        drape_pointer_cut(&r->at, mark);
    }
    return DRAPE_OK;
}

static drape_status read_number(reader *r, const drape_scene_key *key, json_t *value, char *out)
{
    (void)key;
    if (!json_is_number(value))
        return drape_json_refuse(r->ctx, &r->at, value, "an element", "a number");
    const double number = json_number_value(value);
    memcpy(out, &number, sizeof number);
    return DRAPE_OK;
}

static drape_status read_numbers(reader *r, json_t *array, double *out)
{
    return read_each(r, read_number, NULL, array, out, sizeof *out);
}

static drape_status read_pair(reader *r, const drape_scene_key *key, json_t *value, char *out)
{
    (void)key;
    return json_array_size(value) == 2
               ? read_each(r, read_number, NULL, value, out, sizeof(double))
               : drape_json_refuse(r->ctx, &r->at, value, "an element", "an array of two numbers");
}

/* Reads three numbers inside another array, which messages call by the name of the key. */
static drape_status read_three(reader *r, const drape_scene_key *key, json_t *value, char *out)
{
    return json_array_size(value) == 3
               ? read_each(r, read_number, NULL, value, out, sizeof(double))
               : drape_json_refuse(r->ctx, &r->at, value, key->param.name, "three numbers, [x, y, z]");
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
    return pairs ? read_each(r, read_pair, NULL, value, numbers, 2 * sizeof *numbers)
                 : read_numbers(r, value, numbers);
}

static drape_status read_param(reader *r, const drape_param *param, json_t *value, drape_setting *setting,
                               double *values)
{
    /* drape_param_value checks the rest */
    const bool writable = json_is_array(value)
                              ? drape_param_width(param) > 1 || param->kind == DRAPE_PARAM_POINTS
                          : json_is_boolean(value) ? param->kind == DRAPE_PARAM_BOOLEAN
                          : json_is_string(value)  ? param->kind != DRAPE_PARAM_BOOLEAN
                                                   : json_is_number(value);
    if (!writable)
        return drape_param_refuse(r->ctx, r->at.text, param, DRAPE_JSON_DESCRIBE(value));
    DRAPE_TRY(read_setting(r, param->name, value, setting));
    return drape_param_value(r->ctx, r->at.text, param, setting, values);
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
    double values[DRAPE_PARAM_WIDEST] = {0};
    if (key->or_number && json_is_number(value)) {
        char text[32];
        snprintf(text, sizeof text, "%.17g", json_number_value(value));
        setting = (drape_setting){.name = key->param.name, .text = drape_arena_text(r->arena, text)};
        if (!setting.text)
            return DRAPE_E_MEMORY;
    } else
        DRAPE_TRY(read_param(r, &key->param, value, &setting, values));
    drape_scene_store(key, &setting, values, def);
    return DRAPE_OK;
}

static drape_status read_box(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    const bool given = true;
    const drape_scene_key corner = {.param = {.name = "a corner"}};
    double low_high[6];
    if (json_array_size(value) != 2)
        return refuse(r, key, value);
    DRAPE_TRY(read_each(r, read_three, &corner, value, low_high, sizeof low_high / 2));
    memcpy(def + key->offset, low_high, sizeof low_high);
    memcpy(def + key->count_offset, &given, sizeof given);
    return DRAPE_OK;
}

static drape_status read_quaternion(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    double q[4];
    if (json_array_size(value) != 4)
        return refuse(r, key, value);
    DRAPE_TRY(read_numbers(r, value, q));
    if (q[0] == 0 && q[1] == 0 && q[2] == 0 && q[3] == 0)
        return drape_json_refuse(r->ctx, &r->at, value, key->param.name,
                                 "four numbers, [w, x, y, z], not all of them 0");
    memcpy(def + key->offset, q, sizeof q);
    return DRAPE_OK;
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
    drape_scene_key element = {.param = key->param};
    element.param.name = "an element";
    void *elements = NULL;
    DRAPE_TRY(take_array(r, key, value, size, def, &elements));
    return read_each(r, read_one, &element, value, elements, size);
}

static drape_status read_track_key(reader *r, json_t *value, const drape_track_key *before,
                                   drape_track_key *out)
{
    if (json_array_size(value) != 2)
        return drape_json_refuse(r->ctx, &r->at, value, "a key of a track", "[time, [x, y, z]]");
    const drape_scene_key displacement = {.param = {.name = "a displacement"}};
    json_t *time = json_array_get(value, 0);
    out->time = json_number_value(time);
    const char *expected =
        !json_is_number(time) ? "a number"
        : before && !(out->time > before->time)
            ? DRAPE_FORMAT("greater than that of the key before, %s", DRAPE_NUMBER_TEXT(before->time))
            : NULL;
    drape_pointer_push_index(&r->at, expected ? 0 : 1);
    return expected ? drape_json_refuse(r->ctx, &r->at, time, "the time of a key", expected)
                    : read_three(r, &displacement, json_array_get(value, 1), (char *)out->displacement);
}

static drape_status read_track(reader *r, const drape_scene_key *key, json_t *value, char *def)
{
    drape_track_key *keys = NULL;
    DRAPE_TRY(take_array(r, key, value, sizeof *keys, def, &keys));
    const size_t mark = r->at.length;
    for (size_t i = 0; i < json_array_size(value); i++) {
        drape_pointer_push_index(&r->at, i);
        DRAPE_TRY(read_track_key(r, json_array_get(value, i), i ? &keys[i - 1] : NULL, &keys[i]));
        drape_pointer_cut(&r->at, mark);
    }
    return DRAPE_OK;
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
        DRAPE_TRY(read_setting(r, name, member, &settings[count++]));
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
    size_t count = 0, given_count = 0;
    char wanted[200], given[200] = "";
    for (; object->one_of && object->one_of[count]; count++)
        if (json_object_get(value, object->one_of[count])) {
            drape_list_add(given, sizeof given, object->one_of[count]);
            given_count++;
        }
    if (count == 0 || given_count == 1)
        return DRAPE_OK;
    return drape_refuse(r->ctx, r->at.text, "%s is needed; given: %s",
                        drape_scene_one_of_text(object, wanted, sizeof wanted), *given ? given : "none");
}

/* Unknown keys are reported first: a missing key may be there under a misspelled name. */
static drape_status read_object(reader *r, const drape_scene_object *object, json_t *value, char *def)
{
    DRAPE_TRY(read_others(r, object, value, def));
    DRAPE_TRY(check_one_of(r, object, value));
    const size_t mark = r->at.length;
    for (size_t i = 0; i < object->key_count; i++) {
        const drape_scene_key *key = &object->keys[i];
        json_t *member = json_object_get(value, key->param.name);
        if (!member && drape_param_is_required(&key->param))
            return missing(r, key);
        if (!member)
            continue;
        drape_pointer_push(&r->at, key->param.name);
        DRAPE_TRY(read_value(r, key, member, def));
        drape_pointer_cut(&r->at, mark);
    }
    return DRAPE_OK;
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
    void *children = NULL;
    DRAPE_TRY(take_array(r, key, value, key->child->def_size, def, &children));
    return read_each(r, read_element, key, value, children, key->child->def_size);
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
            drape_pointer_push(&r->at, "cloth");
            drape_pointer_push_index(&r->at, i);
            drape_pointer_push(&r->at, "name");
            status = drape_refuse(r->ctx, r->at.text, "%s is the name of another cloth", QUOTED(name));
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
    DRAPE_TRY(read_value(&r, key, version, NULL));
    drape_pointer_cut(&r.at, 0);
    DRAPE_TRY(read_object(&r, &drape_form_scene, root, (char *)def));
    return check_names(&r, def);
}
