/* info_text.c: `drape info` as text. It does not mention what the scene does not model: every mesh has pairs
 * of neighbouring triangles, for instance, but only a term that uses them names them. */
#include "cli/info.h"
#include "events/events.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAX_LISTED  12  /* nodes that are listed by number */
#define MAX_WRITTEN 200 /* bytes of a list in a pin, masses or a start; --json has all of it */

/* ---- Scene and cloths ---- */

/* Prints the keys that have a value, except names, which are printed where they are used. defaults: a def
 * with the default values. */
static void print_keys(const char *indent, int width, const drape_scene_object *object, const void *def,
                       const void *defaults)
{
    char value[256], usual[256];
    for (size_t i = 0; i < object->key_count; i++) {
        const drape_scene_key *key = &object->keys[i];
        const bool named = key->param.kind == DRAPE_PARAM_TEXT && key->shape == DRAPE_SCENE_VALUE;
        if (key->shape > DRAPE_SCENE_LIST || named)
            continue;
        drape_scene_value_text(key, def, value, sizeof value);
        drape_make_printable(value);
        drape_scene_value_text(key, defaults, usual, sizeof usual);
        const bool has_unit = strcmp(key->param.unit, "1") != 0;
        printf("%s%-*s %s%s%s%s\n", indent, width, key->param.name, *value ? value : "none",
               has_unit && *value ? " " : "", has_unit && *value ? key->param.unit : "",
               strcmp(value, usual) == 0 ? " (default)" : "");
    }
}

static void print_scene(const cli_info *info)
{
    const drape_model *m = info->model;
    drape_scene_def defaults = {.struct_size = sizeof defaults};
    drape_scene_set_defaults(&drape_form_scene, &defaults);
    printf("scene       %s\n", CLI_SHOWN(info->path));
    print_keys("", 11, &drape_form_scene, &info->def, &defaults);
    print_keys("", 11, &drape_form_output, &info->def, &defaults);
    printf("frames      %lld\n", (long long)info->frames);
    printf("nodes       %d, %d of them free\n", (int)m->node_count, (int)m->free_count);
    printf("unknowns    %lld degrees of freedom, %lld nonzeros in their Jacobian\n", (long long)m->pattern.n,
           (long long)m->pattern.nonzeros);
}

static void print_pins(const drape_model *model, const drape_cloth *cloth, const cli_cloth_info *info)
{
    int listed = 0;
    int supported = 0, moved = 0;
    for (int32_t i = 0; i < model->support_count; i++) {
        const drape_support *support = &model->supports[i];
        if (drape_model_cloth_of(model, support->node) != cloth - model->cloths)
            continue;
        supported++;
        moved += support->track[0] >= 0 || (support->count > 1 && support->track[1] >= 0);
    }
    if (supported > 0)
        printf("  supports  %d node%s held in some directions only, %d moved\n", supported,
               supported == 1 ? "" : "s", moved);
    printf("  pins      %d node%s, %d moved", (int)info->pinned, info->pinned == 1 ? "" : "s",
           (int)info->moved);
    for (int32_t i = 0; i < cloth->mesh.node_count && listed < MAX_LISTED; i++)
        if (model->pinned[cloth->first_node + i])
            printf("%s%d", listed++ ? " " : ": ", (int)i);
    printf("%s\n", info->pinned > listed ? " ..." : "");
}

/* A value with its unit, if it is a number that has one. */
static void print_value(const drape_param *param, const double *value)
{
    char text[128];
    drape_param_value_text(param, value, text, sizeof text);
    bool has_unit = !isnan(*value) && strcmp(param->unit, "1") != 0;
    printf("%s%s%s", text, has_unit ? " " : "", has_unit ? param->unit : "");
}

static bool is_default(const drape_param *param, const double *value)
{
    bool same = true;
    for (int k = 0; k < drape_param_width(param); k++)
        same = same && (value[k] == param->default_value || (isnan(value[k]) && isnan(param->default_value)));
    return same;
}

static void print_params(const char *indent, const drape_param *params, int count, const double *values)
{
    for (int p = 0; p < count; p++) {
        if (params[p].kind == DRAPE_PARAM_TEXT) /* has no value here */
            continue;
        printf("%s%-16s ", indent, params[p].name);
        const double *value = values + drape_param_place(params, p);
        print_value(&params[p], value);
        puts(!isnan(*value) && is_default(&params[p], value) ? " (default)" : "");
    }
}

