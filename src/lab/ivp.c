/*
 * ivp: every integrator over its dt or rtol on scenes of the test set, compared with their references
 * (ivp.h). The residual that Newton's method may leave falls with dt as fast as the error of the method
 * does. Errors are relative to the size of the scene, and taken at times at which steps end.
 */
#include "lab/ivp.h"
#include "base/param.h"
#include "control/control.h"
#include "lab/figure.h"
#include "lab/statistics.h"
#include "lab/text.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RESOLVED    10.0 /* times the reference's error: smaller errors cannot be distinguished from it */
#define LARGEST     0.1  /* of the size: larger errors have no order */
#define BASE_METHOD "be"
#define LEVELS      11 /* of dt */
#define MAX_SERIES  64 /* of a scene */
#define MAX_POINTS  16 /* of a series */

/* Ranks of dt = interval/2^k: a few points over all of the range first. */
static const int dt_ranks[LEVELS] = {6, 2, 5, 0, 4, 1, 5, 3, 6, 4, 7};
static const struct {
    double rtol;
    int rank;
} rtols[] = {{1e-2, 2}, {1e-3, 0}, {1e-4, 3}, {1e-5, 1}, {1e-6, 5}, {1e-7, 4}, {1e-8, 6}, {1e-9, 7}},
  controlled[] = {{1e-3, 8}, {1e-4, 9}, {1e-5, 8}, {1e-6, 9}};

/* The scenes while the program runs; a merge has none. */
typedef struct set {
    lab_ivp *scenes;
    size_t count;
    size_t *of; /* the scene of a case */
} set;

/* ---- The cases ---- */

static drape_status add(lab *l, size_t scene, const char *series, const drape_integrator_ops *integrator,
                        const char *knob, double value, int rank, json_t *more)
{
    set *own = l->own;
    const size_t index = json_array_size(l->cases);
    const lab_ivp *s = &own->scenes[scene];
    char pointer[64];
    snprintf(pointer, sizeof pointer, "/%s", knob);
    json_t *settings = json_pack("{s:s, s:f}", "/integrator/method", integrator->entry.name, pointer, value);
    json_t *tags = json_pack("{s:s, s:s, s:s, s:s, s:f}", "scene", s->name, "series", series, "integrator",
                             integrator->entry.name, "knob", strrchr(knob, '/') + 1, "value", value);
    json_object_update(settings, more);
    json_decref(more);
    size_t *of = drape_arena_resize(&l->arena, own->of, index + 1, sizeof *of);
    drape_status status = lab_add_case(l, tags, settings, -1);
    if (status || !of)
        return status ? status : DRAPE_E_MEMORY;
    own->of = of;
    of[index] = scene;
    lab_rank_case(l, 2 * rank + (integrator->stability != NULL));
    return DRAPE_OK;
}

/* Integrators that choose their steps, at every order that they are limited to. */
static drape_status add_own_steps(lab *l, size_t scene, const drape_integrator_ops *integrator)
{
    int limits[2];
    drape_status status = DRAPE_OK;
    const size_t count = lab_order_limits(l, integrator, limits);
    for (size_t k = 0; k < count; k++) {
        char series[96];
        lab_name_series(integrator, limits[k], series, sizeof series);
        for (size_t i = 0; !status && i < sizeof rtols / sizeof *rtols; i++)
            status = add(l, scene, series, integrator, "integrator/rtol", rtols[i].rtol, rtols[i].rank,
                         limits[k] ? json_pack("{s:i}", "/integrator/max_order", limits[k]) : json_object());
    }
    return status;
}

static json_t *tolerance_of(const lab_ivp *s, const drape_integrator_ops *integrator, double dt)
{
    const drape_entry *entry = &integrator->entry;
    return drape_param_find(entry->params, entry->param_count, "tolerance") < 0
               ? json_object()
               : json_pack("{s:f}", "/integrator/tolerance", lab_ivp_tolerance(s, integrator->order, dt));
}

/* Others: over dt, and under each controller that bounds an error, whose steps begin with a 64th of an
 * interval. */
