/* cmd_info.c: `drape info`: show what a scene models and what it costs, as JSON or for reading: a line for
 * each value, in the order of the object. Lists are in one line, but those of objects with names. Empty lists
 * are left out. */
#include "cli/cli.h"
#include "cli/schema.h"

#include "colliders/deformed.h"
#include "compile/compile.h"
#include "events/events.h"
#include "io/json.h"
#include "mesh/mesh.h"
#include "model/model.h"
#include "model/scene.h"
#include "sim/profile.h"

#include <assert.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define COLUMN      28  /* of the values */
#define MAX_WRITTEN 200 /* bytes of a value; --json has all of it */

typedef struct info_request {
    cli_command command;
    bool json;
} info_request;

/* ---- Parameters and keys, from their tables, so that every new key is shown; NULL: memory ran out ---- */

/* A described value is an object with "value", "unit", "plain": true and, where it is known, "default"; plain
 * JSON has the value alone in its place. Takes the reference to the value. */
static json_t *described(json_t *value, const char *unit)
{
    return json_pack("{s:o, s:s, s:b}", "value", value, "unit", unit, "plain", true);
}

/* Whether a value is described, or a parameter, which has no "plain". */
static bool is_described(const json_t *value)
{
    return json_is_string(json_object_get(value, "unit"));
}

/* Replaces all described values inside an object or array. */
static void make_plain(json_t *value)
{
    json_t *part;
    size_t k;
    for (void *i = json_object_iter(value); i; i = json_object_iter_next(value, i)) {
        part = json_object_iter_value(i);
        if (json_object_get(part, "plain"))
            json_object_iter_set(value, i, json_object_get(part, "value"));
        else
            make_plain(part);
    }
    json_array_foreach(value, k, part) make_plain(part);
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

/* Each parameter with "value", "unit" and "default". choice: what the scene said; NULL: not known, a value
 * that equals the default counts as one, and texts are empty. */
static json_t *params_json(const drape_param *params, int param_count, const double *values,
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

/* The parameters of an entry as described values. derived: also those that follow from others. */
static json_t *values_json(const drape_entry *entry, const double *values, bool derived)
{
    json_t *object = params_json(entry->params, entry->param_count, values, NULL);
    for (int p = 0; p < entry->param_count; p++) {
        const char *name = entry->params[p].name;
        if (derived || !isnan(values[drape_param_place(entry->params, p)]))
            json_object_set_new(json_object_get(object, name), "plain", json_true());
        else
            json_object_del(object, name);
    }
    return object;
}

/* ---- Keys and objects ---- */

static json_t *form_json(const drape_scene_object *form, const void *def);

/* The elements of the array of a key. */
static json_t *array_json(const drape_scene_key *key, const char *def)
{
    const bool track = key->shape == DRAPE_SCENE_TRACK, text = key->param.kind == DRAPE_PARAM_TEXT;
    const size_t size = key->child                               ? key->child->def_size
                        : track                                  ? sizeof(drape_track_key)
                        : key->param.kind == DRAPE_PARAM_INTEGER ? sizeof(int32_t)
                                                                 : sizeof(double);
    const char *elements;
    size_t count;
    memcpy(&elements, def + key->offset, sizeof elements);
    memcpy(&count, def + key->count_offset, sizeof count);
    json_t *array = json_array();
    for (size_t i = 0; i < count; i++) {
        const void *at = elements + i * size;
        const drape_track_key *point = at;
        json_t *element = key->child ? form_json(key->child, at)
                          : track    ? json_pack("[o, o]", drape_json_number(point->time),
                                                 drape_json_numbers(point->displacement, 3))
                          : text     ? drape_json_text(*(const char *const *)at)
                          : key->param.kind == DRAPE_PARAM_NUMBER ? drape_json_number(*(const double *)at)
                                                                  : json_integer(*(const int32_t *)at);
        array = drape_json_append(array, element);
    }
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
        return form_json(key->child, def + key->offset);
    case DRAPE_SCENE_VERSION:
    case DRAPE_SCENE_REMARK:
        break;
    }
    return NULL;
}

/* Adds the keys that have a value, described and with "default", except names, which are shown where they are
 * used, and children. */
static json_t *with_keys(json_t *object, const drape_scene_object *form, const void *def)
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
        value = drape_json_with(described(value, key->param.unit), "default", same);
        object = drape_json_with(object, key->param.name, value);
    }
    return object;
}