static void print_source(const drape_cloth *cloth, const drape_mesh_def *def)
{
    double values[DRAPE_MAX_PARAMS];
    drape_mesh_def defaults = {.file = NULL};
    drape_scene_set_defaults(&drape_form_mesh, &defaults);
    const drape_grid_ops *grid = cli_grid_of(&def->grid, values);
    if (cloth->file)
        printf("  file      %s\n", CLI_SHOWN(cloth->file));
    if (grid) {
        printf("  grid      %s\n", grid->entry.name);
        print_params("    ", grid->entry.params, grid->entry.param_count, values);
    }
    puts("  transform");
    print_keys("    ", 16, &drape_form_transform, def, &defaults);
}

/* A stiffness of a measured fabric; nothing for other materials. */
static void print_woven(const char *name, const char *unit, const char *shear, const drape_woven *w)
{
    if (w->warp > 0)
        printf("    %-16s %.9g, %.9g %s along warp and weft, %.9g %s, %s, Poisson's ratio %.9g\n", name,
               w->warp, w->weft, unit, w->shear, unit, shear, w->poisson);
}

static void print_material(const drape_cloth *cloth)
{
    const drape_material *m = &cloth->material;
    const struct {
        const char *name, *unit;
        double value;
    } lines[] = {{"areal density", "kg/m2", m->areal_density},
                 {"E h", "N/m, membrane stiffness", m->membrane_stiffness},
                 {"D", "N m, flexural rigidity E h^3/(12 (1 - nu^2))", m->flexural_rigidity}};
    puts("  material");
    print_params("    ", drape_material_entry.params, drape_material_entry.param_count,
                 cloth->material_values);
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++)
        printf("    %-16s %.9g %s\n", lines[i].name, lines[i].value, lines[i].unit);
    print_woven("tension", "N/m", "shear", &cloth->tension);
    print_woven("bending", "N m", "twist", &cloth->bending);
}

/* Up to MAX_WRITTEN bytes of a value. */
static void print_member(json_t *value)
{
    char *text = json_is_string(value) ? NULL : json_dumps(value, JSON_ENCODE_ANY | JSON_REAL_PRECISION(9));
    if (text)
        printf("%s%s", cli_shown((char[MAX_WRITTEN + 1]){0}, MAX_WRITTEN + 1, text),
               strlen(text) > MAX_WRITTEN ? " ..." : "");
    else if (json_is_string(value))
        fputs(CLI_SHOWN(json_string_value(value)), stdout);
    free(text);
}

/* The members of an object of a scene; those that are objects themselves below their name. */
static void print_object(const char *indent, const drape_scene_object *form, json_t *object)
{
    const char *name;
    json_t *value;
    char further[16];
    snprintf(further, sizeof further, "%s  ", indent);
    json_object_foreach(object, name, value)
    {
        const drape_scene_key *key = drape_scene_key_of(form, name);
        const bool has_unit = key && key->shape == DRAPE_SCENE_VALUE && strcmp(key->param.unit, "1") != 0;
        if (strcmp(name, "name") == 0)
            continue;
        if (json_is_object(value)) {
            printf("%s%s\n", indent, name);
            print_object(further, key->child, value);
            continue;
        }
        printf("%s%-16s ", indent, name);
        print_member(value);
        printf("%s%s\n", has_unit ? " " : "", has_unit ? key->param.unit : "");
    }
}

static void print_objects(const char *what, const drape_scene_object *form, json_t *list)
{
    for (size_t i = 0; i < json_array_size(list); i++) {
        json_t *object = json_array_get(list, i);
        const char *name = json_string_value(json_object_get(object, "name"));
        printf("  %s%s%s\n", what, name ? " " : "", name ? CLI_SHOWN(name) : "");
        print_object("    ", form, object);
    }
    json_decref(list);
}

/* An object of a cloth; NULL: nothing. */
static void print_part(const char *key, json_t *part)
{
    if (part) {
        printf("  %s\n", key);
        print_object("    ", drape_scene_key_of(&drape_form_cloth, key)->child, part);
    }
    json_decref(part);
}