static drape_status add_fixed(lab *l, size_t scene, const drape_integrator_ops *integrator)
{
    const lab_ivp *s = &((set *)l->own)->scenes[scene];
    drape_status status = DRAPE_OK;
    for (int k = 0; !status && k < LEVELS; k++) {
        const double dt = ldexp(s->interval, -k);
        status = add(l, scene, integrator->entry.name, integrator, "integrator/dt", dt, dt_ranks[k],
                     tolerance_of(s, integrator, dt));
    }
    for (int c = 0; drape_controllers[c] && !integrator->stability; c++) {
        const drape_controller_ops *controller = drape_controllers[c];
        char series[96];
        if (drape_param_find(controller->entry.params, controller->entry.param_count, "rtol") < 0)
            continue;
        snprintf(series, sizeof series, "%s, %s control", integrator->entry.name, controller->entry.name);
        for (size_t i = 0; !status && i < sizeof controlled / sizeof *controlled; i++) {
            /* The local error is of order p + 1 in the step that the controller takes. */
            const double h = pow(controlled[i].rtol, 1.0 / (integrator->order + 1)) * s->interval;
            json_t *more = tolerance_of(s, integrator, fmin(h, s->interval));
            json_object_set_new(more, "/controller/type", json_string(controller->entry.name));
            json_object_set_new(more, "/integrator/dt", json_real(s->interval / 64));
            status = add(l, scene, series, integrator, "controller/rtol", controlled[i].rtol,
                         controlled[i].rank, more);
        }
    }
    return status;
}

static drape_status add_scene(lab *l, size_t scene)
{
    drape_status status = DRAPE_OK;
    for (int i = 0; !status && drape_integrators[i]; i++) {
        const drape_integrator_ops *integrator = drape_integrators[i];
        if (!lab_wants_integrator(l, integrator->entry.name, true) ||
            !lab_ivp_admits(&((set *)l->own)->scenes[scene], integrator))
            continue;
        status =
            integrator->own_steps ? add_own_steps(l, scene, integrator) : add_fixed(l, scene, integrator);
    }
    return status;
}

/* What the report says of a scene besides its cases, and what makes results comparable. */
static json_t *describe_scene(const lab_ivp *s)
{
    json_t *about =
        json_pack("{s:s, s:s, s:f, s:f, s:f}", "name", s->name, "hash", s->hash, "size_m", s->size,
                  "duration_s", s->times[s->time_count - 1], "reference_error", s->error);
    json_t *horizon = lab_ivp_read_horizon(s);
    static const char *const keys[] = {"horizon_s", "t_s", "growth"};
    for (size_t i = 0; horizon && i < sizeof keys / sizeof *keys; i++)
        json_object_set(about, keys[i], json_object_get(horizon, keys[i]));
    json_decref(horizon);
    return about;
}

static drape_status open_scene(lab *l, const char *path, lab_ivp *s)
{
    drape_status status = lab_ivp_open(&l->arena, path, s);
    if (!status)
        status = lab_ivp_read_reference(s);
    lab_ivp_close(s); /* cases compile their own */
    return status;
}

static drape_status plan(lab *l)
{
    const size_t count = l->def->scene_count ? l->def->scene_count : 1;
    set *own = l->own = drape_arena_take(&l->arena, 1, sizeof *own);
    drape_status status = lab_check_integrators(l);
    if (own)
        own->scenes = drape_arena_take(&l->arena, count, sizeof *own->scenes);
    if (!own || !own->scenes)
        return DRAPE_E_MEMORY;
    if (!status && l->def->setting_count)
        status = drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                            "ivp takes no settings: the references are of the scenes as they are");
    json_t *scenes = json_array();
    for (size_t i = 0; !status && i < count; i++) {
        status = open_scene(l, l->def->scene_count ? l->def->scenes[i] : l->def->scene, &own->scenes[i]);
        for (size_t k = 0; !status && k < i; k++)
            if (strcmp(own->scenes[i].name, own->scenes[k].name) == 0)
                status = drape_fail(l->ctx, DRAPE_E_ARGUMENT, "two scenes have the name \"%.100s\"",
                                    own->scenes[i].name);
        if (!status) {
            scenes = drape_json_append(scenes, describe_scene(&own->scenes[i]));
            status = add_scene(l, i);
        }
    }
    json_object_set_new(l->arguments, "scenes", scenes);
    json_object_set_new(l->arguments, "case_seconds", json_real(l->def->case_seconds));
    json_object_set_new(l->arguments, "repeats", json_integer(l->def->repeats));
    if (!status && json_array_size(l->cases) == 0)
        status =
            drape_fail(l->ctx, DRAPE_E_ARGUMENT, "none of these integrators solves the equations of a scene");
    return status;
}

