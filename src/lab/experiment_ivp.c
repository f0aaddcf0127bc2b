/*
 * ivp: every integrator over its dt or rtol on scenes of the test set, compared with their references
 * (ivp.h). The residual that Newton's method may leave falls with dt as fast as the error of the method
 * does. Errors are relative to the size of the scene, and taken at times at which steps end.
 */
#include "lab/engine_output.h"
#include "lab/fit.h"
#include "lab/ivp.h"
#include "lab/series.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RESOLVED    10.0 /* times the reference's error: smaller errors cannot be distinguished from it */
#define LARGEST     0.1  /* of the size: larger errors have no order */
#define BASE_METHOD "be"
#define LEVELS      11 /* of dt */
#define MAX_POINTS  16 /* of a line */

/* Ranks of dt = interval/2^k: a few points over all of the range first. */
static const int dt_ranks[LEVELS] = {6, 2, 5, 0, 4, 1, 5, 3, 6, 4, 7};
static const lab_level rtols[] = {{1e-2, 2}, {1e-3, 0}, {1e-4, 3}, {1e-5, 1},
                                  {1e-6, 5}, {1e-7, 4}, {1e-8, 6}, {1e-9, 7}};
static const lab_level controlled[] = {{1e-3, 8}, {1e-4, 9}, {1e-5, 8}, {1e-6, 9}};

/* ---- The cases ---- */

/* The tolerance of Newton's method. Under a controller, whose steps have errors of order p + 1, for the step
 * that it takes. */
static void add_tolerance(const void *user, const drape_integrator_ops *integrator, double dt, double rtol,
                          json_t *settings)
{
    const lab_ivp *s = user;
    const double h = isnan(dt) ? fmin(pow(rtol, 1.0 / (integrator->order + 1)), 1) * s->interval : dt;
    if (lab_has_param(&integrator->entry, "tolerance"))
        json_object_set_new(settings, "/integrator/tolerance",
                            json_real(lab_ivp_tolerance(s, integrator->order, h)));
}

static drape_status add_scene(lab *l, const lab_ivp *s)
{
    lab_level steps[LEVELS];
    const lab_grid grid = {.scene = s->name,
                           .rtols = LAB_LEVELS(rtols),
                           .steps = LAB_LEVELS(steps),
                           .controlled = LAB_LEVELS(controlled),
                           .first_step = s->interval / 64,
                           .only_if_implicit = true,
                           .add = add_tolerance,
                           .user = s};
    drape_status status = DRAPE_OK;
    for (int k = 0; k < LEVELS; k++)
        steps[k] = (lab_level){ldexp(s->interval, -k), dt_ranks[k]};
    for (int i = 0; !status && drape_integrators[i]; i++)
        if (lab_wants_integrator(l, drape_integrators[i]->entry.name, true) &&
            lab_ivp_admits(s, drape_integrators[i]))
            status = lab_add_integrator(l, &grid, drape_integrators[i]);
    return status;
}

/* l->own: the scenes, while the program runs; a merge has none. */
static drape_status plan(lab *l)
{
    static const char *const keys[] = {"horizon_s", "t_s", "growth"};
    const size_t count = l->def->scene_count ? l->def->scene_count : 1;
    lab_ivp *own = l->own = drape_arena_take(&l->arena, count, sizeof *own);
    if (!own)
        return DRAPE_E_MEMORY;
    drape_status status = DRAPE_OK;
    if (l->def->setting_count)
        status = drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                            "ivp takes no settings: the references are of the scenes as they are");
    json_t *scenes = json_array();
    for (size_t i = 0; !status && i < count; i++) {
        lab_ivp *s = &own[i];
        status = lab_ivp_open(&l->arena, l->def->scene_count ? l->def->scenes[i] : l->def->scene, s);
        if (!status)
            status = lab_ivp_read_reference(s);
        lab_ivp_close(s); /* cases compile their own */
        for (size_t k = 0; !status && k < i; k++)
            if (strcmp(s->name, own[k].name) == 0)
                status = drape_fail(l->ctx, DRAPE_E_ARGUMENT, "two scenes have the name \"%.100s\"", s->name);
        if (status)
            break;
        /* What the report says of a scene besides its cases, and what makes results comparable. */
        json_t *about =
            json_pack("{s:s, s:s, s:f, s:f, s:f}", "name", s->name, "hash", s->hash, "size_m", s->size,
                      "duration_s", s->times[s->time_count - 1], "reference_error", s->error);
        json_t *horizon = lab_ivp_read_horizon(s);
        for (size_t k = 0; horizon && k < sizeof keys / sizeof *keys; k++)
            json_object_set(about, keys[k], json_object_get(horizon, keys[k]));
        json_decref(horizon);
        scenes = drape_json_append(scenes, about);
        status = add_scene(l, s);
    }
    json_object_set_new(l->arguments, "scenes", scenes);
    if (!status && json_array_size(l->cases) == 0)
        status =
            drape_fail(l->ctx, DRAPE_E_ARGUMENT, "none of these integrators solves the equations of a scene");
    return status;
}

