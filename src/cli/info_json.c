/* info_json.c: `drape info --json`. As in info_text.c, nothing has a key that the scene does not model.
 *
 * jansson refuses to set a value that is NULL and passes NULL on, so a failed allocation anywhere below ends
 * as a NULL at the top. */
#include "cli/info.h"

#include <math.h>
#include <string.h>

/* Takes both references. The container, or NULL if it or the value is not there. */
static json_t *with(json_t *object, const char *key, json_t *value)
{
    if (json_object_set_new(object, key, value) == 0)
        return object;
    json_decref(object);
    return NULL;
}

static json_t *and_also(json_t *array, json_t *value)
{
    if (json_array_append_new(array, value) == 0)
        return array;
    json_decref(array);
    return NULL;
}

static json_t *number(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

static json_t *count(int64_t value)
{
    return json_integer((json_int_t)value);
}

/* A name from a scene is UTF-8; a path need not be. */
static json_t *text(const char *bytes)
{
    json_t *string = json_string(bytes);
    return string ? string : json_string("(not UTF-8)");
}

static json_t *vector(const double v[3])
{
    return and_also(and_also(and_also(json_array(), number(v[0])), number(v[1])), number(v[2]));
}

/* ---- Parameters ---- */

/* choice: gives the texts; NULL: there are none. */
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
        return text(choice ? cli_text_of(choice, param->name) : "");
    case DRAPE_PARAM_NUMBER:
    case DRAPE_PARAM_INTEGER:
        break;
    }
    return param->kind == DRAPE_PARAM_INTEGER ? count((int64_t)*value) : number(*value);
}

static json_t *params_of(const drape_param *params, int param_count, const double *values,
                         const drape_choice *choice)
{
    json_t *object = json_object();
    for (int p = 0; p < param_count; p++) {
        json_t *one =
            with(json_object(), "value", value_of(&params[p], values + drape_param_place(params, p), choice));
        one = with(one, "unit", json_string(params[p].unit));
        if (choice)
            one = with(one, "default", json_boolean(!cli_is_given(choice, params[p].name)));
        object = with(object, params[p].name, one);
    }
    return object;
}

static json_t *numbers(const double *values, size_t count)
{
    json_t *array = json_array();
    for (size_t i = 0; i < count; i++)
        array = and_also(array, number(values[i]));
    return array;
}

/* NULL where none is given. */
static json_t *key_value(const drape_scene_key *key, const void *def)
{
    const char *const *texts;
    drape_setting value;
    if (key->shape == DRAPE_SCENE_LIST) {
        json_t *array = json_array();
        for (size_t i = 0, count = drape_scene_texts(key, def, &texts); i < count; i++)
            array = and_also(array, text(texts[i]));
        return array;
    }
    if (!drape_scene_value(key, def, &value))
        return NULL;
    if (value.vector)
        return numbers(value.vector, value.vector_count);
    return value.text ? text(value.text) : value_of(&key->param, &value.number, NULL);
}

/* Keys that have values of their own; a name stands where it is used. */
static json_t *with_keys(json_t *object, const drape_scene_object *form, const void *def)
{
    for (size_t i = 0; i < form->key_count; i++) {
        const drape_scene_key *key = &form->keys[i];
        const bool named = key->param.kind == DRAPE_PARAM_TEXT && key->shape == DRAPE_SCENE_VALUE;
        if (key->shape <= DRAPE_SCENE_LIST && !named)
            object = with(object, key->param.name, key_value(key, def));
    }
    return object;
}

static json_t *track(const drape_track *track)
{
    json_t *keys = json_array();
    for (size_t k = 0; k < track->key_count; k++)
        keys = and_also(keys, and_also(and_also(json_array(), number(track->keys[k].time)),
                                       vector(track->keys[k].displacement)));
    return keys;
}

static json_t *collider(const drape_collider *from, const drape_collider_def *def,
                        const cli_collider_info *info)
{
    json_t *object = with(json_object(), "name", text(from->name));
    object = with(object, "type", json_string(from->ops->entry.name));
    object =
        with(object, "parameters",
             params_of(from->ops->entry.params, from->ops->entry.param_count, from->values, &from->choice));
    object = with_keys(object, &drape_form_collider, def);
    if (from->track.key_count > 0)
        object = with(object, "track", track(&from->track));
    object = with(object, "points", count(from->shape.point_count));
    object = with(object, "segments", count(from->shape.segment_count));
    object = with(object, "triangles", count(from->shape.triangle_count));
    return with(object, "nodes_inside", count(info->inside));
}