static void complete_request(const lab *l, size_t index, lab_request *request)
{
    const set *own = l->own;
    const lab_ivp *s = &own->scenes[own->of[index]];
    request->scene = s->path;
    request->identity = s->hash;
    request->identified = NULL;
    request->reference = &s->reference;
    request->reference_error = s->error * s->size;
    request->times = s->times;
    request->time_count = s->time_count;
}

/* ---- Reading the results ---- */

/* The cases of a scene and a series, in the order of the plan: from coarse to fine. */
typedef struct series {
    const char *scene, *name, *integrator, *knob;
    const json_t *results[MAX_POINTS];
    size_t count; /* those that were run */
} series;

static double error_of(const json_t *result)
{
    return lab_is_good(result) ? lab_number(result, "error_max") : NAN;
}

/* The error if it can be distinguished from that of the reference; otherwise NaN. */
static double resolved_error(const json_t *result)
{
    const double error = error_of(result);
    const double least = RESOLVED * lab_number(result, "reference_error_m") / lab_number(result, "size_m");
    return error > least ? error : NAN;
}

static size_t list_series(const lab *l, const char *scene, series *list)
{
    size_t count = 0;
    for (size_t i = 0; i < l->count; i++) {
        const json_t *one = json_array_get(l->cases, i);
        if (strcmp(lab_tag_text(one, "scene"), scene) != 0)
            continue;
        series *s = &list[count ? count - 1 : 0];
        if (!count || strcmp(s->name, lab_tag_text(one, "series")) != 0) {
            if (count == MAX_SERIES)
                break;
            s = &list[count++];
            *s = (series){.scene = scene,
                          .name = lab_tag_text(one, "series"),
                          .integrator = lab_tag_text(one, "integrator"),
                          .knob = lab_tag_text(one, "knob")};
        }
        if (l->results[i] && s->count < sizeof s->results / sizeof *s->results)
            s->results[s->count++] = l->results[i];
    }
    return count;
}

/* The least cost at which a series reaches an error: between neighbours of which one is worse and one is
 * better, by interpolation of logarithms; else of the coarsest case that reaches it. NaN: it does not. */
static double cost_at(const series *s, double error, const json_t **at)
{
    double least = NAN;
    for (size_t i = 0; i < s->count; i++) {
        const json_t *r = s->results[i];
        const double e = error_of(r), cost = lab_number(r, "cpu_s");
        if (!(e <= error))
            continue;
        const double before = i ? error_of(s->results[i - 1]) : NAN;
        const double cheap = i ? lab_number(s->results[i - 1], "cpu_s") : NAN;
        double found = cost;
        if (before > error && e > 0 && cheap > 0 && cheap < cost)
            found = cost * pow(cheap / cost, log(error / e) / log(before / e));
        if (!(found >= least)) {
            least = found;
            *at = r;
        }
    }
    return least;
}

static void knob_text(const json_t *result, char *text, size_t size)
{
    const char *knob = lab_tag_text(result, "knob");
    const double value = lab_tag_number(result, "value");
    if (strcmp(knob, "dt") == 0)
        snprintf(text, size, "dt 1/%.4g s", 1 / value);
    else
        snprintf(text, size, "%s %.3g", knob, value);
}

/* ---- The table of the cheapest ---- */

/* A text of the summary, the page and the Markdown file at once. */
typedef struct table {
    lab *l;
    FILE *out;
} table;

static void begin_row(table *t)
{
    fputs("<tr>", t->l->page);
    fputs("|", t->out);
}

static void put_cell(table *t, const char *text)
{
    fputs("<td>", t->l->page);
    lab_page_text(t->l, text);
    fputs("</td>", t->l->page);
    fputc(' ', t->out);
    for (; *text; text++) /* a text is neither a cell more nor HTML */
        fputs(*text == '|' ? "\\|" : *text == '<' ? "&lt;" : (char[]){*text, 0}, t->out);
    fputs(" |", t->out);
}

