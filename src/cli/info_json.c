/* info_json.c: `drape info --json`. As in info_text.c, what the scene does not model has no key. */
#include "cli/info.h"
#include "events/events.h"
#include "io/json.h"

#include <math.h>
#include <string.h>

static json_t *count(int64_t value)
{
    return json_integer((json_int_t)value);
}

static json_t *vector(const double v[3])
{
    return drape_json_numbers(v, 3);
}

/* ---- Parameters ---- */

/* choice: the source of text values; NULL: there are none. */
static json_t *value_of(const drape_param *param, const double *value, const drape_choice *choice)
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
        return vector(value);
    case DRAPE_PARAM_TEXT:
        return drape_json_text(choice ? cli_text_of(choice, param->name) : "");
    case DRAPE_PARAM_POINTS: /* their number */
        return count((int64_t)*value);
    case DRAPE_PARAM_NUMBER:
    case DRAPE_PARAM_INTEGER:
        break;
    }
    return param->kind == DRAPE_PARAM_INTEGER ? count((int64_t)*value) : drape_json_number(*value);
}

static json_t *params_of(const drape_param *params, int param_count, const double *values,
                         const drape_choice *choice)
{
    json_t *object = json_object();
    for (int p = 0; p < param_count; p++) {
        json_t *one = drape_json_with(json_object(), "value",
                                      value_of(&params[p], values + drape_param_place(params, p), choice));
        one = drape_json_with(one, "unit", json_string(params[p].unit));
        if (choice)
            one = drape_json_with(one, "default", json_boolean(!cli_is_given(choice, params[p].name)));
        object = drape_json_with(object, params[p].name, one);
    }
    return object;
}

json_t *cli_key_json(const drape_scene_key *key, const void *def)
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

/* Adds the keys that have a value, except names, which are printed where they are used. */
static json_t *with_keys(json_t *object, const drape_scene_object *form, const void *def)
{
    for (size_t i = 0; i < form->key_count; i++) {
        const drape_scene_key *key = &form->keys[i];
        const bool named = key->param.kind == DRAPE_PARAM_TEXT && key->shape == DRAPE_SCENE_VALUE;
        drape_setting given;
        const bool has = key->shape == DRAPE_SCENE_LIST ||
                         (key->shape == DRAPE_SCENE_VALUE && drape_scene_value(key, def, &given));
        if (has && !named)
            object = drape_json_with(object, key->param.name, cli_key_json(key, def));
    }
    return object;
}

static json_t *track(const drape_track *track)
{
    json_t *keys = json_array();
    for (size_t k = 0; k < track->key_count; k++)
        keys = drape_json_append(
            keys, drape_json_append(drape_json_append(json_array(), drape_json_number(track->keys[k].time)),
                                    vector(track->keys[k].displacement)));
    return keys;
}

static json_t *turns(const drape_collider_def *def)
{
    json_t *keys = json_array();
    for (size_t k = 0; k < def->turn_count; k++)
        keys = drape_json_append(keys, cli_form_json(&drape_form_turn, &def->turns[k]));
    return keys;
}

static json_t *collider(const drape_collider *from, const drape_collider_def *def,
                        const cli_collider_info *info)
{
    json_t *object = drape_json_with(json_object(), "name", drape_json_text(from->name));
    object = drape_json_with(object, "type", json_string(from->ops->entry.name));
    object = drape_json_with(
        object, "parameters",
        params_of(from->ops->entry.params, from->ops->entry.param_count, from->values, &from->choice));
    object = with_keys(object, &drape_form_collider, def);
    if (from->track.key_count > 0)
        object = drape_json_with(object, "track", track(&from->track));
    if (from->turns.key_count > 0)
        object = drape_json_with(object, "turns", turns(def));
    object = drape_json_with(object, "points", count(from->shape.point_count));
    object = drape_json_with(object, "segments", count(from->shape.segment_count));
    object = drape_json_with(object, "triangles", count(from->shape.triangle_count));
    return drape_json_with(object, "nodes_inside", count(info->inside));
}

static json_t *event(const drape_model_event *from, const drape_event_def *def)
{
    const drape_entry *entry = &from->ops->entry;
    json_t *object = drape_json_with(json_object(), "name", drape_json_text(from->name));
    object = drape_json_with(object, "type", json_string(entry->name));
    object = drape_json_with(object, "parameters",
                             params_of(entry->params, entry->param_count, from->values, &from->choice));
    object = with_keys(object, &drape_form_event, def);
    return drape_json_with(object, "pinned_nodes", count(from->pinned_count));
}

