/* info_form.c: parameters and objects of a scene as JSON, from their tables, so that `drape info` shows every
 * new key. */
#include "cli/info.h"
#include "io/json.h"

#include <assert.h>
#include <math.h>
#include <string.h>

json_t *cli_described(const cli_info *info, json_t *value, const char *unit)
{
    return info->described
               ? drape_json_with(drape_json_with(json_object(), "value", value), "unit", json_string(unit))
               : value;
}

/* ---- Parameters ---- */

/* The setting that the scene gave; NULL: none. */
static const drape_setting *given(const drape_choice *choice, const char *name)
{
    for (size_t i = 0; choice && i < choice->setting_count; i++)
        if (strcmp(choice->settings[i].name, name) == 0)
            return &choice->settings[i];
    return NULL;
}

static json_t *value_of(const drape_param *param, const double *value, const drape_setting *setting)
{
    if (isnan(*value) && param->derived)
        return json_string(param->derived);
    switch (param->kind) {
    case DRAPE_PARAM_BOOLEAN:
        return json_boolean(*value != 0);
    case DRAPE_PARAM_CHOICE:
        return json_string(param->choices[(int)*value]);
    case DRAPE_PARAM_VECTOR:
    case DRAPE_PARAM_TURN:
        return drape_json_numbers(value, 3);
    case DRAPE_PARAM_TEXT:
        return drape_json_text(setting && setting->text ? setting->text : "");
    case DRAPE_PARAM_INTEGER:
    case DRAPE_PARAM_POINTS: /* their number */
        return json_integer((json_int_t)*value);
    case DRAPE_PARAM_NUMBER:
        break;
    }
    return drape_json_number(*value);
}

static bool is_default(const drape_param *param, const double *value)
{
    bool same = true;
    for (int k = 0; k < drape_param_width(param); k++)
        same = same && (value[k] == param->default_value || (isnan(value[k]) && isnan(param->default_value)));
    return same;
}

json_t *cli_params_json(const drape_param *params, int param_count, const double *values,
                        const drape_choice *choice)
{
    json_t *object = json_object();
    for (int p = 0; p < param_count; p++) {
        const double *value = values + drape_param_place(params, p);
        const drape_setting *setting = given(choice, params[p].name);
        const bool usual = choice ? !setting : is_default(&params[p], value);
        json_t *one = drape_json_with(json_object(), "value", value_of(&params[p], value, setting));
        one = drape_json_with(one, "unit", json_string(params[p].unit));
        object =
            drape_json_with(object, params[p].name, drape_json_with(one, "default", json_boolean(usual)));
    }
    return object;
}

json_t *cli_values_json(const cli_info *info, const drape_param *params, int param_count,
                        const double *values)
{
    json_t *object = info->described ? cli_params_json(params, param_count, values, NULL) : json_object();
    for (int p = 0; p < param_count && !info->described; p++) {
        const double *value = values + drape_param_place(params, p);
        if (!isnan(*value))
            object = drape_json_with(object, params[p].name, value_of(&params[p], value, NULL));
    }
    return object;
}

/* ---- Keys ---- */

/* NULL: none is given. */
static json_t *key_json(const drape_scene_key *key, const void *def)
{
    const char *const *texts;
    drape_setting value;
    if (key->shape == DRAPE_SCENE_LIST) {
        json_t *array = json_array();
        for (size_t i = 0, count = drape_scene_texts(key, def, &texts); i < count; i++)
            array = drape_json_append(array, drape_json_text(texts[i]));
        return array;
    }
    if (!drape_scene_value(key, def, &value))
        return NULL;
    if (value.vector)
        return drape_json_numbers(value.vector, value.vector_count);
    return value.text ? drape_json_text(value.text) : value_of(&key->param, &value.number, NULL);
}

json_t *cli_with_keys(const cli_info *info, json_t *object, const drape_scene_object *form, const void *def)
{
    union {
        drape_scene_def scene;
        drape_cloth_def cloth;
        drape_collider_def collider;
        drape_event_def event;
    } defaults = {.scene = {.struct_size = 0}};
    assert(form->def_size <= sizeof defaults);
    drape_scene_set_defaults(form, &defaults);
    for (size_t i = 0; i < form->key_count; i++) {
        const drape_scene_key *key = &form->keys[i];
        const bool named = key->param.kind == DRAPE_PARAM_TEXT && key->shape == DRAPE_SCENE_VALUE;
        json_t *value = key->shape <= DRAPE_SCENE_LIST && !named ? key_json(key, def) : NULL;
        if (!value)
            continue;
        json_t *usual = key_json(key, &defaults);
        const bool same = json_equal(value, usual);
        json_decref(usual);
        value = cli_described(info, value, key->param.unit);
        if (info->described)
            value = drape_json_with(value, "default", json_boolean(same));
        object = drape_json_with(object, key->param.name, value);
    }
    return object;
}