static void end_row(table *t)
{
    fputs("</tr>\n", t->l->page);
    fputs("\n", t->out);
}

static void begin_table(table *t, const char *title, const char *const *heads, size_t count)
{
    lab_page_heading(t->l, title);
    fputs("<table>", t->l->page);
    fprintf(t->out, "\n%s\n\n", title);
    begin_row(t);
    for (size_t i = 0; i < count; i++)
        put_cell(t, heads[i]);
    end_row(t);
    for (size_t i = 0; i < count; i++)
        fputs(i ? "---|" : "|---|", t->out);
    fputs("\n", t->out);
}

static void end_table(table *t)
{
    fputs("</table>\n", t->l->page);
}

/* "ida, order 5; rtol 1e-05; 0.021 s; 1.7 (trbdf2); 12" */
static void put_cheapest(table *t, const series *list, size_t count, double error)
{
    const json_t *best_at = NULL, *other_at = NULL;
    const series *best = NULL, *next = NULL;
    double least = NAN, second = NAN, base = NAN;
    bool ran = false; /* the base method */
    char text[160], knob[64];
    for (size_t i = 0; i < count; i++) {
        const json_t *at = NULL;
        const double cost = cost_at(&list[i], error, &at);
        if (strcmp(list[i].name, BASE_METHOD) == 0) {
            base = cost;
            ran = true;
        }
        if (!(cost >= least)) {
            if (isnan(cost))
                continue;
            least = cost;
            best = &list[i];
            best_at = at;
        }
    }
    for (size_t i = 0; best && i < count; i++) {
        const double cost = cost_at(&list[i], error, &other_at);
        if (strcmp(list[i].integrator, best->integrator) != 0 && !isnan(cost) && !(cost >= second)) {
            second = cost;
            next = &list[i];
        }
    }
    if (!best) {
        put_cell(t, "none");
        put_cell(t, "");
        put_cell(t, "");
        return;
    }
    knob_text(best_at, knob, sizeof knob);
    snprintf(text, sizeof text, "%s, %s (%.2g s)", best->name, knob, least);
    put_cell(t, text);
    snprintf(text, sizeof text, next ? "%.2g (%s)" : "", second / least, next ? next->name : "");
    put_cell(t, text);
    snprintf(text, sizeof text,
             !ran          ? "was not run"
             : isnan(base) ? "does not reach it"
                           : "%.2g",
             base / least);
    put_cell(t, text);
}

static void tabulate_cheapest(table *t)
{
    static const char *const heads[] = {"scene", "cheapest method", "the next other method costs, times",
                                        BASE_METHOD " costs, times"};
    const json_t *scenes = json_object_get(t->l->arguments, "scenes");
    series list[MAX_SERIES];
    for (int decade = -2; decade >= -4; decade--) {
        char title[96];
        snprintf(title, sizeof title, "At an error of 1e%d of the size", decade);
        begin_table(t, title, heads, sizeof heads / sizeof *heads);
        for (size_t i = 0; i < json_array_size(scenes); i++) {
            const char *scene = lab_text(json_array_get(scenes, i), "name");
            const size_t count = list_series(t->l, scene, list);
            begin_row(t);
            put_cell(t, scene);
            put_cheapest(t, list, count, pow(10, decade));
            end_row(t);
        }
        end_table(t);
    }
}

/* ---- Orders ---- */

/* Whether a case has the fixed steps of its dt, so that it may show an order. */
static bool has_its_steps(const json_t *r)
{
    const double limit = lab_number(r, "explicit_limit_s");
    return lab_number(r, "rejected") == 0 && !(lab_tag_number(r, "value") > 0.5 * limit);
}

/* The points of the asymptotic range, from the finest on: those whose orders between neighbours are that of
 * the finest. Points within the reference's error, and cases whose steps were cut, are none. */