/* An object of a scene with all values of its def, those by default included. */
static json_t *form_json(const drape_scene_object *form, const void *def)
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
            value = described(value, key->param.unit);
        object = drape_json_with(object, key->param.name, value);
        turn = key->param.kind == DRAPE_PARAM_TURN ? key->param.name : turn;
        if (turn && key->shape == DRAPE_SCENE_QUATERNION) /* it is in place of the axis and angle beside it */
            json_object_del(object, turn);
    }
    return object;
}

static json_t *forms_json(const drape_scene_object *form, const void *defs, size_t count)
{
    json_t *array = json_array();
    for (size_t i = 0; i < count; i++)
        array = drape_json_append(array, form_json(form, (const char *)defs + i * form->def_size));
    return array;
}

/* ---- The scene as an object of described values; what it does not model has no key ---- */

typedef struct info {
    const cli_command *command;
    const drape_model *model;
    const drape_sim *sim;
    bool derived;
    drape_scene_def def; /* what the model was compiled from */
    drape_profile profile;
    int32_t *inside; /* nodes at t = 0, for each collider of the model */
} info;

static json_t *count(int64_t value)
{
    return json_integer((json_int_t)value);
}

static json_t *number(double value, const char *unit)
{
    return described(drape_json_number(value), unit);
}

/* An array of what is made of each index. */
static json_t *list_of(const info *in, size_t count, json_t *(*make)(const info *in, int32_t index))
{
    json_t *list = json_array();
    for (size_t i = 0; i < count; i++)
        list = drape_json_append(list, make(in, (int32_t)i));
    return list;
}

/* ---- Colliders, contact, events, seams ---- */

/* Adds the name of an entry, what it is, and its parameters. */
static json_t *with_entry(json_t *object, const drape_entry *entry, const double *values,
                          const drape_choice *choice)
{
    object = drape_json_with(object, "type", json_string(entry->name));
    object = drape_json_with(object, "summary", json_string(entry->summary));
    return drape_json_with(object, "parameters",
                           params_json(entry->params, entry->param_count, values, choice));
}

static json_t *named(const char *name)
{
    return drape_json_with(json_object(), "name", drape_json_text(name));
}

static json_t *collider(const info *in, int32_t c)
{
    const drape_collider *from = &in->model->colliders[c];
    const drape_collider_def *def = &in->def.colliders[c];
    json_t *object = with_entry(named(from->name), &from->ops->entry, from->values, &from->choice);
    object = with_keys(object, &drape_form_collider, def);
    json_t *moves = form_json(&drape_form_collider, def);
    if (from->track.key_count > 0)
        object = drape_json_with(object, "track", json_incref(json_object_get(moves, "track")));
    if (from->turns.key_count > 0) {
        object = drape_json_with(object, "turns", json_incref(json_object_get(moves, "turns")));
        object = drape_json_with(object, "pivot", described(drape_json_numbers(from->pivot, 3), "m"));
    }
    json_decref(moves);
    return DRAPE_JSON_COUNTS(object, {"points", from->shape.point_count},
                             {"segments", from->shape.segment_count},
                             {"triangles", from->shape.triangle_count}, {"nodes_inside", in->inside[c]});
}

static json_t *event(const info *in, int32_t i)
{
    const drape_model_event *from = &in->model->events[i];
    json_t *object = with_entry(named(from->name), &from->ops->entry, from->values, &from->choice);
    object = with_keys(object, &drape_form_event, &in->def.events[i]);
    return drape_json_with(object, "pinned_nodes", count(from->pinned_count));
}