static void complete_request(const lab *l, size_t index, lab_request *request)
{
    const char *scene = lab_tag_text(json_array_get(l->cases, index), "scene");
    const lab_ivp *s = l->own;
    while (strcmp(s->name, scene) != 0)
        s++;
    request->scene = s->path;
    request->identity = s->hash;
    request->identified = NULL;
    request->reference = &s->reference;
    request->reference_error = s->error * s->size;
    request->times = s->times;
    request->time_count = s->time_count;
}

/* ---- Reading the results ---- */

/* What is known of a scene. */
typedef struct scene {
    const json_t *about; /* of experiment.json */
    const char *name;
    const lab_series *series;
    size_t count; /* of these */
} scene;

/* A table, and the scenes. */
typedef struct tables {
    lab_table table;
    const scene *scenes;
    size_t count;
} tables;

static double error_of(const json_t *result)
{
    return lab_is_good(result) ? lab_number(result, "error_max") : NAN;
}

static double resolved_error(const json_t *result)
{
    const double error = error_of(result);
    return error > RESOLVED * lab_number(result, "reference_error_m") / lab_number(result, "size_m") ? error
                                                                                                     : NAN;
}

/* The least cost at which a series reaches an error: interpolated in logarithms between neighbours of which
 * one is worse and one is better, or that of the coarsest case that reaches the error. NaN: no case does. */
static double cost_at(const lab_series *s, double error, const json_t **at)
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

/* ---- Tables ---- */

/* The row of a scene: "ball; ida, order 5, rtol 1e-05 (0.021 s); 1.7 (trbdf2); 12". */
static void put_cheapest(const lab_table *t, const scene *s, double error)
{
    const json_t *best_at = NULL, *other_at = NULL;
    const lab_series *best = NULL, *next = NULL, *base = NULL;
    double least = NAN, second = NAN;
    char knob[64], other[1200] = "", usual[64];
    for (size_t i = 0; i < s->count; i++) {
        const json_t *at = NULL;
        const double cost = cost_at(&s->series[i], error, &at);
        base = strcmp(s->series[i].name, BASE_METHOD) == 0 ? &s->series[i] : base;
        if (isnan(cost) || cost >= least)
            continue;
        least = cost;
        best = &s->series[i];
        best_at = at;
    }
    if (!best) {
        lab_table_row(t, "%s\tnone\t\t", s->name);
        return;
    }
    for (size_t i = 0; i < s->count; i++) {
        const double cost = cost_at(&s->series[i], error, &other_at);
        if (strcmp(s->series[i].integrator, best->integrator) != 0 && !isnan(cost) && !(cost >= second)) {
            second = cost;
            next = &s->series[i];
        }
    }
    const double cost = base ? cost_at(base, error, &other_at) : NAN;
    lab_knob_text(best_at, knob);
    if (next)
        snprintf(other, sizeof other, "%.2g (%s)", second / least, next->name);
    snprintf(usual, sizeof usual,
             !base         ? "was not run"
             : isnan(cost) ? "does not reach it"
                           : "%.2g",
             cost / least);
    lab_table_row(t, "%s\t%s, %s (%.2g s)\t%s\t%s", s->name, best->name, knob, least, other, usual);
}

/* The points of the asymptotic range, from the finest on: as far as the orders between neighbours are that
 * of the finest two. Points within the reference's error, and cases whose steps were not all of dt, do not
 * belong to it. */
static size_t asymptotic_range(const lab_series *s, double dt[MAX_POINTS], double error[MAX_POINTS])
{
    size_t count = 0;
    for (size_t i = s->count; i-- > 0 && count < MAX_POINTS;) {
        const json_t *r = s->results[i];
        const double e = resolved_error(r), limit = lab_number(r, "explicit_limit_s");
        if (isnan(e) && count == 0)
            continue;
        dt[count] = lab_tag_number(r, "value");
        if (!(e < LARGEST) || lab_number(r, "rejected") != 0 || dt[count] > 0.5 * limit)
            break;
        error[count++] = e;
    }
    return lab_same_order(dt, error, count);
}