static void print_cloth(const cli_info *info, int32_t c)
{
    const drape_cloth *cloth = &info->model->cloths[c];
    const drape_mesh *mesh = &cloth->mesh;
    drape_cloth_def defaults = {.name = NULL};
    drape_scene_set_defaults(&drape_form_cloth, &defaults);
    printf("\ncloth %s\n", CLI_SHOWN(cloth->name));
    printf("  mesh      %d nodes, %d triangles, %d edges", (int)mesh->node_count, (int)mesh->triangle_count,
           (int)mesh->edge_count);
    if (mesh->rows)
        printf("; a grid of %d rows and %d columns of nodes", (int)mesh->rows, (int)mesh->columns);
    putchar('\n');
    print_source(cloth, &info->def.cloths[c].mesh);
    printf("  mass      %.9g kg on %.9g m2\n", info->cloths[c].mass, info->cloths[c].area);
    print_keys("  ", 9, &drape_form_cloth, &info->def.cloths[c], &defaults);
    print_pins(info->model, cloth, &info->cloths[c]);
    print_objects("pin", &drape_form_pin, cli_pins_json(info, c));
    print_objects("masses", &drape_form_mass, cli_masses_json(info, c));
    print_objects("periodic", &drape_form_periodic, cli_periodic_json(info, c));
    print_part("start", cli_start_json(info, c));
    print_part("render_mesh", cli_render_mesh_json(info, c));
    print_material(cloth);
}

/* ---- Integrator and controller ---- */

static void print_ignored(const cli_chosen *entry, const drape_chosen *chosen)
{
    bool any = false;
    for (size_t i = 0; i < entry->choice->setting_count; i++)
        if (entry->ignores(chosen, entry->choice->settings[i].name)) {
            printf("%s %s", any ? "," : "  given but not used:", entry->choice->settings[i].name);
            any = true;
        }
    fputs(any ? "\n" : "", stdout);
}

/* Parameters that the scene gave, and those by default. */
static void print_given(const drape_param *params, int count, const double *values,
                        const drape_choice *choice)
{
    for (int p = 0; p < count; p++) {
        printf("  %-16s ", params[p].name);
        if (params[p].kind == DRAPE_PARAM_TEXT && !cli_is_given(choice, params[p].name))
            fputs(params[p].derived ? params[p].derived : "", stdout);
        else if (params[p].kind == DRAPE_PARAM_TEXT)
            fputs(CLI_SHOWN(cli_text_of(choice, params[p].name)), stdout);
        else
            print_value(&params[p], values + drape_param_place(params, p));
        puts(cli_is_given(choice, params[p].name) ? "" : " (default)");
    }
}

static void print_seam(const drape_model *model, int32_t i, const drape_seam_def *def)
{
    const drape_model_seam *seam = &model->seams[i];
    const drape_term *term = &model->terms[seam->term];
    drape_seam_def defaults = {.name = NULL};
    drape_scene_set_defaults(&drape_form_seam, &defaults);
    printf("\nseam %s: %s, %s\n", CLI_SHOWN(seam->name), term->ops->entry.name, term->ops->entry.summary);
    print_given(term->ops->entry.params, term->ops->entry.param_count, term->params, &seam->choice);
    print_keys("  ", 16, &drape_form_seam, def, &defaults);
    printf("  %-16s %d, of %s and %s\n", "pairs", (int)seam->pair_count,
           CLI_SHOWN(model->cloths[seam->cloth[0]].name), CLI_SHOWN(model->cloths[seam->cloth[1]].name));
}

static void print_chosen(const cli_chosen *entry, const drape_chosen *chosen)
{
    printf("\n%s %s: %s\n", entry->title, entry->name, entry->summary);
    print_given(entry->params, entry->param_count, entry->values, entry->choice);
    print_ignored(entry, chosen);
}

/* ---- Colliders and contact ---- */

static void print_event(const drape_model_event *event, const drape_event_def *def)
{
    drape_event_def defaults = {.name = NULL};
    drape_scene_set_defaults(&drape_form_event, &defaults);
    printf("\nevent %s: %s, %s\n", CLI_SHOWN(event->name), event->ops->entry.name, event->ops->entry.summary);
    print_given(event->ops->entry.params, event->ops->entry.param_count, event->values, &event->choice);
    print_keys("  ", 16, &drape_form_event, def, &defaults);
    if (event->pinned_count > 0)
        printf("  %-16s %d\n", "pinned nodes", (int)event->pinned_count);
}