static json_t *with_events(json_t *object, const cli_info *info)
{
    json_t *events = json_array();
    for (int32_t i = 0; i < info->model->event_count; i++)
        events = drape_json_append(events, event(&info->model->events[i], &info->def.events[i]));
    if (info->model->event_count > 0)
        object = drape_json_with(object, "events", json_incref(events));
    json_decref(events);
    return object;
}

static json_t *with_contact(json_t *object, const cli_info *info)
{
    cli_contact_entries contact;
    json_t *colliders = json_array();
    for (int32_t c = 0; c < info->model->collider_count; c++)
        colliders = drape_json_append(
            colliders, collider(&info->model->colliders[c], &info->def.colliders[c], &info->colliders[c]));
    if (info->model->collider_count > 0)
        object = drape_json_with(object, "colliders", json_incref(colliders));
    json_decref(colliders);
    cli_contact(info->sim, &contact);
    for (int i = 0; i < contact.count; i++) {
        const cli_chosen *entry = &contact.entries[i];
        object = drape_json_with(object, entry->title,
                                 params_of(entry->params, entry->param_count, entry->values, entry->choice));
    }
    return object;
}

static json_t *chosen(const cli_chosen *entry, const drape_chosen *all)
{
    json_t *ignored = json_array();
    for (size_t i = 0; i < entry->choice->setting_count; i++)
        if (entry->ignores(all, entry->choice->settings[i].name))
            ignored = drape_json_append(ignored, drape_json_text(entry->choice->settings[i].name));
    json_t *object = drape_json_with(json_object(), "type", json_string(entry->name));
    object = drape_json_with(object, "parameters",
                             params_of(entry->params, entry->param_count, entry->values, entry->choice));
    return drape_json_with(object, "ignored", ignored);
}

/* ---- Cloths and terms ---- */

/* The values of a parameter list; choices and booleans as texts. */
static json_t *values_of(const drape_param *params, int param_count, const double *values)
{
    char words[128];
    json_t *object = json_object();
    for (int p = 0; p < param_count; p++) {
        bool spoken = params[p].kind == DRAPE_PARAM_CHOICE || params[p].kind == DRAPE_PARAM_BOOLEAN;
        const double *value = values + drape_param_place(params, p);
        if (spoken)
            drape_param_value_text(&params[p], value, words, sizeof words);
        if (!isnan(*value))
            object = drape_json_with(object, params[p].name,
                                     spoken ? drape_json_text(words) : value_of(&params[p], value, NULL));
    }
    return object;
}

static json_t *mesh(const drape_cloth *cloth, const drape_mesh_def *def)
{
    double values[DRAPE_MAX_PARAMS];
    const drape_grid_ops *grid = cli_grid_of(&def->grid, values);
    json_t *object = grid ? values_of(grid->entry.params, grid->entry.param_count, values) : json_object();
    if (grid)
        object = drape_json_with(object, "grid", drape_json_text(grid->entry.name));
    if (cloth->file)
        object = drape_json_with(object, "file", drape_json_text(cloth->file));
    return drape_json_with(object, "transform", with_keys(json_object(), &drape_form_transform, def));
}

json_t *cli_render_mesh_json(const cli_info *info, int32_t c)
{
    double values[DRAPE_MAX_PARAMS];
    const drape_cloth *cloth = &info->model->cloths[c];
    const drape_render_mesh_def *def = &info->def.cloths[c].render_mesh;
    const drape_grid_ops *grid = cli_grid_of(&def->mesh.grid, values);
    if (!cloth->bound)
        return NULL;
    json_t *object = grid ? values_of(grid->entry.params, grid->entry.param_count, values) : json_object();
    json_t *keys = cli_form_json(drape_scene_key_of(&drape_form_cloth, "render_mesh")->child, def);
    const char *name;
    json_t *value;
    json_object_foreach(keys, name, value) object = drape_json_with(object, name, json_incref(value));
    json_decref(keys);
    object = drape_json_with(object, "max_distance", drape_json_number(cloth->max_distance));
    object = drape_json_with(object, "vertices", count(cloth->render_mesh.node_count));
    return drape_json_with(object, "triangles", count(cloth->render_mesh.triangle_count));
}

/* A stiffness of a measured fabric. */
static json_t *woven(const drape_woven *w, const char *shear)
{
    json_t *object = drape_json_with(drape_json_with(json_object(), "warp", drape_json_number(w->warp)),
                                     "weft", drape_json_number(w->weft));
    return drape_json_with(drape_json_with(object, shear, drape_json_number(w->shear)), "poisson",
                           drape_json_number(w->poisson));
}