static void tabulate_orders(const tables *all)
{
    double dt[MAX_POINTS], error[MAX_POINTS];
    const lab_table *t = &all->table;
    lab_table_begin(t, "Observed orders", "scene\tmethod\torder\t95 %% confidence\tdt [s]\terrors");
    for (const scene *s = all->scenes; s < all->scenes + all->count; s++)
        for (size_t k = 0; k < s->count; k++) {
            const lab_series *one = &s->series[k];
            const size_t points = strcmp(one->knob, "dt") == 0 ? asymptotic_range(one, dt, error) : 0;
            if (points < 3)
                continue;
            const lab_line line = lab_fit_power(dt, error, points);
            lab_table_row(t, "%s\t%s\t%.2f\t%.2f to %.2f\t1/%.4g to 1/%.4g\t%.1e to %.1e", one->scene,
                          one->name, line.slope, line.low, line.high, 1 / dt[points - 1], 1 / dt[0],
                          error[points - 1], error[0]);
        }
    lab_table_end(t);
}

static void tabulate_failures(const tables *all)
{
    const lab_table *t = &all->table;
    lab_table_begin(t, "Runs that did not complete",
                    "scene\tmethod\tsetting\tstatus\tat [s]\tmost frequent reason");
    for (size_t i = 0; i < t->l->count; i++) {
        const json_t *r = t->l->results[i];
        char knob[64], most[128] = "";
        const char *reason;
        json_int_t largest = 0;
        json_t *count;
        if (!r || lab_is_good(r))
            continue;
        json_object_foreach(json_object_get(r, "reasons"), reason, count)
        {
            if (strcmp(reason, "converged") != 0 && json_integer_value(count) > largest) {
                largest = json_integer_value(count);
                snprintf(most, sizeof most, "%s", reason);
            }
        }
        lab_knob_text(r, knob);
        drape_make_printable(most); /* a file of a stranger has any text there */
        lab_table_row(t, "%s\t%s\t%s\t%s\t%.3g\t%s", lab_tag_text(r, "scene"), lab_tag_text(r, "series"),
                      knob, lab_text(r, "status"), lab_number(r, "time_s"), most);
    }
    lab_table_end(t);
}

static void horizon_text(const json_t *about, char text[64])
{
    const json_t *t_s = json_object_get(about, "t_s");
    const double last = json_number_value(json_array_get(t_s, json_array_size(t_s) - 1));
    if (!t_s)
        snprintf(text, 64, "not measured");
    else if (isnan(lab_number(about, "horizon_s")))
        snprintf(text, 64, "beyond %.3g", last);
    else
        snprintf(text, 64, "%.3g", lab_number(about, "horizon_s"));
}

static void tabulate_scenes(const tables *all)
{
    const lab_table *t = &all->table;
    lab_table_begin(t, "Scenes", "scene\tnodes\tduration [s]\thorizon [s]\terror of the reference");
    for (const scene *s = all->scenes; s < all->scenes + all->count; s++) {
        char horizon[64];
        double nodes = NAN;
        for (size_t k = 0; k < s->count && isnan(nodes); k++)
            nodes = s->series[k].count ? lab_number(s->series[k].results[0], "nodes") : NAN;
        horizon_text(s->about, horizon);
        lab_table_row(t, "%s\t%.0f\t%.3g\t%s\t%.1e", s->name, nodes, lab_number(s->about, "duration_s"),
                      horizon, lab_number(s->about, "reference_error"));
    }
    lab_table_end(t);
}

/* ---- Figures ---- */

static bool is_resolved(const json_t *result)
{
    return !isnan(resolved_error(result));
}

