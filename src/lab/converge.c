/*
 * converge: orders of convergence without a reference. A setting is halved again and again; the distances between the
 * ends of successive runs fall like a power of it, whose exponent is the order: straight lines in logarithms.
 * In time dt is halved (rows with own steps: rtol is cut to a tenth), in space the edges of every grid, with
 * positions compared at the nodes of the coarsest mesh.
 */
#include "lab/grid.h"
#include "lab/run.h"
#include "lab/statistics.h"
#include "lab/text.h"

#include "model/scene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FIRST_DT   (1.0 / 60)
#define FIRST_RTOL 1e-2
#define SPACE      "space"
#define SPACE_ROW  "bdf2" /* whose error in time is small beside that of the mesh, at the scene's dt */
#define LEAST      3
#define MOST       12
#define OWN        "dt, with own substeps" /* the knob of a row that dt does not refine */
#define ROUNDING   1e-12                   /* m: distances below are not of the method */

/* ---- The cases ---- */

static drape_status add(lab *l, const char *series, const char *knob, double value, json_t *settings)
{
    json_t *tags = json_pack("{s:s, s:s, s:f}", "series", series, "knob", knob, "value", value);
    return lab_add_case(l, tags, settings, -1);
}

/* A row whose limit says how many substeps it takes goes on at its limit, whatever dt is, unless the scene fixes them. */
static bool has_own_substeps(const drape_integrator_ops *row, const drape_row_def *said)
{
    for (size_t i = 0; i < said->setting_count; i++)
        if (strcmp(said->settings[i].name, "substeps") == 0 && said->settings[i].number > 0)
            return false;
    return row->stability && lab_has_param(row->entry.params, row->entry.param_count, "substeps");
}

static drape_status add_time(lab *l, const drape_integrator_ops *row, const drape_row_def *said)
{
    drape_status status = DRAPE_OK;
    const char *knob = row->own_steps ? "rtol" : has_own_substeps(row, said) ? OWN : "dt";
    const char *pointer = row->own_steps ? "/integrator/rtol" : "/integrator/dt";
    double value = row->own_steps ? FIRST_RTOL : FIRST_DT, ratio = row->own_steps ? 0.1 : 0.5;
    for (int k = 0; k < l->def->levels && !status; k++, value *= ratio)
        status = add(l, row->entry.name, knob, value,
                     json_pack("{s:s, s:f}", "/integrator/method", row->entry.name, pointer, value));
    return status;
}

/* A grid with its edges cut into so many parts: counts of nodes n become (n - 1) f + 1, of edges n f. */
static void refine(const drape_row_def *grid, size_t cloth, int factor, json_t *settings)
{
    for (size_t i = 0; i < grid->setting_count; i++) {
        const char *key = grid->settings[i].name;
        double value = grid->settings[i].number;
        char pointer[96];
        snprintf(pointer, sizeof pointer, "/cloth/%zu/mesh/%s", cloth, key);
        if (strcmp(key, "columns") == 0 || strcmp(key, "rows") == 0)
            json_object_set_new(settings, pointer, json_integer(((json_int_t)value - 1) * factor + 1));
        else if (strcmp(key, "edges") == 0)
            json_object_set_new(settings, pointer, json_integer((json_int_t)value * factor));
        else if (strcmp(key, "edge_length") == 0)
            json_object_set_new(settings, pointer, json_real(value / factor));
    }
}

static drape_status add_level(lab *l, const drape_scene_def *def, int level)
{
    json_t *settings = json_pack("{s:s}", "/integrator/method", SPACE_ROW);
    for (size_t c = 0; c < def->cloth_count; c++) {
        if (!def->cloths[c].mesh.grid.type) {
            json_decref(settings);
            return drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                              "/cloth/%zu/mesh: convergence in space refines grids, and this is none", c);
        }
        refine(&def->cloths[c].mesh.grid, c, 1 << level, settings);
    }
    return add(l, SPACE, "edge", ldexp(1, -level), settings);
}