static void print_collider(const drape_collider *collider, const drape_collider_def *def,
                           const cli_collider_info *info)
{
    const drape_collider_shape *shape = &collider->shape;
    drape_collider_def defaults = {.name = NULL};
    drape_scene_set_defaults(&drape_form_collider, &defaults);
    printf("\ncollider %s: %s, %s\n", CLI_SHOWN(collider->name), collider->ops->entry.name,
           collider->ops->entry.summary);
    print_given(collider->ops->entry.params, collider->ops->entry.param_count, collider->values,
                &collider->choice);
    print_keys("  ", 16, &drape_form_collider, def, &defaults);
    if (collider->track.key_count > 0)
        printf("  %-16s %zu keys, %.9g s to %.9g s\n", "track", collider->track.key_count,
               collider->track.keys[0].time, collider->track.keys[collider->track.key_count - 1].time);
    if (collider->turns.key_count > 0)
        printf("  %-16s %zu keys, %.9g s to %.9g s, about %.9g %.9g %.9g\n", "turns",
               collider->turns.key_count, collider->turns.keys[0].time,
               collider->turns.keys[collider->turns.key_count - 1].time, collider->pivot[0],
               collider->pivot[1], collider->pivot[2]);
    printf("  %-16s %d points, %d segments, %d triangles\n", "features", (int)shape->point_count,
           (int)shape->segment_count, (int)shape->triangle_count);
    if (info->inside)
        printf("  %d node%s of the cloth start%s inside of it\n", (int)info->inside,
               info->inside == 1 ? "" : "s", info->inside == 1 ? "s" : "");
}

static void print_contact(const drape_sim *sim)
{
    cli_contact_entries contact;
    cli_contact(sim, &contact);
    for (int i = 0; i < contact.count; i++) {
        const cli_chosen *entry = &contact.entries[i];
        printf("\n%s\n", entry->title);
        print_given(entry->params, entry->param_count, entry->values, entry->choice);
    }
}

/* ---- Terms ---- */

static void print_term(const cli_info *info, int32_t i)
{
    const drape_term *term = &info->model->terms[i];
    const drape_profile_term *cost = &info->profile.terms[i];
    printf("  %-20s of %s: ", term->ops->entry.name, CLI_SHOWN(cli_owner(info->model, term)));
    if (term->ops->law)
        printf("acts on %lld strain measures; its time is counted with theirs", (long long)cost->acts_on);
    else
        printf("%d %s elements of %d node%s", (int)term->elements.count, term->ops->element_name,
               term->elements.nodes, term->elements.nodes == 1 ? "" : "s");
    for (int p = 0; p < term->ops->entry.param_count; p++) {
        const double *value = term->params + drape_param_place(term->ops->entry.params, p);
        if (term->ops->entry.params[p].kind == DRAPE_PARAM_TEXT)
            continue;
        printf("; %s ", term->ops->entry.params[p].name);
        print_value(&term->ops->entry.params[p], value);
        fputs(is_default(&term->ops->entry.params[p], value) ? " (default)" : "", stdout);
    }
    if (term->history && *term->history->name)
        printf("; history %s", CLI_SHOWN(term->history->name));
    fputc('\n', stdout);
}

static void print_terms(const cli_info *info)
{
    puts("\nterms");
    for (int32_t i = 0; i < info->model->term_count; i++)
        print_term(info, i);
    if (info->model->term_count == 0)
        puts("  none: the nodes keep their velocities");
}

/* ---- Costs ---- */

static void print_count(long long count)
{
    if (count)
        printf(" %10lld", count);
    else
        printf(" %10s", "-");
}

static void print_time(double seconds)
{
    if (seconds > 0)
        printf(" %12.2f", 1e6 * seconds);
    else
        printf(" %12s", "-");
}

static void print_cost(const cli_info *info, const char *name, const char *cloth, long long nonzeros,
                       long long bytes, double residual, double jacobian)
{
    printf("  %-20s %-10s", name, cli_shown((char[11]){0}, 11, cloth));
    print_count(nonzeros);
    print_count(bytes);
    print_time(residual);
    print_time(jacobian);
    printf(" %6.1f %%\n", 100 * cli_share(info, residual + jacobian));
}

