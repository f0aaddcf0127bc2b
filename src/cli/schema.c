/*
 * schema.c: see schema.h. As strict as the reader, except where a schema cannot express a rule: that times of
 * a track increase, that names of cloths or colliders differ, that a term is named once, how parameters of a
 * collider depend on each other, and all rules that depend on a mesh.
 */
#include "cli/schema.h"

#include "colliders/colliders.h"
#include "compile/compile.h"
#include "control/control.h"
#include "events/events.h"
#include "io/export.h"
#include "io/json.h"
#include "terms/terms.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* ---- Small pieces ---- */

static json_t *typed(const char *type)
{
    return json_pack("{s:s}", "type", type);
}

static json_t *array_of(json_t *items, size_t min, size_t max)
{
    json_t *array = drape_json_with(typed("array"), "items", items);
    if (min)
        array = drape_json_with(array, "minItems", json_integer((json_int_t)min));
    return max ? drape_json_with(array, "maxItems", json_integer((json_int_t)max)) : array;
}

static json_t *numbers(size_t min, size_t max)
{
    return array_of(typed("number"), min, max);
}

static json_t *any_of(json_t *a, json_t *b)
{
    return json_pack("{s:[o, o]}", "anyOf", a, b);
}

static json_t *words(const char *const *names)
{
    json_t *array = json_array();
    for (int i = 0; names[i]; i++)
        array = drape_json_append(array, json_string(names[i]));
    return array;
}

/* { "required": [name] } for each name. */
static json_t *each_required(const char *const *names)
{
    json_t *cases = json_array();
    for (int i = 0; names[i]; i++)
        cases = drape_json_append(cases, json_pack("{s:[s]}", "required", names[i]));
    return cases;
}

/* ---- Parameters and keys ---- */