static drape_status draw(lab *l, const scene *of)
{
#define ERROR .y = "error_max", .y_label = "error / size", .shows = is_resolved
    static const lab_chart charts[] = {
        {.name = "cpu", .x = "cpu_s", .x_label = "CPU [s]", ERROR},
        {.name = "residuals", .x = "residuals", .x_label = "residuals", ERROR},
        {.name = "dt", .knob = "dt", .x_label = "dt [s]", .orders = 2, ERROR},
        {.name = "rtol", .knob = "rtol", .x_label = "rtol", .orders = 1, ERROR},
        {.name = "energy",
         .x = "cpu_s",
         .x_label = "CPU [s]",
         .y = "energy_drift",
         .y_label = "|energy_drift|",
         .negative = "gained",
         .shows = lab_is_good},
    };
    drape_status status = DRAPE_OK;
    for (size_t i = 0; !status && i < sizeof charts / sizeof *charts; i++) {
        lab_chart c = charts[i];
        char name[300], title[160], caption[400], horizon[64];
        horizon_text(of->about, horizon);
        snprintf(name, sizeof name, "%.255s_%s", of->name, c.name);
        snprintf(title, sizeof title, "%.150s", of->name);
        snprintf(
            caption, sizeof caption,
            "%.60s: %s, over %s. The error of the reference is %.1e, the horizon %s s, the duration %.3g s.",
            lab_text(of->about, "name"),
            c.negative
                ? "energy that the method lost, or, at open markers, gained, over the largest kinetic energy"
                : "error, the largest of the times, of the RMS over the nodes",
            c.x_label, lab_number(of->about, "reference_error"), horizon,
            lab_number(of->about, "duration_s"));
        c.name = name;
        c.title = title;
        c.caption = caption;
        status = lab_draw_series(l, &c, of->series, of->count);
    }
    return status;
}

/* The growth of the perturbation of each scene, over time in units of the duration. */
static drape_status draw_horizons(const tables *all)
{
    static const int palette[] = {LAB_BLUE, LAB_RED, LAB_BLACK, LAB_ORANGE, LAB_PURPLE};
    lab *l = all->table.l;
    lab_figure f;
    double low = 1, high = 1, last = 0;
    lab_figure_begin(l, &f, "horizons", NULL, "time / duration of the scene", "growth of the perturbation");
    for (size_t i = 0; i < all->count; i++) {
        const json_t *s = all->scenes[i].about, *t = json_object_get(s, "t_s"),
                     *growth = json_object_get(s, "growth");
        lab_figure_data(&f);
        for (size_t k = 0; k < json_array_size(t); k++) {
            const double x = json_number_value(json_array_get(t, k)) / lab_number(s, "duration_s"),
                         y = json_number_value(json_array_get(growth, k));
            low = y > 0 ? fmin(low, y) : low;
            high = fmax(high, y);
            last = fmax(last, x);
            lab_figure_point(&f, x, y > 0 ? y : NAN);
        }
        lab_figure_curve(&f, (lab_style){palette[i % 5], 1 + (int)(i / 5 % 5), 0}, all->scenes[i].name);
    }
    f.axes[0].to = last;
    f.axes[1].from = 0.5 * low;
    f.axes[1].to = 2 * high;
    f.axes[1].log = true;
    return lab_figure_end(l, &f, "How far a perturbation of the start by 1e-10 of the size has grown");
}

/* ---- The report ---- */

static drape_status report(lab *l)
{
    const json_t *abouts = json_object_get(l->arguments, "scenes");
    const size_t count = json_array_size(abouts);
    scene *scenes = drape_arena_take(&l->arena, count, sizeof *scenes);
    tables all = {{.l = l}, scenes, count};
    for (size_t i = 0; scenes && i < count; i++) {
        scenes[i].about = json_array_get(abouts, i);
        scenes[i].name = lab_text(scenes[i].about, "name");
        scenes[i].series = lab_list_series(l, scenes[i].name, &scenes[i].count);
    }
    drape_status status = drape_arena_status(&l->arena);
    if (!status)
        status = draw_horizons(&all);
    for (size_t i = 0; !status && i < count; i++)
        status = draw(l, &scenes[i]);
    if (status)
        return status;
    char *text = NULL;
    size_t size = 0;
    FILE *out = all.table.markdown = open_memstream(&text, &size);
    if (!out)
        return drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for tables.md");
    tabulate_scenes(&all);
    for (int decade = -2; decade >= -4; decade--) {
        char title[96];
        snprintf(title, sizeof title, "At an error of 1e%d of the size", decade);
        lab_table_begin(&all.table, title,
                        "scene\tcheapest method\tthe next other method costs, times\t" BASE_METHOD
                        " costs, times");
        for (size_t i = 0; i < count; i++)
            put_cheapest(&all.table, &scenes[i], pow(10, decade));
        lab_table_end(&all.table);
    }
    tabulate_orders(&all);
    tabulate_failures(&all);
    fclose(out);
    fprintf(l->summary, "%s\n", text);
    status = lab_write_text(l, "tables.md", text, size);
    free(text);
    return status;
}

const lab_experiment_ops lab_experiment_ivp = {
    .entry = {.name = "ivp", .summary = "every integrator over its settings on scenes with references"},
    .compares_costs = true,
    .partial = true,
    .plan = plan,
    .request = complete_request,
    .report = report,
};