static json_t *material(const drape_cloth *cloth)
{
    const drape_material *m = &cloth->material;
    json_t *object =
        values_of(drape_material_entry.params, drape_material_entry.param_count, cloth->material_values);
    object = drape_json_with(object, "areal_density", drape_json_number(m->areal_density));
    object = drape_json_with(object, "membrane_stiffness", drape_json_number(m->membrane_stiffness));
    object = drape_json_with(object, "flexural_rigidity", drape_json_number(m->flexural_rigidity));
    if (cloth->tension.warp > 0)
        object = drape_json_with(object, "tension", woven(&cloth->tension, "shear"));
    return cloth->bending.warp > 0 ? drape_json_with(object, "bending", woven(&cloth->bending, "twist"))
                                   : object;
}

/* Adds a list unless it is empty. */
static json_t *with_list(json_t *object, const char *key, json_t *list)
{
    if (json_array_size(list) > 0 || !list)
        return drape_json_with(object, key, list);
    json_decref(list);
    return object;
}

static json_t *cloth(const cli_info *info, int32_t c)
{
    const drape_cloth *from = &info->model->cloths[c];
    const cli_cloth_info *more = &info->cloths[c];
    json_t *object = drape_json_with(json_object(), "name", drape_json_text(from->name));
    object = drape_json_with(object, "nodes", count(from->mesh.node_count));
    object = drape_json_with(object, "triangles", count(from->mesh.triangle_count));
    object = drape_json_with(object, "edges", count(from->mesh.edge_count));
    object = drape_json_with(object, "mass", drape_json_number(more->mass));
    object = drape_json_with(object, "area", drape_json_number(more->area));
    object = drape_json_with(object, "pinned", count(more->pinned));
    object = drape_json_with(object, "moved", count(more->moved));
    object = with_keys(object, &drape_form_cloth, &info->def.cloths[c]);
    object = with_list(object, "pins", cli_pins_json(info, c));
    object = with_list(object, "masses", cli_masses_json(info, c));
    object = with_list(object, "periodic", cli_periodic_json(info, c));
    json_t *start = cli_start_json(info, c);
    if (start)
        object = drape_json_with(object, "start", start);
    json_t *shown = cli_render_mesh_json(info, c);
    if (shown)
        object = drape_json_with(object, "render_mesh", shown);
    object = drape_json_with(object, "mesh", mesh(from, &info->def.cloths[c].mesh));
    return drape_json_with(object, "material", material(from));
}

static json_t *term(const cli_info *info, int32_t i)
{
    const drape_term *from = &info->model->terms[i];
    const drape_profile_term *cost = &info->profile.terms[i];
    json_t *object = drape_json_with(json_object(), "name", json_string(from->ops->entry.name));
    object = drape_json_with(object, from->seam < 0 ? "cloth" : "seam",
                             drape_json_text(cli_owner(info->model, from)));
    if (from->ops->law)
        object = drape_json_with(object, "acts_on", count(cost->acts_on));
    object = drape_json_with(object, "element", json_string(from->ops->element_name));
    object = drape_json_with(object, "elements", count(from->elements.count));
    object = drape_json_with(object, "nodes_an_element", count(from->elements.nodes));
    object = drape_json_with(object, "nonzeros", count(cost->nonzeros));
    object = drape_json_with(object, "bytes", count((int64_t)cost->bytes));
    object = drape_json_with(object, "residual_s", drape_json_number(cost->residual_seconds));
    object = drape_json_with(object, "jacobian_s", drape_json_number(cost->jacobian_seconds));
    object = drape_json_with(
        object, "share", drape_json_number(cli_share(info, cost->residual_seconds + cost->jacobian_seconds)));
    json_t *parameters = params_of(from->ops->entry.params, from->ops->entry.param_count, from->params, NULL);
    if (from->history && *from->history->name)
        json_object_set_new(json_object_get(parameters, "history"), "value",
                            drape_json_text(from->history->name));
    return drape_json_with(object, "parameters", parameters);
}

/* ---- Costs ---- */

