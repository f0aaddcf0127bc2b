/* choose.c: see choose.h. The tables of integrators and controllers are searched by the same code, so that
 * the rules are written once. */
#include "sim/choose.h"

#include "base/def.h"
#include "base/retired.h"

#include <stdio.h>
#include <string.h>

#define MAX_KEYS 256

/* An object of the scene that chooses an entry of a table. */
typedef struct choice {
    const char *pointer, *key; /* "/integrator", "method" */
    const drape_registry *registry;
    bool quiet; /* no warnings */
} choice;

/* Former methods and controllers, and those that scenes which name them are run by. */
static const struct {
    const drape_registry *registry;
    const char *name, *by;
} replaced[] = {{&drape_integrator_registry, "cvode", "ida"},
                {&drape_integrator_registry, "generalized_alpha", "bdf2"},
                {&drape_controller_registry, "iterations", "halving"}};

/* Checks a setting against every entry that has a parameter of its name; stores the value if the chosen
 * entry has one. */
static drape_status apply(drape_context *ctx, const choice *c, int chosen, const drape_setting *setting,
                          double *values)
{
    const drape_entry *entry;
    char at[128];
    bool known = false;
    snprintf(at, sizeof at, "%s/%.80s", c->pointer, setting->name);
    for (int i = 0; (entry = c->registry->entries[i]) != NULL; i++) {
        double value[DRAPE_PARAM_WIDEST];
        int p = drape_param_find(entry->params, entry->param_count, setting->name);
        if (p < 0)
            continue;
        known = true;
        drape_status status = drape_param_value(ctx, at, &entry->params[p], setting, value);
        if (status)
            return status;
        if (i == chosen)
            memcpy(values + drape_param_place(entry->params, p), value,
                   (size_t)drape_param_width(&entry->params[p]) * sizeof *value);
    }
    if (known && drape_param_find(c->registry->entries[chosen]->params,
                                  c->registry->entries[chosen]->param_count, setting->name) < 0)
        drape_retired(c->quiet ? NULL : ctx, at, c->registry->entries[chosen]->name, setting->name);
    if (known || drape_retired(c->quiet ? NULL : ctx, at, c->registry->noun, setting->name))
        return DRAPE_OK;
    const char *keys[MAX_KEYS]; /* of all entries, each once */
    size_t count = 0;
    for (int i = 0; (entry = c->registry->entries[i]) != NULL; i++)
        for (int p = 0; p < entry->param_count && count < MAX_KEYS; p++) {
            size_t k = 0;
            while (k < count && strcmp(keys[k], entry->params[p].name) != 0)
                k++;
            keys[k] = entry->params[p].name;
            count += k == count;
        }
    return drape_param_unknown(ctx, at, setting->name, keys, count);
}

static drape_status apply_all(drape_context *ctx, const choice *c, int chosen, const drape_setting *settings,
                              size_t count, double *values)
{
    drape_status status = DRAPE_OK;
    for (size_t i = 0; !status && i < count; i++)
        status = settings && settings[i].name
                     ? apply(ctx, c, chosen, &settings[i], values)
                     : drape_fail_at(ctx, DRAPE_E_ARGUMENT, c->pointer, "the name of a setting is NULL");
    return status;
}

/* The name of the entry to run by, which is another one if that of this name is gone. */
static const char *present_name(drape_context *ctx, const choice *c, const char *at, const char *name)
{
    for (size_t i = 0; i < sizeof replaced / sizeof *replaced; i++)
        if (c->registry == replaced[i].registry && strcmp(replaced[i].name, name) == 0) {
            if (!c->quiet)
                drape_log(ctx, DRAPE_LOG_WARNING, "%s: there is no \"%s\" any more; \"%s\" runs in its place",
                          at, name, replaced[i].by);
            return replaced[i].by;
        }
    return name;
}

/* Chooses by name, or else as the scene does, and applies the scene's and then the given settings. */
static drape_status choose(drape_context *ctx, const choice *c, const char *name, const drape_choice *scene,
                           const drape_setting *settings, size_t setting_count, double *values, int *chosen)
{
    char at[64];
    snprintf(at, sizeof at, "%s/%s", c->pointer, c->key);
    name = present_name(ctx, c, at, name ? name : scene->type);
    drape_status status = drape_registry_choose(ctx, c->registry, at, name, chosen);
    if (status)
        return status;
    const drape_entry *entry = c->registry->entries[*chosen];
    for (int p = 0; p < entry->param_count; p++)
        drape_param_default(&entry->params[p], values + drape_param_place(entry->params, p));
    status = apply_all(ctx, c, *chosen, scene->settings, scene->setting_count, values);
    return status ? status : apply_all(ctx, c, *chosen, settings, setting_count, values);
}

/* A positive number in the def itself, such as dt, is one more setting. */
static drape_status apply_number(drape_context *ctx, const choice *c, int chosen, const char *name,
                                 double number, double *values)
{
    if (number == 0)
        return DRAPE_OK;
    return apply(ctx, c, chosen, &(drape_setting){.name = name, .number = number}, values);
}

/* The first term with an energy of motion. */
static const char *moving_term(const drape_model *model)
{
    int32_t i = 0;
    while (!model->terms[i].ops->kinetic)
        i++;
    return model->terms[i].ops->entry.name;
}

