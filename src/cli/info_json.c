/* info_json.c: what a scene models and what it costs, as a JSON object. What the scene does not model has no
 * key. */
#include "cli/info.h"
#include "events/events.h"
#include "io/json.h"

#include <math.h>
#include <string.h>

static json_t *count(int64_t value)
{
    return json_integer((json_int_t)value);
}

static json_t *number(const cli_info *info, double value, const char *unit)
{
    return cli_described(info, drape_json_number(value), unit);
}

/* ---- Colliders, contact, events ---- */

/* Adds the name of an entry, what it is, and its parameters. */
static json_t *with_entry(json_t *object, const drape_entry *entry, const double *values,
                          const drape_choice *choice)
{
    object = drape_json_with(object, "type", json_string(entry->name));
    object = drape_json_with(object, "summary", json_string(entry->summary));
    return drape_json_with(object, "parameters",
                           cli_params_json(entry->params, entry->param_count, values, choice));
}

static json_t *track(const drape_track *track)
{
    json_t *keys = json_array();
    for (size_t k = 0; k < track->key_count; k++)
        keys = drape_json_append(
            keys, drape_json_append(drape_json_append(json_array(), drape_json_number(track->keys[k].time)),
                                    drape_json_numbers(track->keys[k].displacement, 3)));
    return keys;
}

static json_t *collider(const cli_info *info, int32_t c)
{
    const drape_collider *from = &info->model->colliders[c];
    const drape_collider_def *def = &info->def.colliders[c];
    json_t *object = drape_json_with(json_object(), "name", drape_json_text(from->name));
    object = with_entry(object, &from->ops->entry, from->values, &from->choice);
    object = cli_with_keys(info, object, &drape_form_collider, def);
    if (from->track.key_count > 0)
        object = drape_json_with(object, "track", track(&from->track));
    if (from->turns.key_count > 0) {
        object = drape_json_with(object, "turns",
                                 cli_forms_json(info, &drape_form_turn, def->turns, def->turn_count));
        object =
            drape_json_with(object, "pivot", cli_described(info, drape_json_numbers(from->pivot, 3), "m"));
    }
    object = drape_json_with(object, "points", count(from->shape.point_count));
    object = drape_json_with(object, "segments", count(from->shape.segment_count));
    object = drape_json_with(object, "triangles", count(from->shape.triangle_count));
    return drape_json_with(object, "nodes_inside", count(info->inside[c]));
}

static json_t *event(const cli_info *info, int32_t i)
{
    const drape_model_event *from = &info->model->events[i];
    json_t *object = drape_json_with(json_object(), "name", drape_json_text(from->name));
    object = with_entry(object, &from->ops->entry, from->values, &from->choice);
    object = cli_with_keys(info, object, &drape_form_event, &info->def.events[i]);
    return drape_json_with(object, "pinned_nodes", count(from->pinned_count));
}

/* Adds a list unless it is empty. */
static json_t *with_list(json_t *object, const char *key, json_t *list)
{
    if (json_array_size(list) > 0 || !list)
        return drape_json_with(object, key, list);
    json_decref(list);
    return object;
}

/* Of an integrator that moves nodes in place of contact forces, only the thickness acts. */
static json_t *with_contact(json_t *object, const cli_info *info)
{
    double values[DRAPE_MAX_PARAMS];
    const drape_model *model = info->model;
    const bool forces = !info->sim->chosen.integrator->projects_contact;
    json_t *colliders = json_array();
    for (int32_t c = 0; c < model->collider_count; c++)
        colliders = drape_json_append(colliders, collider(info, c));
    object = with_list(object, "colliders", colliders);
    if (forces && (model->collider_count > 0 || model->contact.self)) {
        drape_contact_values(&model->contact, values);
        object = drape_json_with(
            object, "contact",
            cli_params_json(drape_contact_params, DRAPE_CONTACT_PARAM_COUNT, values, &model->contact_choice));
    }
    if (model->contact.self) {
        drape_self_contact_values(&model->contact, values);
        object = drape_json_with(object, "self_contact",
                                 cli_params_json(drape_self_contact_params,
                                                 forces ? DRAPE_SELF_PARAM_COUNT : DRAPE_SELF_THICKNESS + 1,
                                                 values, &model->self_choice));
    }
    if (model->untangle.given) {
        drape_untangle_values(&model->untangle, values);
        object = drape_json_with(object, "untangle",
                                 cli_params_json(drape_untangle_params, DRAPE_UNTANGLE_PARAM_COUNT, values,
                                                 &model->untangle_choice));
    }
    return object;
}

