/* choose.c: see choose.h. Both tables are walked through the same view, so that the rules are written once.
 */
#include "sim/choose.h"

#include <stdio.h>
#include <string.h>

#define MAX_KEYS 256

/* A table of rows, seen as names and parameter lists. */
typedef struct table {
    const char *pointer, *key; /* "/integrator", "method" */
    int count;
    const char *names[32];
    const drape_param *params[32];
    int param_counts[32];
} table;

static table integrator_table(void)
{
    table t = {.pointer = "/integrator", .key = "method"};
    for (; drape_integrators[t.count]; t.count++) {
        t.names[t.count] = drape_integrators[t.count]->entry.name;
        t.params[t.count] = drape_integrators[t.count]->entry.params;
        t.param_counts[t.count] = drape_integrators[t.count]->entry.param_count;
    }
    return t;
}

static table controller_table(void)
{
    table t = {.pointer = "/controller", .key = "type"};
    for (; drape_controllers[t.count]; t.count++) {
        t.names[t.count] = drape_controllers[t.count]->entry.name;
        t.params[t.count] = drape_controllers[t.count]->entry.params;
        t.param_counts[t.count] = drape_controllers[t.count]->entry.param_count;
    }
    return t;
}

static drape_status find_row(drape_context *ctx, const table *t, const char *name, int *row)
{
    char at[64];
    for (*row = 0; *row < t->count; (*row)++)
        if (strcmp(t->names[*row], name) == 0)
            return DRAPE_OK;
    const char *meant = drape_did_you_mean(name, t->names, (size_t)t->count);
    snprintf(at, sizeof at, "%s/%s", t->pointer, t->key);
    return drape_fail_at(ctx, DRAPE_E_ARGUMENT, at, "there is no %s \"%.60s\"%s%s%s; `drape list` shows all",
                         t->pointer + 1, name, DRAPE_MEANT(meant));
}

static drape_status unknown_key(drape_context *ctx, const table *t, const char *at, const char *name)
{
    const char *keys[MAX_KEYS];
    size_t count = 0;
    for (int r = 0; r < t->count; r++)
        for (int p = 0; p < t->param_counts[r] && count < MAX_KEYS; p++)
            keys[count++] = t->params[r][p].name;
    const char *meant = drape_did_you_mean(name, keys, count);
    return drape_fail_at(ctx, DRAPE_E_ARGUMENT, at, "unknown key \"%.60s\"%s%s%s", name, DRAPE_MEANT(meant));
}

/* Checks a setting against every row that has a parameter of its name; keeps the value for the chosen row. */
static drape_status apply(drape_context *ctx, const table *t, int row, const drape_setting *setting,
                          double *values)
{
    char at[128];
    bool known = false;
    snprintf(at, sizeof at, "%s/%.80s", t->pointer, setting->name);
    for (int r = 0; r < t->count; r++) {
        double value[DRAPE_PARAM_WIDEST];
        int p = drape_param_find(t->params[r], t->param_counts[r], setting->name);
        if (p < 0)
            continue;
        known = true;
        drape_status status = drape_param_value(ctx, at, &t->params[r][p], setting, value);
        if (status)
            return status;
        if (r == row)
            memcpy(values + drape_param_place(t->params[r], p), value,
                   (size_t)drape_param_width(&t->params[r][p]) * sizeof *value);
    }
    return known ? DRAPE_OK : unknown_key(ctx, t, at, setting->name);
}

static drape_status apply_all(drape_context *ctx, const table *t, int row, const drape_setting *settings,
                              size_t count, double *values)
{
    drape_status status = DRAPE_OK;
    for (size_t i = 0; !status && i < count; i++)
        status = settings && settings[i].name
                     ? apply(ctx, t, row, &settings[i], values)
                     : drape_fail_at(ctx, DRAPE_E_ARGUMENT, t->pointer, "the name of a setting is NULL");
    return status;
}

static drape_status choose(drape_context *ctx, const table *t, const char *name, const drape_choice *scene,
                           const drape_setting *settings, size_t setting_count, double *values, int *row)
{
    drape_status status = find_row(ctx, t, name ? name : scene->type, row);
    if (status)
        return status;
    for (int p = 0; p < t->param_counts[*row]; p++)
        drape_param_default(&t->params[*row][p], values + drape_param_place(t->params[*row], p));
    status = apply_all(ctx, t, *row, scene->settings, scene->setting_count, values);
    return status ? status : apply_all(ctx, t, *row, settings, setting_count, values);
}

/* A positive number of the def itself, such as dt, is one more setting. */
static drape_status apply_number(drape_context *ctx, const table *t, int row, const char *name, double number,
                                 double *values)
{
    if (number == 0)
        return DRAPE_OK;
    return apply(ctx, t, row, &(drape_setting){.name = name, .number = number}, values);
}

drape_status drape_choose(drape_context *ctx, const drape_model *model, const drape_sim_def *def,
                          drape_chosen *chosen)
{
    const table integrators = integrator_table(), controllers = controller_table();
    drape_sim_def none;
    drape_sim_def_init(&none, sizeof none);
    const drape_sim_def *d = def ? def : &none;
    int i = 0, c = 0;
    drape_status status = choose(ctx, &integrators, d->integrator, &model->integrator, d->integrator_settings,
                                 d->integrator_setting_count, chosen->integrator_values, &i);
    if (!status)
        status = apply_number(ctx, &integrators, i, "dt", d->dt, chosen->integrator_values);
    if (!status)
        status = choose(ctx, &controllers, d->controller, &model->controller, d->controller_settings,
                        d->controller_setting_count, chosen->controller_values, &c);
    if (!status)
        status = apply_number(ctx, &controllers, c, "dt_min", d->dt_min, chosen->controller_values);
    chosen->integrator = drape_integrators[i];
    chosen->controller = drape_controllers[c];
    if (!status && chosen->integrator->own_steps && chosen->controller->own_steps)
        status = drape_fail_at(ctx, DRAPE_E_ARGUMENT, "/controller/type",
                               "\"%s\" chooses steps, and so does the integrator \"%s\"; take \"halving\"",
                               chosen->controller->entry.name, chosen->integrator->entry.name);
    return status;
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