static json_t *with_contact(json_t *object, const cli_info *info)
{
    cli_contact_entries contact;
    json_t *colliders = json_array();
    for (int32_t c = 0; c < info->model->collider_count; c++)
        colliders = and_also(
            colliders, collider(&info->model->colliders[c], &info->def.colliders[c], &info->colliders[c]));
    if (info->model->collider_count > 0)
        object = with(object, "colliders", json_incref(colliders));
    json_decref(colliders);
    cli_contact(info->sim, &contact);
    for (int i = 0; i < contact.count; i++) {
        const cli_chosen *entry = &contact.entries[i];
        object = with(object, entry->title,
                      params_of(entry->params, entry->param_count, entry->values, entry->choice));
    }
    return object;
}

static json_t *chosen(const cli_chosen *entry, const drape_chosen *all)
{
    json_t *ignored = json_array();
    for (size_t i = 0; i < entry->choice->setting_count; i++)
        if (entry->ignores(all, entry->choice->settings[i].name))
            ignored = and_also(ignored, text(entry->choice->settings[i].name));
    json_t *object = with(json_object(), "type", json_string(entry->name));
    object = with(object, "parameters",
                  params_of(entry->params, entry->param_count, entry->values, entry->choice));
    return with(object, "ignored", ignored);
}

/* ---- Cloths and terms ---- */

/* The values of a parameter list, choices and booleans in words. */
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
            object = with(object, params[p].name, spoken ? text(words) : value_of(&params[p], value, NULL));
    }
    return object;
}

static json_t *mesh(const drape_cloth *cloth, const drape_mesh_def *def)
{
    double values[DRAPE_MAX_PARAMS];
    const drape_grid_ops *grid = cli_grid_of(cloth, values);
    json_t *object = grid ? values_of(grid->entry.params, grid->entry.param_count, values) : json_object();
    if (grid)
        object = with(object, "grid", text(grid->entry.name));
    if (cloth->file)
        object = with(object, "file", text(cloth->file));
    return with(object, "transform", with_keys(json_object(), &drape_form_transform, def));
}

/* A stiffness of a measured fabric. */
static json_t *woven(const drape_woven *w, const char *shear)
{
    json_t *object = with(with(json_object(), "warp", number(w->warp)), "weft", number(w->weft));
    return with(with(object, shear, number(w->shear)), "poisson", number(w->poisson));
}

static json_t *material(const drape_cloth *cloth)
{
    const drape_material *m = &cloth->material;
    json_t *object =
        values_of(drape_material_entry.params, drape_material_entry.param_count, cloth->material_values);
    object = with(object, "areal_density", number(m->areal_density));
    object = with(object, "membrane_stiffness", number(m->membrane_stiffness));
    object = with(object, "flexural_rigidity", number(m->flexural_rigidity));
    if (cloth->tension.warp > 0)
        object = with(object, "tension", woven(&cloth->tension, "shear"));
    return cloth->bending.warp > 0 ? with(object, "bending", woven(&cloth->bending, "twist")) : object;
}

static json_t *cloth(const cli_info *info, int32_t c)
{
    const drape_cloth *from = &info->model->cloths[c];
    const cli_cloth_info *more = &info->cloths[c];
    json_t *object = with(json_object(), "name", text(from->name));
    object = with(object, "nodes", count(from->mesh.node_count));
    object = with(object, "triangles", count(from->mesh.triangle_count));
    object = with(object, "edges", count(from->mesh.edge_count));
    object = with(object, "mass", number(more->mass));
    object = with(object, "area", number(more->area));
    object = with(object, "pinned", count(more->pinned));
    object = with(object, "moved", count(more->moved));
    object = with_keys(object, &drape_form_cloth, &info->def.cloths[c]);
    object = with(object, "mesh", mesh(from, &info->def.cloths[c].mesh));
    return with(object, "material", material(from));
}