static json_t *chosen(const cli_info *info, const drape_entry *entry, const double *values,
                      const drape_choice *choice,
                      bool (*ignores)(const drape_chosen *chosen, const char *name))
{
    json_t *ignored = json_array();
    for (size_t i = 0; i < choice->setting_count; i++)
        if (ignores(&info->sim->chosen, choice->settings[i].name))
            ignored = drape_json_append(ignored, drape_json_text(choice->settings[i].name));
    return drape_json_with(with_entry(json_object(), entry, values, choice), "ignored", ignored);
}

/* ---- Cloths and terms ---- */

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

static json_t *pin_json(const cli_info *info, const drape_pin *pin, const drape_pin_def *def)
{
    const drape_model *model = info->model;
    const int32_t first = pin->node_count > 0 ? pin->node[0] : -1;
    json_t *object = selected(cli_form_json(info, &drape_form_pin, def), model, pin);
    object = drape_json_with(object, "name", drape_json_text(pin->name));
    if (def->attach && first >= 0 && model->ride[first].triangle >= 0)
        object = carried(object, model, pin);
    for (int32_t i = 0; def->turn_count > 0 && i < model->moved_count; i++)
        if (model->moved_node[i] == first && model->moved_track[i] >= 0)
            object = drape_json_with(
                object, "pivot",
                cli_described(info, drape_json_numbers(model->tracks[model->moved_track[i]].pivot, 3), "m"));
    return object;
}

static json_t *pins_json(const cli_info *info, int32_t c)
{
    const drape_cloth_def *def = &info->def.cloths[c];
    const drape_pin *pin = info->model->pins;
    json_t *pins = json_array();
    for (int32_t i = 0; i < c; i++)
        pin += info->def.cloths[i].pin_count;
    for (size_t i = 0; i < def->pin_count; i++)
        pins = drape_json_append(pins, pin_json(info, &pin[i], &def->pins[i]));
    return pins;
}

/* How it starts; NULL: at rest. */
static json_t *start_json(const cli_info *info, int32_t c)
{
    const drape_scene_object *form = drape_scene_key_of(&drape_form_cloth, "start")->child;
    drape_start_def defaults = {.file = NULL};
    drape_scene_set_defaults(form, &defaults);
    json_t *object = cli_form_json(info, form, &info->def.cloths[c].start),
           *rest = cli_form_json(info, form, &defaults);
    if (json_equal(object, rest)) {
        json_decref(object);
        object = NULL;
    }
    json_decref(rest);
    return object;
}

/* The grid of a mesh with its values; NULL: it has none. The settings were valid when the model was compiled.
 */
static const drape_grid_ops *grid_of(const drape_entry_def *def, double *values)
{
    const int i = drape_registry_find(&drape_grid_registry, NULL, def->type ? def->type : "");
    drape_context *ctx = NULL;
    if (i < 0 || drape_context_create(NULL, &ctx))
        return NULL;
    const drape_grid_ops *grid = drape_grids[i];
    drape_status status = drape_params_resolve(ctx, "", grid->entry.params, grid->entry.param_count,
                                               def->settings, def->setting_count, values);
    drape_context_destroy(&ctx);
    return status ? NULL : grid;
}

/* The values of a grid, or nothing. */
static json_t *grid_json(const cli_info *info, const drape_grid_ops *grid, const double *values)
{
    return grid ? cli_values_json(info, grid->entry.params, grid->entry.param_count, values) : json_object();
}

static json_t *mesh(const cli_info *info, const drape_cloth *cloth, const drape_mesh_def *def)
{
    double values[DRAPE_MAX_PARAMS];
    const drape_grid_ops *grid = grid_of(&def->grid, values);
    json_t *object = grid_json(info, grid, values);
    if (grid)
        object = drape_json_with(object, "grid", drape_json_text(grid->entry.name));
    if (cloth->file)
        object = drape_json_with(object, "file", drape_json_text(cloth->file));
    return drape_json_with(object, "transform",
                           cli_with_keys(info, json_object(), &drape_form_transform, def));
}

static json_t *render_mesh(const cli_info *info, int32_t c)
{
    double values[DRAPE_MAX_PARAMS];
    const drape_cloth *cloth = &info->model->cloths[c];
    const drape_render_mesh_def *def = &info->def.cloths[c].render_mesh;
    json_t *object = grid_json(info, grid_of(&def->mesh.grid, values), values);
    json_t *keys = cli_form_json(info, drape_scene_key_of(&drape_form_cloth, "render_mesh")->child, def);
    const char *name;
    json_t *value;
    json_object_foreach(keys, name, value) object = drape_json_with(object, name, json_incref(value));
    json_decref(keys);
    object = drape_json_with(object, "max_distance", number(info, cloth->max_distance, "m"));
    object = drape_json_with(object, "vertices", count(cloth->render_mesh.node_count));
    return drape_json_with(object, "triangles", count(cloth->render_mesh.triangle_count));
}

