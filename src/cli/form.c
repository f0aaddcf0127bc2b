/* form.c: see form.h. */
#include "cli/form.h"
#include "io/json.h"

#include <assert.h>
#include <math.h>
#include <string.h>

json_t *cli_described(json_t *value, const char *unit)
{
    return json_pack("{s:o, s:s, s:b}", "value", value, "unit", unit, "plain", true);
}

bool cli_is_described(const json_t *value)
{
    return json_is_string(json_object_get(value, "unit"));
}

void cli_make_plain(json_t *value)
{
    json_t *part;
    size_t k;
    for (void *i = json_object_iter(value); i; i = json_object_iter_next(value, i)) {
        part = json_object_iter_value(i);
        if (json_object_get(part, "plain"))
            json_object_iter_set(value, i, json_object_get(part, "value"));
        else
            cli_make_plain(part);
    }
    json_array_foreach(value, k, part) cli_make_plain(part);
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

json_t *cli_value_json(const drape_param *param, const double *value, const char *text)
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
        return drape_json_text(text ? text : "");
    case DRAPE_PARAM_INTEGER:
    case DRAPE_PARAM_POINTS: /* their number */
        return json_integer((json_int_t)*value);
    case DRAPE_PARAM_NUMBER:
        break;
    }
    return drape_json_number(*value);
}

json_t *cli_params_json(const drape_param *params, int param_count, const double *values,
                        const drape_choice *choice)
{
    json_t *object = json_object();
    for (int p = 0; p < param_count; p++) {
        const double *value = values + drape_param_place(params, p);
        const drape_setting *setting = given(choice, params[p].name);
        bool usual = !setting;
        for (int k = 0; !choice && k < drape_param_width(&params[p]); k++)
            usual = usual && (value[k] == params[p].default_value ||
                              (isnan(value[k]) && isnan(params[p].default_value)));
        json_t *one = json_pack("{s:o, s:s, s:b}", "value",
                                cli_value_json(&params[p], value, setting ? setting->text : NULL), "unit",
                                params[p].unit, "default", usual);
        object = drape_json_with(object, params[p].name, one);
    }
    return object;
}

json_t *cli_values_json(const drape_entry *entry, const double *values, bool derived)
{
    json_t *object = cli_params_json(entry->params, entry->param_count, values, NULL);
    for (int p = 0; p < entry->param_count; p++) {
        const char *name = entry->params[p].name;
        if (derived || !isnan(values[drape_param_place(entry->params, p)]))
            json_object_set_new(json_object_get(object, name), "plain", json_true());
        else
            json_object_del(object, name);
    }
    return object;
}

/* ---- Keys ---- */

/* An element of the array of a key. */
static json_t *element_json(const drape_scene_key *key, const void *element)
{
    const drape_track_key *track = element;
    if (key->child)
        return cli_form_json(key->child, element);
    if (key->shape == DRAPE_SCENE_TRACK)
        return json_pack("[o, o]", drape_json_number(track->time),
                         drape_json_numbers(track->displacement, 3));
    if (key->param.kind == DRAPE_PARAM_TEXT)
        return drape_json_text(*(const char *const *)element);
    return key->param.kind == DRAPE_PARAM_NUMBER ? drape_json_number(*(const double *)element)
                                                 : json_integer(*(const int32_t *)element);
}

static json_t *array_json(const drape_scene_key *key, const char *def)
{
    const size_t size = key->child                               ? key->child->def_size
                        : key->shape == DRAPE_SCENE_TRACK        ? sizeof(drape_track_key)
                        : key->param.kind == DRAPE_PARAM_INTEGER ? sizeof(int32_t)
                                                                 : sizeof(double);
    const char *elements;
    size_t count;
    memcpy(&elements, def + key->offset, sizeof elements);
    memcpy(&count, def + key->count_offset, sizeof count);
    json_t *array = json_array();
    for (size_t i = 0; i < count; i++)
        array = drape_json_append(array, element_json(key, elements + i * size));
    return array;
}

/* NULL: none is given. */
static json_t *key_json(const drape_scene_key *key, const char *def)
{
    const double *numbers = (const double *)(const void *)(def + key->offset);
    drape_setting value;
    switch (key->shape) {
    case DRAPE_SCENE_VALUE:
        if (!drape_scene_value(key, def, &value))
            return NULL;
        if (value.vector)
            return drape_json_numbers(value.vector, value.vector_count);
        return value.text ? drape_json_text(value.text) : cli_value_json(&key->param, &value.number, NULL);
    case DRAPE_SCENE_LIST:
    case DRAPE_SCENE_TRACK:
    case DRAPE_SCENE_OBJECTS:
    case DRAPE_SCENE_ENTRIES:
        return array_json(key, def);
    case DRAPE_SCENE_BOX:
        return *(const bool *)(def + key->count_offset)
                   ? json_pack("[o, o]", drape_json_numbers(numbers, 3), drape_json_numbers(numbers + 3, 3))
                   : NULL;
    case DRAPE_SCENE_QUATERNION:
        return numbers[0] != 0 || numbers[1] != 0 || numbers[2] != 0 || numbers[3] != 0
                   ? drape_json_numbers(numbers, 4)
                   : NULL;
    case DRAPE_SCENE_OBJECT:
        return cli_form_json(key->child, def + key->offset);
    case DRAPE_SCENE_VERSION:
    case DRAPE_SCENE_REMARK:
        break;
    }
    return NULL;
}

json_t *cli_with_keys(json_t *object, const drape_scene_object *form, const void *def)
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
        json_t *usual = key_json(key, (const char *)&defaults);
        json_t *same = json_boolean(json_equal(value, usual));
        json_decref(usual);
        value = drape_json_with(cli_described(value, key->param.unit), "default", same);
        object = drape_json_with(object, key->param.name, value);
    }
    return object;
}

/* ---- Objects of a form ---- */

json_t *cli_form_json(const drape_scene_object *form, const void *def)
{
    json_t *object = json_object();
    const char *turn = NULL;
    for (size_t i = 0; i < form->key_count; i++) {
        const drape_scene_key *key = &form->keys[i];
        json_t *value = key_json(key, def);
        if (!value || (json_is_array(value) && json_array_size(value) == 0)) {
            json_decref(value);
            continue;
        }
        if (key->shape == DRAPE_SCENE_VALUE && key->param.kind != DRAPE_PARAM_TEXT)
            value = cli_described(value, key->param.unit);
        object = drape_json_with(object, key->param.name, value);
        turn = key->param.kind == DRAPE_PARAM_TURN ? key->param.name : turn;
        if (turn && key->shape == DRAPE_SCENE_QUATERNION) /* it is in place of the axis and angle beside it */
            json_object_del(object, turn);
    }
    return object;
}

json_t *cli_forms_json(const drape_scene_object *form, const void *defs, size_t count)
{
    json_t *array = json_array();
    for (size_t i = 0; i < count; i++)
        array = drape_json_append(array, cli_form_json(form, (const char *)defs + i * form->def_size));
    return array;
}