static json_t *seam(const info *in, int32_t i)
{
    const drape_model_seam *from = &in->model->seams[i];
    const drape_term *term = &in->model->terms[from->term];
    json_t *object = with_entry(named(from->name), &term->ops->entry, term->params, &from->choice);
    object = drape_json_with(object, "pairs", count(from->pair_count));
    object = drape_json_with(object, "a", drape_json_text(in->model->cloths[from->cloth[0]].name));
    return drape_json_with(object, "b", drape_json_text(in->model->cloths[from->cloth[1]].name));
}

/* Of an integrator that moves nodes in place of contact forces, only the thickness acts. */
static json_t *with_contact(json_t *object, const info *in)
{
    double values[DRAPE_MAX_PARAMS];
    const drape_model *model = in->model;
    const bool forces = !in->sim->chosen.integrator->projects_contact;
    if (forces && (model->collider_count > 0 || model->contact.self)) {
        drape_contact_values(&model->contact, values);
        object = drape_json_with(
            object, "contact",
            params_json(drape_contact_params, DRAPE_CONTACT_PARAM_COUNT, values, &model->contact_choice));
    }
    if (model->contact.self) {
        drape_self_contact_values(&model->contact, values);
        object = drape_json_with(object, "self_contact",
                                 params_json(drape_self_contact_params,
                                             forces ? DRAPE_SELF_PARAM_COUNT : DRAPE_SELF_THICKNESS + 1,
                                             values, &model->self_choice));
    }
    if (model->untangle.given) {
        drape_untangle_values(&model->untangle, values);
        object = drape_json_with(
            object, "untangle",
            params_json(drape_untangle_params, DRAPE_UNTANGLE_PARAM_COUNT, values, &model->untangle_choice));
    }
    return object;
}

static json_t *chosen(const info *in, const drape_entry *entry, const double *values,
                      const drape_choice *choice,
                      bool (*ignores)(const drape_chosen *chosen, const char *name))
{
    json_t *ignored = json_array();
    for (size_t i = 0; i < choice->setting_count; i++)
        if (ignores(&in->sim->chosen, choice->settings[i].name))
            ignored = drape_json_append(ignored, drape_json_text(choice->settings[i].name));
    return drape_json_with(with_entry(json_object(), entry, values, choice), "ignored", ignored);
}

/* ---- Cloths and terms ---- */

/* The nodes that the pin selects are in place of how it selects them, and the triangles that carry them, in
 * their order, in place of the one that is given. */
static json_t *pin(const info *in, const drape_pin *pin, const drape_pin_def *def)
{
    const drape_model *model = in->model;
    const int32_t first = pin->node_count > 0 ? pin->node[0] : -1;
    json_t *object = form_json(&drape_form_pin, def), *nodes = json_array(), *triangles = json_array();
    for (int i = 0; object && drape_form_pin.one_of[i]; i++)
        json_object_del(object, drape_form_pin.one_of[i]);
    for (int32_t i = 0; i < pin->node_count; i++) {
        nodes = drape_json_append(nodes, count(pin->node[i] - model->cloths[pin->cloth].first_node));
        if (def->attach && model->ride[first].triangle >= 0)
            triangles = drape_json_append(triangles, count(model->ride[pin->node[i]].triangle));
    }
    object = drape_json_with(object, "nodes", nodes);
    object = drape_json_with(object, "name", drape_json_text(pin->name));
    if (json_array_size(triangles) > 0)
        json_object_del(object, "triangle");
    object = drape_json_with_list(object, "triangles", triangles);
    for (int32_t i = 0; def->turn_count > 0 && i < model->moved_count; i++)
        if (model->moved_node[i] == first && model->moved_track[i] >= 0)
            object = drape_json_with(
                object, "pivot",
                described(drape_json_numbers(model->tracks[model->moved_track[i]].pivot, 3), "m"));
    return object;
}