static drape_status check_momenta(drape_context *ctx, const drape_model *model,
                                  const drape_integrator_ops *integrator)
{
    char names[256] = "";
    size_t used = 0;
    for (int i = 0; drape_integrators[i]; i++)
        if (drape_integrators[i]->momenta)
            used += (size_t)snprintf(names + used, sizeof names - used, "%s\"%s\"", used ? ", " : "",
                                     drape_integrators[i]->entry.name);
    if (!integrator->momenta)
        return drape_fail_at(ctx, DRAPE_E_ARGUMENT, "/integrator/method",
                             "\"%s\" does not step the momentum of the term \"%s\"; choose one of %s",
                             integrator->entry.name, moving_term(model), names);
    if (model->supports_move && !integrator->steady_state)
        return drape_fail_at(ctx, DRAPE_E_ARGUMENT, "/integrator/method",
                             "the term \"%s\" has momentum, which is not stepped with supports that move",
                             moving_term(model));
    return DRAPE_OK;
}

void drape_sim_def_init(drape_sim_def *def, size_t struct_size)
{
    const drape_sim_def defaults = {.struct_size = struct_size, .threads = 1};
    drape_def_fill(def, struct_size, &defaults, sizeof defaults);
}

/* The default, nearer to the motion than backward Euler at 1/60 s for about its time (docs/accuracy.md).
 * Where nothing can touch, steps of second order; with contact, where every method is of first order,
 * shorter ones that are not solved to the end. Ranks have backward Euler. */
static drape_choice usual_choice(const drape_model *model, drape_setting *dt)
{
    const bool touches = model->collider_count > 0 || model->contact.self;
    *dt = (drape_setting){.name = "dt", .number = touches ? 1.0 / 120 : 1.0 / 60};
    return (drape_choice){.type = model->part ? "be"
                                  : touches   ? "newton_k"
                                              : "bdf2",
                          .settings = dt,
                          .setting_count = !model->part};
}

drape_status drape_choose(drape_context *ctx, const drape_model *model, const drape_sim_def *def,
                          drape_chosen *chosen)
{
    drape_sim_def none;
    drape_sim_def_init(&none, sizeof none);
    const drape_sim_def *d = def ? def : &none;
    const choice integrators = {"/integrator", "method", &drape_integrator_registry, !def},
                 controllers = {"/controller", "type", &drape_controller_registry, !def};
    drape_setting dt;
    int i = 0, c = 0;
    chosen->usual = !model->integrator_named && model->integrator.setting_count == 0 && !d->integrator &&
                    d->integrator_setting_count == 0 && d->dt == 0;
    const drape_choice scene = chosen->usual ? usual_choice(model, &dt) : model->integrator;
    drape_status status = choose(ctx, &integrators, d->integrator, &scene, d->integrator_settings,
                                 d->integrator_setting_count, chosen->integrator_values, &i);
    if (!status)
        status = apply_number(ctx, &integrators, i, "dt", d->dt, chosen->integrator_values);
    if (!status)
        status = choose(ctx, &controllers, d->controller, &model->controller, d->controller_settings,
                        d->controller_setting_count, chosen->controller_values, &c);
    if (!status)
        status = apply_number(ctx, &controllers, c, "dt_min", d->dt_min, chosen->controller_values);
    if (status)
        return status;
    chosen->integrator = drape_integrators[i];
    chosen->controller = drape_controllers[c];
    if (chosen->integrator->own_steps && chosen->controller->own_steps)
        return drape_fail_at(ctx, DRAPE_E_ARGUMENT, "/controller/type",
                             "\"%s\" chooses the step size, but so does the integrator \"%s\"; choose the "
                             "controller \"halving\"",
                             chosen->controller->entry.name, chosen->integrator->entry.name);
    return DRAPE_OK;
}

/* Maxwell branches follow the steps of a method, or are relaxed where it finds an equilibrium. */
drape_status drape_chosen_check(drape_context *ctx, const drape_chosen *chosen, const drape_model *model)
{
    const drape_integrator_ops *integrator = chosen->integrator;
    if (model->has_branches && integrator->own_steps && !integrator->steady_state)
        return drape_fail_at(
            ctx, DRAPE_E_ARGUMENT, "/integrator/method",
            "\"%s\" chooses its own steps, over which Maxwell branches (\"relax.maxwell\") "
            "are not integrated to its tolerance; choose a method of fixed steps, or \"static\"",
            integrator->entry.name);
    for (int32_t c = 0; integrator->steady_state && c < model->cloth_count; c++)
        if (drape_branches_lasting(model->cloths[c].branches, model->cloths[c].branch_count) == 0)
            return drape_fail_at(
                ctx, DRAPE_E_ARGUMENT, "/integrator/method",
                "\"%s\" finds the equilibrium after an infinite time, in which nothing is left of the "
                "stiffness of %.60s: the fractions of \"relax.maxwell\" have the sum 1; below 1 a part lasts",
                integrator->entry.name, model->cloths[c].name);
    return model->has_kinetic ? check_momenta(ctx, model, integrator) : DRAPE_OK;
}

double drape_chosen_integrator_value(const drape_chosen *chosen, const char *name, double fallback)
{
    int p = drape_param_find(chosen->integrator->entry.params, chosen->integrator->entry.param_count, name);
    return p < 0 ? fallback : chosen->integrator_values[p];
}

double drape_chosen_controller_value(const drape_chosen *chosen, const char *name, double fallback)
{
    int p = drape_param_find(chosen->controller->entry.params, chosen->controller->entry.param_count, name);
    return p < 0 ? fallback : chosen->controller_values[p];
}

bool drape_chosen_ignores_integrator(const drape_chosen *chosen, const char *name)
{
    return drape_param_find(chosen->integrator->entry.params, chosen->integrator->entry.param_count, name) <
           0;
}

bool drape_chosen_ignores_controller(const drape_chosen *chosen, const char *name)
{
    return drape_param_find(chosen->controller->entry.params, chosen->controller->entry.param_count, name) <
           0;
}