static size_t asymptotic_range(const series *s, double *dt, double *error)
{
    size_t count = 0;
    for (size_t i = s->count; i-- > 0;) {
        const json_t *r = s->results[i];
        const double e = resolved_error(r);
        if (isnan(e) && count == 0)
            continue;
        if (!(e < LARGEST) || !has_its_steps(r))
            break;
        dt[count] = lab_tag_number(r, "value");
        error[count++] = e;
    }
    return lab_same_order(dt, error, count);
}

static void tabulate_orders(table *t)
{
    static const char *const heads[] = {"scene", "method", "order", "95 % confidence", "dt [s]", "errors"};
    const json_t *scenes = json_object_get(t->l->arguments, "scenes");
    series list[MAX_SERIES];
    begin_table(t, "Observed orders", heads, sizeof heads / sizeof *heads);
    for (size_t i = 0; i < json_array_size(scenes); i++) {
        const size_t count = list_series(t->l, lab_text(json_array_get(scenes, i), "name"), list);
        for (size_t k = 0; k < count; k++) {
            double dt[MAX_POINTS], error[MAX_POINTS];
            char text[64];
            const size_t points = strcmp(list[k].knob, "dt") == 0 ? asymptotic_range(&list[k], dt, error) : 0;
            if (points < 3)
                continue;
            const lab_line line = lab_fit_power(dt, error, points);
            begin_row(t);
            put_cell(t, list[k].scene);
            put_cell(t, list[k].name);
            snprintf(text, sizeof text, "%.2f", line.slope);
            put_cell(t, text);
            snprintf(text, sizeof text, "%.2f to %.2f", line.low, line.high);
            put_cell(t, text);
            snprintf(text, sizeof text, "1/%.4g to 1/%.4g", 1 / dt[points - 1], 1 / dt[0]);
            put_cell(t, text);
            snprintf(text, sizeof text, "%.1e to %.1e", error[points - 1], error[0]);
            put_cell(t, text);
            end_row(t);
        }
    }
    end_table(t);
}

/* ---- Failures ---- */

/* The reason that was counted most often. */
static const char *main_reason(const json_t *result)
{
    const char *most = "", *reason;
    json_int_t largest = 0;
    json_t *count;
    json_object_foreach(json_object_get(result, "reasons"), reason, count)
    {
        if (strcmp(reason, "converged") != 0 && json_integer_value(count) > largest) {
            largest = json_integer_value(count);
            most = reason;
        }
    }
    return most;
}

static void tabulate_failures(table *t)
{
    static const char *const heads[] = {"scene",  "method", "setting",
                                        "status", "at [s]", "most frequent reason"};
    begin_table(t, "Runs that did not complete", heads, sizeof heads / sizeof *heads);
    for (size_t i = 0; i < t->l->count; i++) {
        const json_t *r = t->l->results[i];
        char text[64];
        if (!r || lab_is_good(r))
            continue;
        begin_row(t);
        put_cell(t, lab_tag_text(r, "scene"));
        put_cell(t, lab_tag_text(r, "series"));
        knob_text(r, text, sizeof text);
        put_cell(t, text);
        put_cell(t, lab_text(r, "status"));
        snprintf(text, sizeof text, "%.3g", lab_number(r, "time_s"));
        put_cell(t, text);
        put_cell(t, main_reason(r));
        end_row(t);
    }
    end_table(t);
}

/* ---- Scenes and references ---- */

static void horizon_text(const json_t *scene, char *text, size_t size)
{
    const json_t *t_s = json_object_get(scene, "t_s");
    const double last = json_number_value(json_array_get(t_s, json_array_size(t_s) - 1));
    if (!t_s)
        snprintf(text, size, "not measured");
    else if (isnan(lab_number(scene, "horizon_s")))
        snprintf(text, size, "beyond %.3g", last);
    else
        snprintf(text, size, "%.3g", lab_number(scene, "horizon_s"));
}