/* The grid of a mesh with its values in *object, which is empty without one. The settings were valid when the
 * model was compiled. */
static const drape_grid_ops *grid(const info *in, const drape_entry_def *def, json_t **object)
{
    double values[DRAPE_MAX_PARAMS];
    const int i = drape_registry_find(&drape_grid_registry, NULL, def->type ? def->type : "");
    const drape_entry *entry = i < 0 ? NULL : &drape_grids[i]->entry;
    if (!entry || drape_params_resolve(in->sim->ctx, "", entry, def->settings, def->setting_count, values))
        entry = NULL;
    *object = entry ? values_json(entry, values, in->derived) : json_object();
    return entry ? drape_grids[i] : NULL;
}

static json_t *mesh(const info *in, const drape_cloth *cloth, const drape_mesh_def *def)
{
    json_t *object;
    const drape_grid_ops *from = grid(in, &def->grid, &object);
    if (from)
        object = drape_json_with(object, "grid", drape_json_text(from->entry.name));
    if (cloth->file)
        object = drape_json_with(object, "file", drape_json_text(cloth->file));
    object = DRAPE_JSON_COUNTS(object, {"subdivide", def->subdivide});
    return drape_json_with(object, "transform", with_keys(json_object(), &drape_form_transform, def));
}

static json_t *render_mesh(const info *in, int32_t c)
{
    const drape_cloth *cloth = &in->model->cloths[c];
    const drape_render_mesh_def *def = &in->def.cloths[c].render_mesh;
    json_t *object, *keys = form_json(drape_scene_key_of(&drape_form_cloth, "render_mesh")->child, def);
    grid(in, &def->mesh.grid, &object);
    json_object_update(object, keys);
    json_decref(keys);
    object = drape_json_with(object, "max_distance", number(cloth->max_distance, "m"));
    return DRAPE_JSON_COUNTS(object, {"vertices", cloth->render_mesh.node_count},
                             {"triangles", cloth->render_mesh.triangle_count});
}

/* Adds a stiffness of a measured fabric unless it is that of an isotropic material. */
static json_t *with_woven(json_t *object, const char *key, const drape_woven *w, const char *unit,
                          const char *shear)
{
    if (!(w->warp > 0))
        return object;
    json_t *woven =
        json_pack("{s:o, s:o, s:o, s:o}", "warp", number(w->warp, unit), "weft", number(w->weft, unit), shear,
                  number(w->shear, unit), "poisson", drape_json_number(w->poisson));
    return drape_json_with(object, key, woven);
}

static json_t *material(const info *in, const drape_cloth *cloth)
{
    const drape_material *m = &cloth->material;
    json_t *object = values_json(&drape_material_entry, cloth->material_values, in->derived);
    object = drape_json_with(object, "areal_density", number(m->areal_density, "kg/m2"));
    object = drape_json_with(object, "membrane_stiffness", number(m->membrane_stiffness, "N/m"));
    object = drape_json_with(object, "flexural_rigidity", number(m->flexural_rigidity, "N m"));
    object = with_woven(object, "tension", &cloth->tension, "N/m", "shear");
    return with_woven(object, "bending", &cloth->bending, "N m", "twist");
}