static void print_solver(const cli_info *info)
{
    const drape_profile *p = &info->profile;
    const struct {
        const char *name;
        double seconds;
    } parts[] = {{"factor", p->factor_seconds}, {"solve", p->solve_seconds}};
    for (size_t i = 0; p->implicit && i < sizeof parts / sizeof *parts; i++)
        printf("  %-20s %-10.10s %10s %10s %12s %12.2f %6.1f %%\n", parts[i].name, p->linear_picked, "-", "-",
               "-", 1e6 * parts[i].seconds, 100 * cli_share(info, parts[i].seconds));
    if (p->linear_why[0])
        printf("  linear_solver %s picks %s: %s\n", p->linear_solver, p->linear_picked, p->linear_why);
    if (p->linear_fallback[0])
        printf("  the Jacobian of the measured state is not suited to %s: %s factors it\n", p->linear_picked,
               p->linear_fallback);
    if (p->factor_status)
        puts("  the Jacobian of the measured state could not be factored: the cost of a step is not known");
}

static void print_costs(const cli_info *info)
{
    const drape_profile *p = &info->profile;
    printf("\n%s, measured\n", p->implicit ? "cost of one Newton iteration" : "cost of one evaluation");
    printf("  %-20s %-10s %10s %10s %12s %12s %8s\n", "part", "cloth", "nonzeros", "bytes", "residual us",
           "Jacobian us", "share");
    for (int32_t i = 0; i < info->model->term_count; i++) {
        const drape_term *term = &info->model->terms[i];
        const drape_profile_term *cost = &p->terms[i];
        print_cost(info, term->ops->entry.name, cli_owner(info->model, term), cost->nonzeros,
                   (long long)cost->bytes, cost->residual_seconds, cost->jacobian_seconds);
    }
    print_cost(info, "masses, clearing", "", p->implicit ? info->model->pattern.n : 0,
               (long long)info->model->node_count * (long long)sizeof(double),
               cli_other_residual_seconds(info), cli_other_jacobian_seconds(info));
    print_solver(info);
    printf("  %-20s %10s %10lld %10s %25.2f %6.1f %%\n", "together", "",
           (long long)info->model->pattern.nonzeros, "", 1e6 * drape_profile_seconds(p), 100.0);
}

static void print_bytes(const cli_info *info)
{
    const drape_profile *p = &info->profile;
    const struct {
        const char *name;
        size_t bytes;
    } parts[] = {{"model", p->model_bytes},
                 {"meshes", p->mesh_bytes},
                 {"sparsity", p->pattern_bytes},
                 {"evaluation", p->system_bytes},
                 {"integrator, factors included", p->integrator_bytes},
                 {"state", p->state_bytes}};
    size_t sum = drape_profile_bytes(p);
    puts("\nmemory");
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++)
        printf("  %-30s %12zu bytes\n", parts[i].name, parts[i].bytes);
    printf("  %-30s %12zu bytes, %.0f a node\n", "together", sum, (double)sum / info->model->node_count);
}

static void print_stability(const cli_info *info)
{
    const drape_stability *s = &info->stability;
    if (!info->has_limit)
        return;
    puts("\nstability, at the start");
    printf("  fastest wave     %.6g rad/s", s->omega);
    if (s->damping > 0)
        printf(", damping rates up to %.6g 1/s", s->damping);
    printf("\n  stable below     %.6g s a substep\n", s->limit);
    printf("  this scene's     %.6g s a substep, %.3g of the limit%s\n", s->substep, s->substep / s->limit,
           s->substep > s->limit ? ": IT WILL BLOW UP" : "");
}

void cli_info_text(const cli_info *info)
{
    cli_chosen entries[CLI_CHOSEN];
    print_scene(info);
    for (int32_t c = 0; c < info->model->cloth_count; c++)
        print_cloth(info, c);
    for (int32_t c = 0; c < info->model->collider_count; c++)
        print_collider(&info->model->colliders[c], &info->def.colliders[c], &info->colliders[c]);
    print_contact(info->sim);
    for (int32_t i = 0; i < info->model->event_count; i++)
        print_event(&info->model->events[i], &info->def.events[i]);
    for (int32_t i = 0; i < info->model->seam_count; i++)
        print_seam(info->model, i, &info->def.seams[i]);
    if (info->def.history_count > 0)
        puts("\nhistories");
    print_objects("history", &drape_form_history, cli_histories_json(info));
    cli_chosen_entries(info->sim, entries);
    for (int i = 0; i < CLI_CHOSEN; i++)
        print_chosen(&entries[i], &info->sim->chosen);
    const double tolerance = drape_sim_statistics(info->sim).tolerance;
    if (!isnan(tolerance))
        printf("\nsteps are solved to a residual of %.4g N on a node of mean mass\n", tolerance);
    print_stability(info);
    print_terms(info);
    print_costs(info);
    print_bytes(info);
}