static drape_status add_all(lab *l, const drape_scene_def *def)
{
    drape_status status = DRAPE_OK;
    for (int i = 0; !status && drape_integrators[i]; i++)
        if (lab_wants_integrator(l, drape_integrators[i]->entry.name, true) &&
            !drape_integrators[i]->timeless)
            status = add_time(l, drape_integrators[i], &def->integrator);
    for (int k = 0; l->def->space && k < l->def->levels && !status; k++)
        status = add_level(l, def, k);
    return status;
}

static drape_status add_cases(lab *l)
{
    const lab_request request = {.def = l->def};
    drape_scene *scene = NULL;
    drape_scene_def def;
    drape_status status = lab_load_scene(l->ctx, &request, &scene);
    drape_scene_def_init(&def, sizeof def);
    if (!status)
        status = drape_scene_to_def(scene, &def);
    if (!status)
        status = add_all(l, &def);
    drape_scene_destroy(&scene);
    return status;
}

static drape_status plan(lab *l)
{
    if (l->def->levels < LEAST || l->def->levels > MOST)
        return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "levels = %d; it is %d to %d", l->def->levels, LEAST,
                          MOST);
    drape_status status = lab_check_integrators(l);
    if (!status)
        status = add_cases(l);
    json_object_set_new(l->arguments, "case_seconds", json_real(l->def->case_seconds));
    return status;
}

/* All runs are compared at the nodes of the scene's own mesh. */
static drape_status prepare(lab *l)
{
    const lab_request request = {.def = l->def};
    drape_model *model = NULL;
    drape_status status = lab_load(l->ctx, &request, &model);
    if (!status)
        status = lab_probe_create(l->ctx, model, &l->probe);
    drape_model_destroy(&model);
    return status;
}

/* ---- Reading the results ---- */

/* One row's refinements: from each to the next, how far the end moved. */
typedef struct sequence {
    const char *series, *knob;
    double value[MOST], moved[MOST]; /* of the coarser of two, [m] */
    size_t count;
    int failed;
    int64_t rejected; /* steps that the controller cut: there dt was not what the case says */
    bool unrefined;   /* by its knob: there is no order */
    lab_line line;
} sequence;

static double distance(const json_t *a, const json_t *b)
{
    const json_t *x = json_object_get(a, "positions"), *y = json_object_get(b, "positions");
    double sum = 0;
    size_t size = json_array_size(x);
    for (size_t i = 0; i < size; i++) {
        double d = json_number_value(json_array_get(x, i)) - json_number_value(json_array_get(y, i));
        sum += d * d;
    }
    return size > 0 && size == json_array_size(y) ? sqrt(sum / ((double)size / 3)) : NAN;
}

static void read_sequence(const lab *l, size_t first, sequence *s)
{
    const json_t *before = NULL;
    *s = (sequence){.series = lab_tag_word(l->results[first], "series"),
                    .knob = lab_tag_word(l->results[first], "knob")};
    for (size_t i = first; i < l->count && strcmp(lab_tag_word(l->results[i], "series"), s->series) == 0;
         i++) {
        const json_t *r = l->results[i];
        bool good = lab_is_good(r);
        double moved = before && good ? distance(before, r) : NAN;
        s->failed += !good;
        s->rejected += (int64_t)lab_number(r, "rejected");
        if (moved > ROUNDING && s->count < MOST) {
            s->value[s->count] = lab_tag_number(before, "value");
            s->moved[s->count++] = moved;
        }
        before = good ? r : NULL;
    }
    s->unrefined = strcmp(s->knob, OWN) == 0;
    s->line = lab_fit_power(s->value, s->moved, s->count);
}

static void say_order(lab *l, const sequence *s)
{
    double last = NAN;
    if (s->count >= 2)
        last = log(s->moved[s->count - 2] / s->moved[s->count - 1]) /
               log(s->value[s->count - 2] / s->value[s->count - 1]);
    fprintf(l->words, "order %.3g in %s", s->line.slope, s->knob);
    if (!isnan(s->line.low))
        fprintf(l->words, " (95 %% confidence %.3g to %.3g)", s->line.low, s->line.high);
    fprintf(l->words, ", %.3g at the last refinement", last);
    if (s->line.low <= 0)
        fprintf(l->words,
                ": that is not all above 0, so these do not tell the order; more --levels may, or a "
                "shorter --duration, "
                "before small differences grow");
}