static json_t *cloth(const info *in, int32_t c)
{
    const drape_cloth *from = &in->model->cloths[c];
    const drape_cloth_def *def = &in->def.cloths[c];
    const int32_t first = from->first_node, end = first + from->mesh.node_count;
    int32_t pinned = 0, moved = 0, supported = 0; /* nodes; supported: held in some directions only */
    double mass = 0, area = 0;
    for (int32_t i = first; i < end; i++)
        pinned += in->model->pinned[i];
    for (int32_t i = 0; i < in->model->moved_count; i++)
        moved += in->model->moved_node[i] >= first && in->model->moved_node[i] < end;
    for (int32_t i = 0; i < in->model->support_count; i++)
        supported += in->model->supports[i].node >= first && in->model->supports[i].node < end;
    for (int32_t i = first; i < end; i++)
        mass += in->model->mass[i];
    for (int32_t t = 0; t < from->mesh.triangle_count; t++)
        area += from->mesh.triangle_area[t];
    const drape_pin *of_cloth = in->model->pins;
    json_t *pins = json_array();
    for (int32_t i = 0; i < c; i++)
        of_cloth += in->def.cloths[i].pin_count;
    for (size_t i = 0; i < def->pin_count; i++)
        pins = drape_json_append(pins, pin(in, &of_cloth[i], &def->pins[i]));
    const drape_scene_object *form = drape_scene_key_of(&drape_form_cloth, "start")->child;
    drape_start_def defaults = {.file = NULL};
    drape_scene_set_defaults(form, &defaults);
    json_t *start = form_json(form, &def->start), *rest = form_json(form, &defaults);
    json_t *object =
        DRAPE_JSON_COUNTS(named(from->name), {"nodes", from->mesh.node_count},
                          {"triangles", from->mesh.triangle_count}, {"edges", from->mesh.edge_count});
    object = drape_json_with(object, "mesh", mesh(in, from, &def->mesh));
    object = drape_json_with(object, "mass", number(mass, "kg"));
    object = drape_json_with(object, "area", number(area, "m2"));
    object = with_keys(object, &drape_form_cloth, def);
    object = DRAPE_JSON_COUNTS(object, {"pinned", pinned}, {"moved", moved}, {"supported", supported});
    object = drape_json_with_list(object, "pins", pins);
    object =
        drape_json_with_list(object, "masses", forms_json(&drape_form_mass, def->masses, def->mass_count));
    object = drape_json_with_list(object, "periodic",
                                  forms_json(&drape_form_periodic, def->periodic, def->periodic_count));
    if (!json_equal(start, rest)) /* how the cloth starts unless it is at rest */
        object = drape_json_with(object, "start", json_incref(start));
    json_decref(start);
    json_decref(rest);
    if (from->bound)
        object = drape_json_with(object, "render_mesh", render_mesh(in, c));
    return drape_json_with(object, "material", material(in, from));
}

static json_t *term(const info *in, int32_t i)
{
    const drape_term *from = &in->model->terms[i];
    const drape_profile_term *cost = &in->profile.terms[i];
    const double seconds = cost->residual_seconds + cost->jacobian_seconds;
    json_t *object = named(from->ops->entry.name);
    object = drape_json_with(object, from->seam < 0 ? "cloth" : "seam",
                             drape_json_text(from->seam < 0 ? in->model->cloths[from->cloth].name
                                                            : in->model->seams[from->seam].name));
    if (from->ops->law)
        object = drape_json_with(object, "acts_on", count(cost->acts_on));
    object = drape_json_with(object, "element", json_string(from->ops->element_name));
    object = DRAPE_JSON_COUNTS(object, {"elements", from->elements.count},
                               {"nodes_an_element", from->elements.nodes}, {"nonzeros", cost->nonzeros},
                               {"bytes", (int64_t)cost->bytes});
    object = DRAPE_JSON_REALS(object, {"residual_s", cost->residual_seconds},
                              {"jacobian_s", cost->jacobian_seconds},
                              {"share", seconds / fmax(drape_profile_seconds(&in->profile), 1e-300)});
    json_t *parameters =
        params_json(from->ops->entry.params, from->ops->entry.param_count, from->params, NULL);
    if (from->history && *from->history->name)
        json_object_set_new(json_object_get(parameters, "history"), "value",
                            drape_json_text(from->history->name));
    return drape_json_with(object, "parameters", parameters);
}

/* ---- Costs ---- */

