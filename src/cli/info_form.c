/* info_form.c: what `drape info` says of the pins, masses and start of a cloth, from the form of a scene, so
 * that a new key of theirs is in it. */
#include "cli/info.h"
#include "io/json.h"

#include <math.h>
#include <string.h>

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
static json_t *array_json(const char *def, const drape_scene_key *key)
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
        array = drape_json_append(array, key->child ? cli_form_json(key->child, element)
                                         : track    ? track_element(element)
                                         : texts    ? text_element(element)
                                         : numbers  ? number_element(element)
                                                    : integer_element(element));
    }
    return array;
}

static json_t *json_of(const drape_scene_key *key, const char *def)
{
    switch (key->shape) {
    case DRAPE_SCENE_VALUE:
        return cli_key_json(key, def);
    case DRAPE_SCENE_LIST:
    case DRAPE_SCENE_TRACK:
    case DRAPE_SCENE_OBJECTS:
    case DRAPE_SCENE_ENTRIES:
        return array_json(def, key);
    case DRAPE_SCENE_BOX:
        return box_json(def, key);
    case DRAPE_SCENE_QUATERNION:
        return quaternion_json(def, key);
    case DRAPE_SCENE_OBJECT:
        return cli_form_json(key->child, def + key->offset);
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

json_t *cli_form_json(const drape_scene_object *form, const void *def)
{
    json_t *object = json_object();
    for (size_t i = 0; i < form->key_count; i++) {
        const drape_scene_key *key = &form->keys[i];
        json_t *value = is_turned_otherwise(form, key, def) ? NULL : json_of(key, def);
        if (value)
            object = drape_json_with(object, key->param.name, value);
    }
    return object;
}

/* ---- Of a cloth ---- */

/* The nodes that the pin selects are in place of how it selects them. */
static json_t *selected(json_t *object, const drape_model *model, const drape_pin *pin)
{
    json_t *nodes = json_array();
    for (int i = 0; object && drape_form_pin.one_of[i]; i++)
        json_object_del(object, drape_form_pin.one_of[i]);
    for (int32_t i = 0; i < pin->node_count; i++)
        nodes = drape_json_append(nodes, json_integer(pin->node[i] - model->cloths[pin->cloth].first_node));
    return drape_json_with(object, "nodes", nodes);
}

/* The triangles that carry its nodes, in their order. */
static json_t *carried(json_t *object, const drape_model *model, const drape_pin *pin)
{
    json_t *triangles = json_array();
    for (int32_t i = 0; i < pin->node_count; i++)
        triangles = drape_json_append(triangles, json_integer(model->ride[pin->node[i]].triangle));
    json_object_del(object, "triangle");
    return drape_json_with(object, "triangles", triangles);
}

static json_t *pin_json(const drape_model *model, const drape_pin *pin, const drape_pin_def *def)
{
    const int32_t first = pin->node_count > 0 ? pin->node[0] : -1;
    json_t *object = selected(cli_form_json(&drape_form_pin, def), model, pin);
    object = drape_json_with(object, "name", drape_json_text(pin->name));
    if (def->attach && first >= 0 && model->ride[first].triangle >= 0)
        object = carried(object, model, pin);
    for (int32_t i = 0; def->turn_count > 0 && i < model->moved_count; i++)
        if (model->moved_node[i] == first && model->moved_track[i] >= 0)
            object = drape_json_with(object, "pivot",
                                     drape_json_numbers(model->tracks[model->moved_track[i]].pivot, 3));
    return object;
}

json_t *cli_pins_json(const cli_info *info, int32_t c)
{
    const drape_cloth_def *def = &info->def.cloths[c];
    const drape_pin *pin = info->model->pins;
    json_t *pins = json_array();
    for (int32_t i = 0; i < c; i++)
        pin += info->def.cloths[i].pin_count;
    for (size_t i = 0; i < def->pin_count; i++)
        pins = drape_json_append(pins, pin_json(info->model, &pin[i], &def->pins[i]));
    return pins;
}

json_t *cli_masses_json(const cli_info *info, int32_t c)
{
    const drape_cloth_def *def = &info->def.cloths[c];
    json_t *masses = json_array();
    for (size_t i = 0; i < def->mass_count; i++)
        masses = drape_json_append(masses, cli_form_json(&drape_form_mass, &def->masses[i]));
    return masses;
}

json_t *cli_periodic_json(const cli_info *info, int32_t c)
{
    const drape_cloth_def *def = &info->def.cloths[c];
    json_t *periodic = json_array();
    for (size_t i = 0; i < def->periodic_count; i++)
        periodic = drape_json_append(periodic, cli_form_json(&drape_form_periodic, &def->periodic[i]));
    return periodic;
}

json_t *cli_histories_json(const cli_info *info)
{
    json_t *histories = json_array();
    for (size_t i = 0; i < info->def.history_count; i++)
        histories = drape_json_append(histories, cli_form_json(&drape_form_history, &info->def.histories[i]));
    return histories;
}

json_t *cli_start_json(const cli_info *info, int32_t c)
{
    const drape_scene_object *form = drape_scene_key_of(&drape_form_cloth, "start")->child;
    drape_start_def defaults = {.file = NULL};
    drape_scene_set_defaults(form, &defaults);
    json_t *object = cli_form_json(form, &info->def.cloths[c].start), *rest = cli_form_json(form, &defaults);
    if (json_equal(object, rest)) {
        json_decref(object);
        object = NULL;
    }
    json_decref(rest);
    return object;
}