static json_t *term(const cli_info *info, int32_t i)
{
    const drape_term *from = &info->model->terms[i];
    const drape_profile_term *cost = &info->profile.terms[i];
    json_t *object = with(json_object(), "name", json_string(from->ops->entry.name));
    object = with(object, "cloth", text(info->model->cloths[from->cloth].name));
    if (from->ops->law)
        object = with(object, "acts_on", count(cost->acts_on));
    object = with(object, "element", json_string(from->ops->element_name));
    object = with(object, "elements", count(from->elements.count));
    object = with(object, "nodes_an_element", count(from->elements.nodes));
    object = with(object, "nonzeros", count(cost->nonzeros));
    object = with(object, "bytes", count((int64_t)cost->bytes));
    object = with(object, "residual_s", number(cost->residual_seconds));
    object = with(object, "jacobian_s", number(cost->jacobian_seconds));
    object = with(object, "share", number(cli_share(info, cost->residual_seconds + cost->jacobian_seconds)));
    return with(object, "parameters",
                params_of(from->ops->entry.params, from->ops->entry.param_count, from->params, NULL));
}

/* ---- Costs ---- */

static json_t *iteration(const cli_info *info)
{
    const drape_profile *p = &info->profile;
    json_t *object = with(json_object(), "residual_s", number(p->residual_seconds));
    object = with(object, "jacobian_s", number(p->jacobian_seconds));
    object = with(object, "factor_s", number(p->factor_seconds));
    object = with(object, "solve_s", number(p->solve_seconds));
    object = with(object, "total_s", number(drape_profile_seconds(p)));
    object = with(object, "factored", json_boolean(p->implicit && !p->factor_status));
    object = with(object, "linear_solver", json_string(p->linear_solver));
    object = with(object, "linear_picked", json_string(p->linear_picked));
    object = with(object, "linear_why", json_string(p->linear_why));
    return with(object, "linear_fell_back", json_boolean(p->linear_fallback[0]));
}

static json_t *bytes(const cli_info *info)
{
    const drape_profile *p = &info->profile;
    size_t sum = drape_profile_bytes(p);
    json_t *object = with(json_object(), "model", count((int64_t)p->model_bytes));
    object = with(object, "meshes", count((int64_t)p->mesh_bytes));
    object = with(object, "sparsity", count((int64_t)p->pattern_bytes));
    object = with(object, "evaluation", count((int64_t)p->system_bytes));
    object = with(object, "integrator", count((int64_t)p->integrator_bytes));
    object = with(object, "state", count((int64_t)p->state_bytes));
    object = with(object, "total", count((int64_t)sum));
    return with(object, "a_node", number((double)sum / info->model->node_count));
}

/* A limit that is infinite is null. */
static json_t *stability(const drape_stability *s)
{
    json_t *object = with(json_object(), "omega", number(s->omega));
    object = with(object, "damping", number(s->damping));
    object = with(object, "limit", number(s->limit));
    object = with(object, "substep", number(s->substep));
    return with(object, "share", number(s->substep / s->limit));
}

json_t *cli_info_json(const cli_info *info)
{
    const drape_model *model = info->model;
    cli_chosen entries[CLI_CHOSEN];
    json_t *cloths = json_array(), *terms = json_array();
    for (int32_t c = 0; c < model->cloth_count; c++)
        cloths = and_also(cloths, cloth(info, c));
    for (int32_t i = 0; i < model->term_count; i++)
        terms = and_also(terms, term(info, i));
    json_t *object = with(json_object(), "scene", text(info->path));
    object = with_keys(object, &drape_form_scene, &info->def);
    object = with_keys(object, &drape_form_output, &info->def);
    object = with(object, "frames", count(info->frames));
    object = with(object, "nodes", count(model->node_count));
    object = with(object, "dofs", count(model->pattern.n));
    object = with(object, "nnz", count(model->pattern.nonzeros));
    object = with(object, "cloths", cloths);
    object = with_contact(object, info);
    cli_chosen_entries(info->sim, entries);
    for (int i = 0; i < CLI_CHOSEN; i++)
        object = with(object, entries[i].title, chosen(&entries[i], &info->sim->chosen));
    if (info->has_limit)
        object = with(object, "stability", stability(&info->stability));
    object = with(object, "terms", terms);
    object = with(object, "iteration", iteration(info));
    return with(object, "bytes", bytes(info));
}