static json_t *iteration(const info *in)
{
    const drape_profile *p = &in->profile;
    double outside = p->residual_seconds + p->jacobian_seconds;
    for (int32_t i = 0; i < in->model->term_count; i++)
        outside -= p->terms[i].residual_seconds + p->terms[i].jacobian_seconds;
    json_t *object = DRAPE_JSON_REALS(json_object(), {"residual_s", p->residual_seconds},
                                      {"jacobian_s", p->jacobian_seconds}, {"factor_s", p->factor_seconds},
                                      {"solve_s", p->solve_seconds}, {"total_s", drape_profile_seconds(p)},
                                      {"outside_terms_s", fmax(outside, 0)});
    object = drape_json_with(object, "implicit", json_boolean(p->implicit));
    object = drape_json_with(object, "factored", json_boolean(p->implicit && !p->factor_status));
    object = drape_json_with(object, "linear_solver", json_string(p->linear_solver));
    object = drape_json_with(object, "linear_picked", json_string(p->linear_picked));
    object = drape_json_with(object, "linear_why", json_string(p->linear_why));
    object = drape_json_with(object, "linear_fell_back", json_boolean(p->linear_fallback[0]));
    return drape_json_with(object, "linear_fallback", json_string(p->linear_fallback));
}

static json_t *bytes(const info *in)
{
    const drape_profile *p = &in->profile;
    const size_t sum = drape_profile_bytes(p);
    json_t *object = DRAPE_JSON_COUNTS(
        json_object(), {"model", (int64_t)p->model_bytes}, {"meshes", (int64_t)p->mesh_bytes},
        {"sparsity", (int64_t)p->pattern_bytes}, {"evaluation", (int64_t)p->system_bytes},
        {"integrator", (int64_t)p->integrator_bytes}, {"state", (int64_t)p->state_bytes},
        {"total", (int64_t)sum});
    return drape_json_with(object, "a_node", drape_json_number((double)sum / in->model->node_count));
}

/* ---- All of it ---- */

static json_t *scene(const info *in)
{
    const drape_model *model = in->model;
    const drape_chosen *all = &in->sim->chosen;
    /* frames at k / rate up to the end, and one at the end if none of them is there */
    const double intervals = model->duration * model->frame_rate, whole = floor(intervals + 1e-9);
    const int64_t frames = (int64_t)whole + (intervals - whole > 1e-9 ? 2 : 1);
    json_t *object = drape_json_with(json_object(), "scene", drape_json_text(in->command->operand));
    object = with_keys(object, &drape_form_scene, &in->def);
    object = with_keys(object, &drape_form_output, &in->def);
    object = DRAPE_JSON_COUNTS(object, {"frames", frames}, {"nodes", model->node_count},
                               {"free", model->free_count}, {"dofs", model->pattern.n},
                               {"nnz", model->pattern.nonzeros});
    object = drape_json_with(object, "tolerance", number(drape_sim_statistics(in->sim).tolerance, "N"));
    object = drape_json_with(object, "cloths", list_of(in, (size_t)model->cloth_count, cloth));
    object = drape_json_with_list(object, "colliders", list_of(in, (size_t)model->collider_count, collider));
    object = with_contact(object, in);
    object = drape_json_with_list(object, "events", list_of(in, (size_t)model->event_count, event));
    object = drape_json_with(object, "seams", list_of(in, (size_t)model->seam_count, seam));
    object = drape_json_with_list(object, "histories",
                                  forms_json(&drape_form_history, in->def.histories, in->def.history_count));
    object = drape_json_with(object, "integrator",
                             chosen(in, &all->integrator->entry, all->integrator_values, &model->integrator,
                                    drape_chosen_ignores_integrator));
    object = drape_json_with(object, "controller",
                             chosen(in, &all->controller->entry, all->controller_values, &model->controller,
                                    drape_chosen_ignores_controller));
    if (all->integrator->stability) { /* at the start, of a step of its dt; an infinite limit becomes null */
        drape_stability s;
        all->integrator->stability(in->sim->integrator, drape_sim_state(in->sim), in->profile.dt, &s);
        json_t *limit = drape_json_with(json_object(), "omega", number(s.omega, "rad/s"));
        limit = drape_json_with(limit, "damping", number(s.damping, "1/s"));
        limit = drape_json_with(limit, "limit", number(s.limit, "s"));
        limit = drape_json_with(limit, "substep", number(s.substep, "s"));
        limit = drape_json_with(limit, "share", drape_json_number(s.substep / s.limit));
        limit = drape_json_with(limit, "stable", json_boolean(s.substep <= s.limit));
        object = drape_json_with(object, "stability", limit);
    }
    object = drape_json_with(object, "terms", list_of(in, (size_t)model->term_count, term));
    object = drape_json_with(object, "iteration", iteration(in));
    return drape_json_with(object, "bytes", bytes(in));
}