/* A stiffness of a measured fabric. */
static json_t *woven(const cli_info *info, const drape_woven *w, const char *unit, const char *shear)
{
    json_t *object = drape_json_with(json_object(), "warp", number(info, w->warp, unit));
    object = drape_json_with(object, "weft", number(info, w->weft, unit));
    object = drape_json_with(object, shear, number(info, w->shear, unit));
    return drape_json_with(object, "poisson", drape_json_number(w->poisson));
}

static json_t *material(const cli_info *info, const drape_cloth *cloth)
{
    const drape_material *m = &cloth->material;
    json_t *object = cli_values_json(info, drape_material_entry.params, drape_material_entry.param_count,
                                     cloth->material_values);
    object = drape_json_with(object, "areal_density", number(info, m->areal_density, "kg/m2"));
    object = drape_json_with(object, "membrane_stiffness", number(info, m->membrane_stiffness, "N/m"));
    object = drape_json_with(object, "flexural_rigidity", number(info, m->flexural_rigidity, "N m"));
    if (cloth->tension.warp > 0)
        object = drape_json_with(object, "tension", woven(info, &cloth->tension, "N/m", "shear"));
    return cloth->bending.warp > 0
               ? drape_json_with(object, "bending", woven(info, &cloth->bending, "N m", "twist"))
               : object;
}

static json_t *cloth(const cli_info *info, int32_t c)
{
    const drape_cloth *from = &info->model->cloths[c];
    const drape_cloth_def *def = &info->def.cloths[c];
    const cli_cloth_info *more = &info->cloths[c];
    json_t *start = start_json(info, c);
    json_t *object = drape_json_with(json_object(), "name", drape_json_text(from->name));
    object = drape_json_with(object, "nodes", count(from->mesh.node_count));
    object = drape_json_with(object, "triangles", count(from->mesh.triangle_count));
    object = drape_json_with(object, "edges", count(from->mesh.edge_count));
    object = drape_json_with(object, "mesh", mesh(info, from, &def->mesh));
    object = drape_json_with(object, "mass", number(info, more->mass, "kg"));
    object = drape_json_with(object, "area", number(info, more->area, "m2"));
    object = cli_with_keys(info, object, &drape_form_cloth, def);
    object = drape_json_with(object, "pinned", count(more->pinned));
    object = drape_json_with(object, "moved", count(more->moved));
    object = drape_json_with(object, "supported", count(more->supported));
    object = with_list(object, "pins", pins_json(info, c));
    object =
        with_list(object, "masses", cli_forms_json(info, &drape_form_mass, def->masses, def->mass_count));
    object = with_list(object, "periodic",
                       cli_forms_json(info, &drape_form_periodic, def->periodic, def->periodic_count));
    if (start)
        object = drape_json_with(object, "start", start);
    if (from->bound)
        object = drape_json_with(object, "render_mesh", render_mesh(info, c));
    return drape_json_with(object, "material", material(info, from));
}

static json_t *term(const cli_info *info, int32_t i)
{
    const drape_term *from = &info->model->terms[i];
    const drape_profile_term *cost = &info->profile.terms[i];
    json_t *object = drape_json_with(json_object(), "name", json_string(from->ops->entry.name));
    object = drape_json_with(object, from->seam < 0 ? "cloth" : "seam",
                             drape_json_text(from->seam < 0 ? info->model->cloths[from->cloth].name
                                                            : info->model->seams[from->seam].name));
    if (from->ops->law)
        object = drape_json_with(object, "acts_on", count(cost->acts_on));
    object = drape_json_with(object, "element", json_string(from->ops->element_name));
    object = drape_json_with(object, "elements", count(from->elements.count));
    object = drape_json_with(object, "nodes_an_element", count(from->elements.nodes));
    object = drape_json_with(object, "nonzeros", count(cost->nonzeros));
    object = drape_json_with(object, "bytes", count((int64_t)cost->bytes));
    object = drape_json_with(object, "residual_s", drape_json_number(cost->residual_seconds));
    object = drape_json_with(object, "jacobian_s", drape_json_number(cost->jacobian_seconds));
    object = drape_json_with(object, "share",
                             drape_json_number((cost->residual_seconds + cost->jacobian_seconds) /
                                               fmax(drape_profile_seconds(&info->profile), 1e-300)));
    json_t *parameters =
        cli_params_json(from->ops->entry.params, from->ops->entry.param_count, from->params, NULL);
    if (from->history && *from->history->name)
        json_object_set_new(json_object_get(parameters, "history"), "value",
                            drape_json_text(from->history->name));
    return drape_json_with(object, "parameters", parameters);
}

/* ---- Costs ---- */