static void tabulate_scenes(table *t)
{
    static const char *const heads[] = {"scene", "nodes", "duration [s]", "horizon [s]",
                                        "error of the reference"};
    const json_t *scenes = json_object_get(t->l->arguments, "scenes");
    series list[MAX_SERIES];
    begin_table(t, "Scenes", heads, sizeof heads / sizeof *heads);
    for (size_t i = 0; i < json_array_size(scenes); i++) {
        const json_t *s = json_array_get(scenes, i);
        char text[64];
        double nodes = NAN;
        const size_t count = list_series(t->l, lab_text(s, "name"), list);
        for (size_t k = 0; k < count && isnan(nodes); k++)
            nodes = list[k].count ? lab_number(list[k].results[0], "nodes") : NAN;
        begin_row(t);
        put_cell(t, lab_text(s, "name"));
        snprintf(text, sizeof text, "%.0f", nodes);
        put_cell(t, text);
        snprintf(text, sizeof text, "%.3g", lab_number(s, "duration_s"));
        put_cell(t, text);
        horizon_text(s, text, sizeof text);
        put_cell(t, text);
        snprintf(text, sizeof text, "%.1e", lab_number(s, "reference_error"));
        put_cell(t, text);
        end_row(t);
    }
    end_table(t);
}

/* ---- Figures ---- */

typedef struct chart {
    const char *suffix, *label, *key, *knob; /* knob: only series over this one; NULL: all */
    bool energy;                             /* over it, not the error */
} chart;

static const chart charts[] = {
    {"cpu", "CPU [s]", "cpu_s", NULL, false},   {"residuals", "residuals", "residuals", NULL, false},
    {"dt", "dt [s]", "value", "dt", false},     {"rtol", "rtol", "value", "rtol", false},
    {"energy", "CPU [s]", "cpu_s", NULL, true},
};

/* The points of a series on a chart, added to all: x, y in turn. gained: those where the method gained energy
 * instead of losing it. Returns how many are there then. */
static size_t take_points(const chart *c, const series *s, bool gained, double *xy, size_t count)
{
    for (size_t k = 0; k < s->count; k++) {
        const json_t *r = s->results[k];
        const double drift = lab_is_good(r) ? lab_number(r, "energy_drift") : NAN;
        const double x = c->knob ? lab_tag_number(r, "value") : lab_number(r, c->key),
                     y = c->energy ? (gained ? -drift : drift)
                         : gained  ? NAN
                                   : resolved_error(r);
        if (!(x > 0) || !(y > 0))
            continue;
        xy[2 * count] = x;
        xy[2 * count++ + 1] = y;
    }
    return count;
}

static size_t write_points(lab_figure *f, const double *xy, size_t count)
{
    const size_t block = lab_figure_data(f);
    for (size_t k = 0; k < count; k++)
        lab_figure_point(f, xy[2 * k], xy[2 * k + 1]);
    return block;
}

static void describe_chart(const json_t *about, const chart *c, char *text, size_t size)
{
    char horizon[64];
    horizon_text(about, horizon, sizeof horizon);
    snprintf(text, size,
             "%.60s: %s, over %s. The error of the reference is %.1e, the horizon %s s, the duration %.3g s.",
             lab_text(about, "name"),
             c->energy
                 ? "energy that the method lost, or, at open markers, gained, over the largest kinetic energy"
                 : "error, the largest of the times, of the RMS over the nodes",
             c->label, lab_number(about, "reference_error"), horizon, lab_number(about, "duration_s"));
}

static drape_status draw(lab *l, const json_t *about, const chart *c)
{
    const char *scene = lab_text(about, "name");
    lab_figure f;
    series list[MAX_SERIES];
    const size_t series_count = list_series(l, scene, list);
    size_t count = 0, variant = 0;
    bool any_gained = false;
    double *xy = drape_arena_take(&l->arena, 2 * l->count, sizeof *xy);
    char name[300], caption[400];
    snprintf(name, sizeof name, "%.255s_%s", scene, c->suffix);
    if (!xy)
        return DRAPE_E_MEMORY;
    lab_figure_begin(l, &f, name);
    for (size_t i = 0; i < series_count; i++) {
        const series *s = &list[i];
        variant = i && strcmp(s->integrator, list[i - 1].integrator) == 0 ? variant + 1 : 0;
        if (c->knob && strcmp(s->knob, c->knob) != 0)
            continue;
        const lab_style open = lab_style_of(s->integrator, 1);
        const size_t before = count, lost = take_points(c, s, false, xy, count);
        count = take_points(c, s, true, xy, lost);
        any_gained |= count > lost;
        if (lost > before)
            lab_figure_series(&f, write_points(&f, xy + 2 * before, lost - before), s->integrator, variant,
                              s->name);
        if (count > lost)
            lab_figure_curve(&f, write_points(&f, xy + 2 * lost, count - lost),
                             (lab_style){open.colour, 0, open.point},
                             lost > before || variant > 0 ? NULL : s->name);
    }
    snprintf(f.title, sizeof f.title, "%.150s", scene);
    snprintf(f.axes[0].label, sizeof f.axes[0].label, "%s", c->label);
    snprintf(f.axes[1].label, sizeof f.axes[1].label, c->energy ? "|energy_drift|" : "error / size");
    if (any_gained)
        lab_figure_marker(&f, (lab_style){LAB_BLACK, 0, LAB_OPEN_MARKER}, "gained");
    if (count > 0)
        lab_figure_fit(&f, xy, count, !c->knob ? 0 : strcmp(c->knob, "dt") == 0 ? 2 : 1);
    describe_chart(about, c, caption, sizeof caption);
    drape_status status = lab_figure_end(l, &f, caption);
    drape_arena_release(&l->arena, xy);
    return status;
}