/* derived: also values of meshes and materials that follow from others. *out is NULL, or errno ENOMEM, if
 * memory ran out. */
static drape_status make_info(const cli_command *command, const cli_scene *in, bool derived, json_t **out)
{
    info all = {.command = command, .model = in->model, .sim = in->sim, .derived = derived};
    drape_profile_term *terms =
        drape_arena_take(command->arena, (size_t)in->model->term_count, sizeof *terms);
    all.inside = drape_arena_take(command->arena, (size_t)in->model->collider_count, sizeof *all.inside);
    drape_status status = drape_arena_status(command->arena);
    for (int32_t c = 0; !status && c < in->model->collider_count; c++) {
        const double t = drape_sim_time(in->sim), *x = drape_sim_positions(in->sim);
        const drape_collider_pose pose = drape_collider_pose_at(&in->model->colliders[c], t);
        const drape_collider *collider;
        drape_arena arena = drape_arena_of(in->ctx);
        status = drape_deformed_at(&arena, in->model, NULL, c, t, &collider);
        for (int32_t i = 0; !status && i < in->model->node_count; i++)
            all.inside[c] += drape_collider_distance(collider, &pose, x + 3 * (size_t)i, NULL, NULL) < 0;
        drape_arena_free(&arena);
    }
    if (!status)
        status = drape_scene_to_def(in->scene, &all.def);
    if (!status)
        status = drape_profile_measure(in->ctx, in->sim, terms, &all.profile);
    errno = 0;
    *out = status ? NULL : scene(&all);
    return status;
}

/* ---- For reading ---- */

typedef struct line {
    char text[MAX_WRITTEN + 1];
    size_t length; /* above MAX_WRITTEN: the text is cut */
} line;

DRAPE_PRINTF(2, 3) static void add(line *to, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    if (to->length < sizeof to->text)
        to->length += (size_t)vsnprintf(to->text + to->length, sizeof to->text - to->length, format, args);
    va_end(args);
}

static void add_value(line *to, json_t *value)
{
    const char *key, *unit = json_string_value(json_object_get(value, "unit")), *separator = "";
    json_t *part = json_object_get(value, "value");
    size_t i;
    if (is_described(value)) {
        add_value(to, part);
        if (strcmp(unit, "1") != 0 && (json_is_number(part) || json_is_array(part)))
            add(to, " %s", unit);
        add(to, "%s", json_is_true(json_object_get(value, "default")) ? " (default)" : "");
    } else if (json_is_object(value)) {
        json_object_foreach(value, key, part)
        {
            add(to, "%s%s ", *separator ? separator : "{", key);
            add_value(to, part);
            separator = ", ";
        }
        add(to, "}");
    } else if (json_is_array(value) && json_array_size(value) > 0) {
        json_array_foreach(value, i, part)
        {
            add(to, "%s", i ? ", " : "[");
            add_value(to, part);
        }
        add(to, "]");
    } else if (json_is_number(value)) {
        add(to, json_is_real(value) ? "%.9g" : "%.0f", json_number_value(value));
    } else if (json_is_boolean(value)) {
        add(to, json_is_true(value) ? "true" : "false");
    } else {
        add(to, "%s", json_string_length(value) > 0 ? json_string_value(value) : "none");
    }
}