/* An integer if the value is one: 3 rather than 3.0. */
static json_t *number(double value)
{
    return value == floor(value) && fabs(value) < 1e15 ? json_integer((json_int_t)value) : json_real(value);
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

static json_t *bounded(const char *type, const drape_param *p)
{
    json_t *value = typed(type);
    if (isfinite(p->min))
        value = drape_json_with(value, p->open_min ? "exclusiveMinimum" : "minimum", number(p->min));
    return isfinite(p->max)
               ? drape_json_with(value, p->open_max ? "exclusiveMaximum" : "maximum", number(p->max))
               : value;
}

static json_t *value_of(const drape_param *p)
{
    json_t *three_numbers;
    switch (p->kind) {
    case DRAPE_PARAM_BOOLEAN: /* the reader takes numbers too */
        return json_pack("{s:[b, b, i, i]}", "enum", true, false, 1, 0);
    case DRAPE_PARAM_CHOICE:
        return json_pack("{s:o}", "enum", words(p->choices));
    case DRAPE_PARAM_TEXT:
        return json_pack("{s:s, s:i}", "type", "string", "minLength", 1);
    case DRAPE_PARAM_VECTOR:
        three_numbers = array_of(bounded("number", p), 3, 3);
        return p->uniform ? any_of(bounded("number", p), three_numbers) : three_numbers;
    case DRAPE_PARAM_TURN:
        return numbers(3, 4);
    case DRAPE_PARAM_POINTS:
        return array_of(numbers(2, 2), 1, 0);
    case DRAPE_PARAM_NUMBER:
    case DRAPE_PARAM_INTEGER:
        break;
    }
    return bounded(p->kind == DRAPE_PARAM_INTEGER ? "integer" : "number", p);
}

/* Adds the help of a key to the schema of its value, and the default unless another key may be given in its
 * place. */
static json_t *described(json_t *value, const drape_scene_key *key, bool is_one_of)
{
    char text[512];
    double defaults[DRAPE_PARAM_WIDEST];
    const drape_param *p = &key->param;
    const bool has_unit = strcmp(p->unit, "1") != 0;
    snprintf(text, sizeof text, "%s%s%s%s", p->help, has_unit ? " [" : "", has_unit ? p->unit : "",
             has_unit ? "]" : "");
    value = drape_json_with(value, "description", json_string(text));
    drape_param_default(p, defaults);
    if (is_one_of || (isnan(*defaults) && !key->literal))
        return value;
    const double *values = key->vector ? key->vector : defaults;
    json_t *one = drape_param_width(p) > 1
                      ? json_pack("[o, o, o]", number(values[0]), number(values[1]), number(values[2]))
                  : p->kind == DRAPE_PARAM_NUMBER || p->kind == DRAPE_PARAM_INTEGER
                      ? number(*values)
                      : cli_value_json(p, values, NULL);
    return drape_json_with(value, "default", key->shape == DRAPE_SCENE_LIST ? json_pack("[o]", one) : one);
}

/* Adds the parameters of an entry. A value of a parameter that several entries have with different bounds
 * must be right for each of them, as for the reader. */
static json_t *with_params(json_t *properties, const drape_entry *entry)
{
    for (int i = 0; i < entry->param_count; i++) {
        const drape_param *p = &entry->params[i];
        json_t *schema = described(value_of(p), &(drape_scene_key){.param = *p}, false);
        json_t *before = json_object_get(properties, p->name);
        if (before && json_equal(before, schema)) {
            json_decref(schema);
            continue;
        }
        if (before)
            schema = json_pack("{s:[O, o]}", "allOf", before, schema);
        properties = drape_json_with(properties, p->name, schema);
    }
    return properties;
}

static bool needs_params(const drape_entry *entry)
{
    for (int i = 0; i < entry->param_count; i++)
        if (drape_param_is_required(&entry->params[i]))
            return true;
    return false;
}

static json_t *with_required(json_t *required, const drape_entry *entry)
{
    for (int i = 0; i < entry->param_count; i++)
        if (drape_param_is_required(&entry->params[i]))
            required = drape_json_append(required, json_string(entry->params[i].name));
    return required;
}

/* Whether the scene's gravity adds the entry, a term, so that scenes do not name it. */
static bool is_implied(const drape_registry *table, int index)
{
    return table == &drape_term_registry && drape_terms[index]->from_scene_gravity;
}

/* The entries that a scene may name; `alone`: without parameters beside the name. */
static json_t *entry_names(const drape_registry *table, bool alone)
{
    json_t *names = json_array();
    const drape_entry *entry;
    for (int i = 0; (entry = table->entries[i]) != NULL; i++)
        if (!is_implied(table, i) && !(alone && needs_params(entry)))
            names = drape_json_append(names, json_string(entry->name));
    return json_pack("{s:o}", "enum", names);
}

/* ---- Where a scene names entries of tables ---- */

typedef enum opening_kind {
    ENTRY_PARAMS, /* the parameters of the named entry, and no others */
    TABLE_PARAMS  /* parameters of any entry of the table, whichever is named */
} opening_kind;

/* The open objects of scene_keys.c. */
static const struct opening {
    const char *object, *key; /* the key that names the entry; NULL: the table has only one */
    opening_kind kind;
    const drape_registry *table;
    const char *const *one_of, *const
                                   *all_of; /* where `preset` gives their values: at most one, all or none */
    const char *preset;
} openings[] = {
    {"term", "type", ENTRY_PARAMS, &drape_term_registry, NULL, NULL, NULL},
    {"mesh", "grid", ENTRY_PARAMS, &drape_grid_registry, NULL, NULL, NULL},
    {"render_mesh", "grid", ENTRY_PARAMS, &drape_grid_registry, NULL, NULL, NULL},
    {"collider", "type", ENTRY_PARAMS, &drape_collider_registry, NULL, NULL, NULL},
    {"seam", "type", ENTRY_PARAMS, &drape_seam_registry, NULL, NULL, NULL},
    {"event", "type", ENTRY_PARAMS, &drape_event_registry, NULL, NULL, NULL},
    {"self_contact", NULL, ENTRY_PARAMS, &drape_self_contact_registry, NULL, NULL, NULL},
    {"contact", NULL, ENTRY_PARAMS, &drape_contact_registry, NULL, NULL, NULL},
    {"untangle", NULL, ENTRY_PARAMS, &drape_untangle_registry, NULL, NULL, NULL},
    {"integrator", "method", TABLE_PARAMS, &drape_integrator_registry, NULL, NULL, NULL},
    {"controller", "type", TABLE_PARAMS, &drape_controller_registry, NULL, NULL, NULL},
    {"material", NULL, ENTRY_PARAMS, &drape_material_registry,
     (const char *const[]){"density", "areal_density", "total_mass", NULL},
     (const char *const[]){"young_modulus", "thickness", NULL}, "fabric"},
};

static const struct opening *opening_of(const drape_scene_object *object)
{
    for (size_t i = 0; i < sizeof openings / sizeof *openings; i++)
        if (strcmp(openings[i].object, object->name) == 0)
            return &openings[i];
    return NULL;
}

/* Texts that name entries of a table. */
static json_t *names_of(const drape_scene_object *object, const drape_scene_key *key)
{
    const struct opening *opening = object->open ? opening_of(object) : NULL;
    if (opening && opening->key && strcmp(opening->key, key->param.name) == 0)
        return entry_names(opening->table, false);
    if (object == &drape_form_output && key->param.kind == DRAPE_PARAM_TEXT)
        return entry_names(&drape_exporter_registry, false);
    return value_of(&key->param);
}

/* ---- Keys ---- */

static json_t *object_schema(const drape_scene_object *object);

static json_t *key_value(const drape_scene_object *object, const drape_scene_key *key)
{
    switch (key->shape) {
    case DRAPE_SCENE_VALUE:
        return key->or_number ? any_of(typed("number"), names_of(object, key)) : names_of(object, key);
    case DRAPE_SCENE_LIST:
        return array_of(names_of(object, key), key->at_least, key->at_most);
    case DRAPE_SCENE_VERSION:
        return json_pack("{s:i}", "const", DRAPE_SCENE_FORM);
    case DRAPE_SCENE_REMARK:
        return typed("string");
    case DRAPE_SCENE_BOX:
        return array_of(numbers(3, 3), 2, 2);
    case DRAPE_SCENE_TRACK:
        return array_of(json_pack("{s:s, s:[o, o], s:i, s:i}", "type", "array", "prefixItems",
                                  typed("number"), numbers(3, 3), "minItems", 2, "maxItems", 2),
                        key->at_least, key->at_most);
    case DRAPE_SCENE_QUATERNION:
        return numbers(4, 4);
    case DRAPE_SCENE_OBJECT:
        return object_schema(key->child);
    case DRAPE_SCENE_OBJECTS:
        return array_of(object_schema(key->child), key->at_least, key->at_most);
    case DRAPE_SCENE_ENTRIES:
        return array_of(any_of(entry_names(opening_of(key->child)->table, true), object_schema(key->child)),
                        key->at_least, key->at_most);
    }
    return NULL;
}

/* ---- Objects ---- */

bool cli_is_one_of(const drape_scene_object *form, const drape_scene_key *key)
{
    for (int i = 0; form->one_of && form->one_of[i]; i++)
        if (strcmp(form->one_of[i], key->param.name) == 0)
            return true;
    return false;
}

/* chosen: the one of the alternatives that is given, which excludes the others; NULL: none is. */
static json_t *properties_of(const drape_scene_object *object, const char *chosen)
{
    json_t *properties = json_object();
    for (size_t i = 0; i < object->key_count; i++) {
        const drape_scene_key *key = &object->keys[i];
        const bool excluded = chosen && cli_is_one_of(object, key) && strcmp(key->param.name, chosen) != 0;
        if (!excluded)
            properties = drape_json_with(properties, key->param.name,
                                         described(key_value(object, key), key, cli_is_one_of(object, key)));
    }
    return properties;
}

/* An object that itself may be left out cannot be left out if something in it is required. */
static json_t *required_of(const drape_scene_object *object)
{
    json_t *required = json_array();
    for (size_t i = 0; i < object->key_count; i++) {
        const drape_scene_key *key = &object->keys[i];
        const struct opening *inside = key->shape == DRAPE_SCENE_OBJECT ? opening_of(key->child) : NULL;
        const bool within =
            inside && !inside->key && (needs_params(inside->table->entries[0]) || inside->all_of);
        if (!key->optional && (drape_param_is_required(&key->param) || within))
            required = drape_json_append(required, json_string(key->param.name));
    }
    return required;
}

/* Takes both references. */
static json_t *closed(json_t *properties, json_t *required)
{
    json_t *object = drape_json_with(typed("object"), "properties", properties);
    if (json_array_size(required) > 0)
        object = drape_json_with(object, "required", json_incref(required));
    json_decref(required);
    return drape_json_with(object, "additionalProperties", json_false());
}

/* A form for each entry that the key may name. */
static json_t *entries_schema(const drape_scene_object *object, const struct opening *opening)
{
    const char *key = opening->key;
    json_t *forms = json_array();
    const drape_entry *entry;
    for (int i = 0; (entry = opening->table->entries[i]) != NULL; i++) {
        if (is_implied(opening->table, i))
            continue;
        json_t *name = json_pack("{s:s, s:s}", "const", entry->name, "description", entry->summary);
        json_t *properties = drape_json_with(properties_of(object, key), key, name);
        json_t *required = required_of(object);
        bool named = false;
        for (size_t k = 0; k < json_array_size(required); k++)
            named = named || strcmp(json_string_value(json_array_get(required, k)), key) == 0;
        if (!named)
            required = drape_json_append(required, json_string(key));
        forms =
            drape_json_append(forms, closed(with_params(properties, entry), with_required(required, entry)));
    }
    for (int i = 0; object->open_with && object->one_of && object->one_of[i]; i++) {
        const char *name = object->one_of[i]; /* an alternative to the key that opens the object */
        if (strcmp(name, object->open_with) != 0)
            forms =
                drape_json_append(forms, closed(properties_of(object, name),
                                                drape_json_append(required_of(object), json_string(name))));
    }
    return json_pack("{s:o}", "anyOf", forms);
}

/* The first choice of the preset, "none", means that no preset is used. */
static json_t *with_preset(json_t *schema, const struct opening *opening)
{
    json_t *named = json_pack("{s:[s], s:{s:{s:{s:s}}}}", "required", opening->preset, "properties",
                              opening->preset, "not", "const", "none");
    schema = drape_json_with(schema, "if", named);
    json_t *none = json_pack("{s:{s:o}}", "not", "anyOf", each_required(opening->one_of));
    json_t *at_most_one =
        json_pack("{s:o}", "oneOf", drape_json_append(each_required(opening->one_of), none));
    json_t *together = json_object(); /* all of the keys, or none */
    for (int i = 0; opening->all_of[i]; i++)
        together = drape_json_with(together, opening->all_of[i], words(opening->all_of));
    schema = drape_json_with(schema, "then", drape_json_with(at_most_one, "dependentRequired", together));
    json_t *all = json_pack("{s:o}", "required", words(opening->all_of));
    return drape_json_with(schema, "else", drape_json_with(all, "oneOf", each_required(opening->one_of)));
}

static json_t *object_schema(const drape_scene_object *object)
{
    const struct opening *opening = object->open ? opening_of(object) : NULL;
    if (opening && opening->kind == ENTRY_PARAMS && opening->key)
        return entries_schema(object, opening);
    json_t *properties = properties_of(object, NULL), *required = required_of(object);
    for (int i = 0; opening && opening->table->entries[i]; i++) { /* parameters of all entries of the table */
        properties = with_params(properties, opening->table->entries[i]);
        if (opening->kind == ENTRY_PARAMS) /* of a table of one entry without a name */
            required = with_required(required, opening->table->entries[i]);
    }
    json_t *schema = closed(properties, required);
    const char *const *one_of = opening && opening->one_of ? opening->one_of : object->one_of;
    if (opening && opening->preset)
        return with_preset(schema, opening);
    return one_of ? drape_json_with(schema, "oneOf", each_required(one_of)) : schema;
}

json_t *cli_schema(void)
{
    json_t *schema = json_pack("{s:s, s:s}", "$schema", "https://json-schema.org/draft/2020-12/schema",
                               "title", "A scene of Drape");
    json_t *form = object_schema(&drape_form_scene);
    const bool whole = form && json_object_update(schema, form) == 0;
    json_decref(form);
    if (!whole)
        json_decref(schema);
    return whole ? schema : NULL;
}