/* The growth of the perturbation of each scene, over time in units of the duration. */
static drape_status draw_horizons(lab *l)
{
    static const int palette[] = {LAB_BLUE, LAB_RED, LAB_BLACK, LAB_ORANGE, LAB_PURPLE};
    const json_t *scenes = json_object_get(l->arguments, "scenes");
    lab_figure f;
    double low = 1, high = 1, last = 0;
    lab_figure_begin(l, &f, "horizons");
    for (size_t i = 0; i < json_array_size(scenes); i++) {
        const json_t *s = json_array_get(scenes, i), *t = json_object_get(s, "t_s"),
                     *growth = json_object_get(s, "growth");
        if (json_array_size(t) == 0)
            continue;
        const size_t block = lab_figure_data(&f);
        for (size_t k = 0; k < json_array_size(t); k++) {
            const double x = json_number_value(json_array_get(t, k)) / lab_number(s, "duration_s"),
                         y = json_number_value(json_array_get(growth, k));
            low = y > 0 ? fmin(low, y) : low;
            high = fmax(high, y);
            last = fmax(last, x);
            lab_figure_point(&f, x, y > 0 ? y : NAN);
        }
        lab_figure_curve(&f, block, (lab_style){palette[i % 5], 1 + (int)(i / 5 % 5), 0},
                         lab_text(s, "name"));
    }
    snprintf(f.axes[0].label, sizeof f.axes[0].label, "time / duration of the scene");
    snprintf(f.axes[1].label, sizeof f.axes[1].label, "growth of the perturbation");
    f.axes[0].to = last;
    f.axes[1].from = 0.5 * low;
    f.axes[1].to = 2 * high;
    f.axes[1].log = true;
    return lab_figure_end(l, &f, "How far a perturbation of the start by 1e-10 of the size has grown");
}

/* ---- The report ---- */

static drape_status tabulate(lab *l)
{
    char *text = NULL;
    size_t size = 0;
    table t = {l, open_memstream(&text, &size)};
    if (!t.out)
        return drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for tables.md");
    tabulate_scenes(&t);
    tabulate_cheapest(&t);
    tabulate_orders(&t);
    tabulate_failures(&t);
    fclose(t.out);
    fprintf(l->summary, "%s\n", text);
    drape_status status = lab_write_text(l, "tables.md", text, size);
    free(text);
    return status;
}

static drape_status report(lab *l)
{
    const json_t *scenes = json_object_get(l->arguments, "scenes");
    drape_status status = draw_horizons(l);
    for (size_t i = 0; !status && i < json_array_size(scenes); i++)
        for (size_t k = 0; !status && k < sizeof charts / sizeof *charts; k++)
            status = draw(l, json_array_get(scenes, i), &charts[k]);
    return status ? status : tabulate(l);
}

const lab_experiment_ops lab_experiment_ivp = {
    .entry = {.name = "ivp", .summary = "every integrator over its settings on scenes with references"},
    .compares_costs = true,
    .partial = true,
    .plan = plan,
    .request = complete_request,
    .report = report,
};