/* The costs of the terms as a table, as a reader compares them. They leave the terms. */
static void print_costs(json_t *terms)
{
    static const char *const columns[] = {"elements",   "nonzeros",   "bytes",
                                          "residual_s", "jacobian_s", "share"};
    const size_t count = sizeof columns / sizeof *columns;
    json_t *term;
    size_t i;
    printf("%-36s", "");
    for (size_t k = 0; k < count; k++)
        printf(" %10s", columns[k]);
    puts("");
    json_array_foreach(terms, i, term)
    {
        const char *cloth = json_string_value(json_object_get(term, "cloth")),
                   *owner = cloth ? cloth : json_string_value(json_object_get(term, "seam"));
        printf("  %-20s %-13s", json_string_value(json_object_get(term, "name")),
               cli_shown((char[14]){0}, 14, owner));
        for (size_t k = 0; k < count; k++) {
            const json_t *cost = json_object_get(term, columns[k]);
            printf(json_is_integer(cost) ? " %10.0f" : " %10.3g", json_number_value(cost));
            json_object_del(term, columns[k]);
        }
        puts("");
    }
}

static void print_object(int indent, json_t *object);

/* A heading, and the blocks of a list below their names. */
static void print_block(int indent, const char *heading, json_t *block)
{
    json_t *item;
    size_t i;
    printf("%*s%s\n", indent, "", CLI_SHOWN(heading));
    if (indent == 0 && strcmp(heading, "terms") == 0)
        print_costs(block);
    if (json_is_object(block))
        print_object(indent + 2, block);
    json_array_foreach(block, i, item)
        print_block(indent + 2, json_string_value(json_object_get(item, "name")), item);
}

static void print_object(int indent, json_t *object)
{
    const char *key;
    json_t *value;
    json_object_foreach(object, key, value)
    {
        line to = {.length = 0};
        if (strcmp(key, "parameters") == 0) {
            print_object(indent, value);
        } else if ((json_is_object(value) && !is_described(value)) ||
                   json_is_string(json_object_get(json_array_get(value, 0), "name"))) {
            fputs(indent ? "" : "\n", stdout);
            print_block(indent, key, value);
        } else if ((strcmp(key, "name") != 0 || is_described(value)) &&
                   (!json_is_array(value) || json_array_size(value) > 0)) {
            add_value(&to, value);
            printf("%*s%-*s %s%s\n", indent, "", COLUMN - indent, key, CLI_SHOWN(to.text),
                   to.length > MAX_WRITTEN ? " ..." : "");
        }
    }
}

static int run(const void *command)
{
    const info_request *request = command;
    const cli_command *common = &request->command;
    cli_scene in;
    json_t *object = NULL;
    int code = cli_scene_load(common, common->operand, &in);
    const bool loaded = code == CLI_GO_ON;
    if (loaded && make_info(common, &in, !request->json, &object)) {
        code = cli_report(common, CLI_FAILED);
    } else if (loaded && request->json) {
        make_plain(object);
        code = cli_print_json(common, object, JSON_INDENT(2) | JSON_REAL_PRECISION(15) | JSON_ENSURE_ASCII);
    } else if (loaded) {
        code = object && !drape_memory_ran_out() ? CLI_DONE : cli_report_memory(common);
        if (code == CLI_DONE)
            print_object(0, object);
        json_decref(object);
    }
    cli_scene_free(&in);
    return code;
}

static const cli_option options[] = {
    {"json", CLI_FLAG, NULL, "print the same as JSON", offsetof(info_request, json)},
};

const drape_verb drape_verb_info = {
    .entry = {.name = "info", .summary = "show what a scene models and what it costs"},
    .operand = "SCENE",
    .takes_scene = true,
    .details =
        "Shows what a scene models, every parameter with its value, and what each part costs: elements,\n"
        "nonzeros, bytes, and its share of one Newton iteration, measured at a slightly deformed state.",
    CLI_OPTIONS(options, info_request),
    .run = run,
};