/* ---- Objects of a form ---- */

static json_t *box_json(const char *def, const drape_scene_key *key)
{
    bool given;
    memcpy(&given, def + key->count_offset, sizeof given);
    const double *corners = (const double *)(const void *)(def + key->offset);
    return given ? drape_json_append(drape_json_append(json_array(), drape_json_numbers(corners, 3)),
                                     drape_json_numbers(corners + 3, 3))
                 : NULL;
}

static json_t *quaternion_json(const char *def, const drape_scene_key *key)
{
    const double *q = (const double *)(const void *)(def + key->offset);
    return q[0] != 0 || q[1] != 0 || q[2] != 0 || q[3] != 0 ? drape_json_numbers(q, 4) : NULL;
}

static json_t *track_element(const void *element)
{
    const drape_track_key *key = element;
    return drape_json_append(drape_json_append(json_array(), drape_json_number(key->time)),
                             drape_json_numbers(key->displacement, 3));
}

static json_t *integer_element(const void *element)
{
    int32_t number;
    memcpy(&number, element, sizeof number);
    return json_integer(number);
}

static json_t *text_element(const void *element)
{
    const char *text;
    memcpy(&text, element, sizeof text);
    return drape_json_text(text);
}

static json_t *number_element(const void *element)
{
    double number;
    memcpy(&number, element, sizeof number);
    return drape_json_number(number);
}

/* NULL: it has no elements. */
static json_t *array_json(const cli_info *info, const char *def, const drape_scene_key *key)
{
    const bool texts = key->param.kind == DRAPE_PARAM_TEXT, track = key->shape == DRAPE_SCENE_TRACK,
               numbers = key->param.kind == DRAPE_PARAM_NUMBER;
    const size_t size = key->child ? key->child->def_size
                        : track    ? sizeof(drape_track_key)
                        : texts    ? sizeof(const char *)
                        : numbers  ? sizeof(double)
                                   : sizeof(int32_t);
    const char *elements;
    size_t count;
    memcpy(&elements, def + key->offset, sizeof elements);
    memcpy(&count, def + key->count_offset, sizeof count);
    json_t *array = count > 0 ? json_array() : NULL;
    for (size_t i = 0; i < count; i++) {
        const char *element = elements + i * size;
        array = drape_json_append(array, key->child ? cli_form_json(info, key->child, element)
                                         : track    ? track_element(element)
                                         : texts    ? text_element(element)
                                         : numbers  ? number_element(element)
                                                    : integer_element(element));
    }
    return array;
}

static json_t *json_of(const cli_info *info, const drape_scene_key *key, const char *def)
{
    json_t *value;
    switch (key->shape) {
    case DRAPE_SCENE_VALUE:
        value = key_json(key, def);
        return value && key->param.kind != DRAPE_PARAM_TEXT ? cli_described(info, value, key->param.unit)
                                                            : value;
    case DRAPE_SCENE_LIST:
    case DRAPE_SCENE_TRACK:
    case DRAPE_SCENE_OBJECTS:
    case DRAPE_SCENE_ENTRIES:
        return array_json(info, def, key);
    case DRAPE_SCENE_BOX:
        return box_json(def, key);
    case DRAPE_SCENE_QUATERNION:
        return quaternion_json(def, key);
    case DRAPE_SCENE_OBJECT:
        return cli_form_json(info, key->child, def + key->offset);
    case DRAPE_SCENE_VERSION:
    case DRAPE_SCENE_REMARK:
        break;
    }
    return NULL;
}

/* A quaternion is in place of the axis and angle beside it. */
static bool is_turned_otherwise(const drape_scene_object *form, const drape_scene_key *key, const char *def)
{
    bool otherwise = false;
    for (size_t i = 0; i < form->key_count && key->param.kind == DRAPE_PARAM_TURN; i++)
        if (form->keys[i].shape == DRAPE_SCENE_QUATERNION) {
            json_t *q = quaternion_json(def, &form->keys[i]);
            otherwise = q != NULL;
            json_decref(q);
        }
    return otherwise;
}

json_t *cli_form_json(const cli_info *info, const drape_scene_object *form, const void *def)
{
    json_t *object = json_object();
    for (size_t i = 0; i < form->key_count; i++) {
        const drape_scene_key *key = &form->keys[i];
        json_t *value = is_turned_otherwise(form, key, def) ? NULL : json_of(info, key, def);
        if (value)
            object = drape_json_with(object, key->param.name, value);
    }
    return object;
}

json_t *cli_forms_json(const cli_info *info, const drape_scene_object *form, const void *defs, size_t count)
{
    json_t *array = json_array();
    for (size_t i = 0; i < count; i++)
        array = drape_json_append(array, cli_form_json(info, form, (const char *)defs + i * form->def_size));
    return array;
}