static json_t *iteration(const cli_info *info)
{
    const drape_profile *p = &info->profile;
    json_t *object = drape_json_with(json_object(), "residual_s", drape_json_number(p->residual_seconds));
    object = drape_json_with(object, "jacobian_s", drape_json_number(p->jacobian_seconds));
    object = drape_json_with(object, "factor_s", drape_json_number(p->factor_seconds));
    object = drape_json_with(object, "solve_s", drape_json_number(p->solve_seconds));
    object = drape_json_with(object, "total_s", drape_json_number(drape_profile_seconds(p)));
    object = drape_json_with(object, "factored", json_boolean(p->implicit && !p->factor_status));
    object = drape_json_with(object, "linear_solver", json_string(p->linear_solver));
    object = drape_json_with(object, "linear_picked", json_string(p->linear_picked));
    object = drape_json_with(object, "linear_why", json_string(p->linear_why));
    return drape_json_with(object, "linear_fell_back", json_boolean(p->linear_fallback[0]));
}

static json_t *bytes(const cli_info *info)
{
    const drape_profile *p = &info->profile;
    size_t sum = drape_profile_bytes(p);
    json_t *object = drape_json_with(json_object(), "model", count((int64_t)p->model_bytes));
    object = drape_json_with(object, "meshes", count((int64_t)p->mesh_bytes));
    object = drape_json_with(object, "sparsity", count((int64_t)p->pattern_bytes));
    object = drape_json_with(object, "evaluation", count((int64_t)p->system_bytes));
    object = drape_json_with(object, "integrator", count((int64_t)p->integrator_bytes));
    object = drape_json_with(object, "state", count((int64_t)p->state_bytes));
    object = drape_json_with(object, "total", count((int64_t)sum));
    return drape_json_with(object, "a_node", drape_json_number((double)sum / info->model->node_count));
}

/* An infinite limit becomes null. */
static json_t *stability(const drape_stability *s)
{
    json_t *object = drape_json_with(json_object(), "omega", drape_json_number(s->omega));
    object = drape_json_with(object, "damping", drape_json_number(s->damping));
    object = drape_json_with(object, "limit", drape_json_number(s->limit));
    object = drape_json_with(object, "substep", drape_json_number(s->substep));
    return drape_json_with(object, "share", drape_json_number(s->substep / s->limit));
}

static json_t *with_seams(json_t *object, const drape_model *model)
{
    json_t *list = json_array();
    for (int32_t i = 0; i < model->seam_count; i++) {
        const drape_model_seam *seam = &model->seams[i];
        json_t *one = drape_json_with(json_object(), "name", drape_json_text(seam->name));
        one = drape_json_with(one, "type", json_string(model->terms[seam->term].ops->entry.name));
        one = drape_json_with(one, "pairs", count(seam->pair_count));
        for (int k = 0; k < 2; k++)
            one = drape_json_with(one, k ? "b" : "a", drape_json_text(model->cloths[seam->cloth[k]].name));
        list = drape_json_append(list, one);
    }
    return drape_json_with(object, "seams", list);
}

json_t *cli_info_json(const cli_info *info)
{
    const drape_model *model = info->model;
    cli_chosen entries[CLI_CHOSEN];
    json_t *cloths = json_array(), *terms = json_array();
    for (int32_t c = 0; c < model->cloth_count; c++)
        cloths = drape_json_append(cloths, cloth(info, c));
    for (int32_t i = 0; i < model->term_count; i++)
        terms = drape_json_append(terms, term(info, i));
    json_t *object = drape_json_with(json_object(), "scene", drape_json_text(info->path));
    object = with_keys(object, &drape_form_scene, &info->def);
    object = with_keys(object, &drape_form_output, &info->def);
    object = drape_json_with(object, "frames", count(info->frames));
    object = drape_json_with(object, "nodes", count(model->node_count));
    object = drape_json_with(object, "dofs", count(model->pattern.n));
    object = drape_json_with(object, "nnz", count(model->pattern.nonzeros));
    object = drape_json_with(object, "cloths", cloths);
    object = with_contact(object, info);
    object = with_events(object, info);
    object = with_seams(object, model);
    object = with_list(object, "histories", cli_histories_json(info));
    cli_chosen_entries(info->sim, entries);
    for (int i = 0; i < CLI_CHOSEN; i++)
        object = drape_json_with(object, entries[i].title, chosen(&entries[i], &info->sim->chosen));
    object =
        drape_json_with(object, "tolerance", drape_json_number(drape_sim_statistics(info->sim).tolerance));
    if (info->has_limit)
        object = drape_json_with(object, "stability", stability(&info->stability));
    object = drape_json_with(object, "terms", terms);
    object = drape_json_with(object, "iteration", iteration(info));
    return drape_json_with(object, "bytes", bytes(info));
}