static json_t *iteration(const cli_info *info)
{
    const drape_profile *p = &info->profile;
    double outside = p->residual_seconds + p->jacobian_seconds;
    for (int32_t i = 0; i < info->model->term_count; i++)
        outside -= p->terms[i].residual_seconds + p->terms[i].jacobian_seconds;
    json_t *object = drape_json_with(json_object(), "residual_s", drape_json_number(p->residual_seconds));
    object = drape_json_with(object, "jacobian_s", drape_json_number(p->jacobian_seconds));
    object = drape_json_with(object, "factor_s", drape_json_number(p->factor_seconds));
    object = drape_json_with(object, "solve_s", drape_json_number(p->solve_seconds));
    object = drape_json_with(object, "total_s", drape_json_number(drape_profile_seconds(p)));
    object = drape_json_with(object, "outside_terms_s", drape_json_number(fmax(outside, 0)));
    object = drape_json_with(object, "implicit", json_boolean(p->implicit));
    object = drape_json_with(object, "factored", json_boolean(p->implicit && !p->factor_status));
    object = drape_json_with(object, "linear_solver", json_string(p->linear_solver));
    object = drape_json_with(object, "linear_picked", json_string(p->linear_picked));
    object = drape_json_with(object, "linear_why", json_string(p->linear_why));
    object = drape_json_with(object, "linear_fell_back", json_boolean(p->linear_fallback[0]));
    return drape_json_with(object, "linear_fallback", json_string(p->linear_fallback));
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
static json_t *stability(const cli_info *info)
{
    const drape_stability *s = &info->stability;
    json_t *object = drape_json_with(json_object(), "omega", number(info, s->omega, "rad/s"));
    object = drape_json_with(object, "damping", number(info, s->damping, "1/s"));
    object = drape_json_with(object, "limit", number(info, s->limit, "s"));
    object = drape_json_with(object, "substep", number(info, s->substep, "s"));
    object = drape_json_with(object, "share", drape_json_number(s->substep / s->limit));
    return drape_json_with(object, "stable", json_boolean(s->substep <= s->limit));
}

static json_t *seam(const drape_model *model, const drape_model_seam *from)
{
    const drape_term *term = &model->terms[from->term];
    json_t *object = drape_json_with(json_object(), "name", drape_json_text(from->name));
    object = with_entry(object, &term->ops->entry, term->params, &from->choice);
    object = drape_json_with(object, "pairs", count(from->pair_count));
    object = drape_json_with(object, "a", drape_json_text(model->cloths[from->cloth[0]].name));
    return drape_json_with(object, "b", drape_json_text(model->cloths[from->cloth[1]].name));
}

json_t *cli_info_json(const cli_info *info)
{
    const drape_model *model = info->model;
    const drape_chosen *all = &info->sim->chosen;
    json_t *cloths = json_array(), *events = json_array(), *seams = json_array(), *terms = json_array();
    for (int32_t c = 0; c < model->cloth_count; c++)
        cloths = drape_json_append(cloths, cloth(info, c));
    for (int32_t i = 0; i < model->event_count; i++)
        events = drape_json_append(events, event(info, i));
    for (int32_t i = 0; i < model->seam_count; i++)
        seams = drape_json_append(seams, seam(model, &model->seams[i]));
    for (int32_t i = 0; i < model->term_count; i++)
        terms = drape_json_append(terms, term(info, i));
    json_t *object = drape_json_with(json_object(), "scene", drape_json_text(info->path));
    object = cli_with_keys(info, object, &drape_form_scene, &info->def);
    object = cli_with_keys(info, object, &drape_form_output, &info->def);
    object = drape_json_with(object, "frames", count(info->frames));
    object = drape_json_with(object, "nodes", count(model->node_count));
    object = drape_json_with(object, "free", count(model->free_count));
    object = drape_json_with(object, "dofs", count(model->pattern.n));
    object = drape_json_with(object, "nnz", count(model->pattern.nonzeros));
    object =
        drape_json_with(object, "tolerance", number(info, drape_sim_statistics(info->sim).tolerance, "N"));
    object = drape_json_with(object, "cloths", cloths);
    object = with_contact(object, info);
    object = with_list(object, "events", events);
    object = drape_json_with(object, "seams", seams);
    object =
        with_list(object, "histories",
                  cli_forms_json(info, &drape_form_history, info->def.histories, info->def.history_count));
    object = drape_json_with(object, "integrator",
                             chosen(info, &all->integrator->entry, all->integrator_values, &model->integrator,
                                    drape_chosen_ignores_integrator));
    object = drape_json_with(object, "controller",
                             chosen(info, &all->controller->entry, all->controller_values, &model->controller,
                                    drape_chosen_ignores_controller));
    if (info->has_limit)
        object = drape_json_with(object, "stability", stability(info));
    object = drape_json_with(object, "terms", terms);
    object = drape_json_with(object, "iteration", iteration(info));
    return drape_json_with(object, "bytes", bytes(info));
}