static void say(lab *l, const sequence *s)
{
    fprintf(l->words, "%s: ", s->series);
    if (s->unrefined)
        fprintf(l->words, "no order, as it chooses its own substeps and dt does not refine them; "
                          "--set /integrator/substeps=N fixes them");
    else if (isnan(s->line.slope))
        fprintf(l->words, "no order, as too few of its refinements moved the end");
    else
        say_order(l, s);
    if (s->rejected && strcmp(s->knob, "dt") == 0)
        fprintf(l->words, "; %lld of its steps were rejected and cut, so dt was not halved everywhere",
                (long long)s->rejected);
    if (s->failed)
        fprintf(l->words, "; %d of its runs did not come to the end", s->failed);
    fprintf(l->words, "\n");
}

/* ---- The picture and the table ---- */

static drape_status draw(lab *l, const sequence *sequences, size_t count)
{
    char *script = NULL;
    size_t size = 0;
    bool drawn = false, any = false;
    drape_status status = DRAPE_OK;
    FILE *out = open_memstream(&script, &size);
    if (!out)
        return drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for a picture");
    fprintf(
        out,
        "set terminal svg size 900,560 dynamic font 'sans-serif,13' background '#ffffff' name 'converge'\n"
        "cd '%s'\nset output 'converge.svg'\nset logscale xy\nset format '10^{%%T}'\n"
        "set grid lc rgb '#dddddd'\nset key outside right top noenhanced\n"
        "set xlabel 'dt [s], rtol, or edge over that of the coarsest mesh'\n"
        "set ylabel 'way of the end to the next refinement, RMS [m]'\n",
        l->folder);
    for (size_t k = 0; k < count; k++) {
        fprintf(out, "$s%zu << EOD\n", k);
        for (size_t i = 0; i < sequences[k].count; i++)
            fprintf(out, "%.9g %.9g\n", sequences[k].value[i], sequences[k].moved[i]);
        fprintf(out, "EOD\n");
    }
    for (size_t k = 0; k < count; k++)
        if (sequences[k].count > 0 && !sequences[k].unrefined) {
            fprintf(out, "%s $s%zu with linespoints lw 1.6 pt %zu ps .6 title \"%s (%.3g)\"",
                    any ? "," : "plot", k, 4 + k % 10, sequences[k].series, sequences[k].line.slope);
            any = true;
        }
    fprintf(out, "\n");
    fclose(out);
    if (any) /* without a point there are no axes in logarithms */
        status = lab_plot(l, "converge", script, size, &drawn);
    free(script);
    return status || !drawn
               ? status
               : lab_page_picture(l, "converge.svg",
                                  "How far the end moves with each refinement; in brackets the order");
}

static void write_table(lab *l, const sequence *s)
{
    lab_page_heading(l, s->series);
    fprintf(l->page, "<table><tr><th>%s</th><th>moved [m]</th><th>order</th></tr>\n", s->knob);
    for (size_t i = 0; i < s->count; i++) {
        fprintf(l->page, "<tr><td>%.6g</td><td>%.4g</td><td>", s->value[i], s->moved[i]);
        if (i > 0 && !s->unrefined)
            fprintf(l->page, "%.3f", log(s->moved[i - 1] / s->moved[i]) / log(s->value[i - 1] / s->value[i]));
        fputs("</td></tr>\n", l->page);
    }
    fputs("</table>\n", l->page);
}

static drape_status report(lab *l)
{
    size_t count = 0;
    sequence *sequences = drape_alloc(l->ctx, l->count, sizeof *sequences);
    if (!sequences)
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < l->count; i++)
        if (i == 0 ||
            strcmp(lab_tag_word(l->results[i], "series"), lab_tag_word(l->results[i - 1], "series")) != 0)
            read_sequence(l, i, &sequences[count++]);
    for (size_t k = 0; k < count; k++)
        say(l, &sequences[k]);
    drape_status status = draw(l, sequences, count);
    for (size_t k = 0; k < count; k++)
        write_table(l, &sequences[k]);
    drape_free(l->ctx, sequences);
    return status;
}

const lab_experiment_ops lab_experiment_converge = {
    .entry = {.name = "converge", .summary = "orders of convergence in time, and in space"},
    .plan = plan,
    .prepare = prepare,
    .report = report,
};
