/*
 * stability: maps. Values of the scene over two or three axes, every point with every integrator asked for: what came
 * of it is one of five things, each a colour. Where the first axis is the step of an explicit row, its limit, as
 * estimated at the start of each run, is drawn over the map.
 */
#include "lab/grid.h"
#include "lab/run.h"
#include "lab/text.h"
#include "lab/units.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define AXES      3
#define LONGEST   1024
#define MOST_RUNS 1000000

static const char *const usual[] = {"be", "bdf2", "ida", "verlet"}; /* where none are asked for */

/* ---- Axes ---- */

/* "/integrator/dt=1e-4:1e-1:32log" */
typedef struct axis {
    char pointer[256];
    double from, to;
    int count;
    bool log;
} axis;

static drape_status bad_axis(lab *l, const char *text, const char *why)
{
    return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "--axis \"%.100s\": %s; it is /pointer=from:to:n or ...:nlog",
                      text, why);
}

static drape_status read_axis(lab *l, const char *text, axis *a)
{
    const char *equals = strchr(text, '=');
    int used = 0;
    char rest[8] = "";
    if (*text != '/' || !equals || (size_t)(equals - text) >= sizeof a->pointer)
        return bad_axis(l, text, "there is no pointer");
    memcpy(a->pointer, text, (size_t)(equals - text));
    a->pointer[equals - text] = 0;
    if (sscanf(equals + 1, "%lf:%lf:%d%n%7s", &a->from, &a->to, &a->count, &used, rest) < 3 || used == 0)
        return bad_axis(l, text, "there are no three numbers");
    a->log = strcmp(rest, "log") == 0;
    if (*rest && !a->log)
        return bad_axis(l, text, "after the count comes log, or nothing");
    if (!isfinite(a->from) || !isfinite(a->to) || a->from == a->to)
        return bad_axis(l, text, "from and to are different numbers");
    if (a->log && !(a->from > 0 && a->to > 0))
        return bad_axis(l, text, "a logarithmic axis is of positive numbers");
    if (a->count < 2 || a->count > LONGEST)
        return bad_axis(l, text, "n is 2 to 1024");
    return DRAPE_OK;
}

static double axis_value(const axis *a, int k)
{
    double share = (double)k / (a->count - 1);
    return a->log ? a->from * pow(a->to / a->from, share) : a->from + share * (a->to - a->from);
}

/* Whether it is an integer in the scene: the resolution of a mesh. */
static bool is_integer_axis(const axis *a)
{
    static const char *const integers[] = {"/columns",  "/rows",      "/edges",
                                           "/substeps", "/max_order", "/max_iterations"};
    const char *name = strrchr(a->pointer, '/');
    for (size_t i = 0; i < sizeof integers / sizeof *integers; i++)
        if (strcmp(name, integers[i]) == 0)
            return true;
    return false;
}

/* What is run, and what is recorded of it. An integer stays one; powers are integers up to rounding. */
static json_t *setting_value(const axis *a, int k)
{
    double value = axis_value(a, k);
    return is_integer_axis(a) ? json_integer((json_int_t)llround(value)) : json_real(value);
}

/* A map over values that were not run would be of something else. */
static drape_status check_integers(lab *l, const axis *a)
{
    for (int k = 0; is_integer_axis(a) && k < a->count; k++) {
        double value = axis_value(a, k);
        if (!(fabs(value) < 1e15) || fabs(value - round(value)) > 1e-9 * fmax(1, fabs(value)))
            return drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                              "--axis \"%.100s\": its value %d would be %.6g, and it takes integers",
                              a->pointer, k + 1, value);
    }
    return DRAPE_OK;
}

/* ---- The cases ---- */

typedef struct space {
    axis axes[AXES];
    int count;
} space;

static size_t cells_of(const space *s)
{
    size_t cells = 1;
    for (int a = 0; a < s->count; a++)
        cells *= (size_t)s->axes[a].count;
    return cells;
}

/* The place of a cell along each axis; the first axis runs fastest. */
static void places_of(const space *s, size_t cell, int *place)
{
    for (int a = 0; a < s->count; a++) {
        place[a] = (int)(cell % (size_t)s->axes[a].count);
        cell /= (size_t)s->axes[a].count;
    }
}

/* Where a row ignores an axis, the cell has the result of the first one along it. */
static int64_t same_cell(const space *s, const drape_integrator_ops *row, const int *place)
{
    int64_t cell = 0, stride = 1;
    bool differs = false;
    for (int a = 0; a < s->count; a++) {
        bool ignored = lab_ignores(row, s->axes[a].pointer);
        cell += ignored ? 0 : stride * place[a];
        differs |= ignored && place[a] > 0;
        stride *= s->axes[a].count;
    }
    return differs ? cell : -1;
}

/* Whether the command line, or an axis, says what is at the pointer. */
static bool is_said(const lab *l, const space *s, const char *pointer)
{
    for (size_t i = 0; i < l->def->setting_count; i++)
        if (strcmp(l->def->settings[i].pointer, pointer) == 0)
            return true;
    for (int a = 0; a < s->count; a++)
        if (strcmp(s->axes[a].pointer, pointer) == 0)
            return true;
    return false;
}

/* Left alone, an explicit row takes as many substeps as its limit asks for, and the controller rescues it where that
 * fails. A map is to show the limit: one substep a step, and no rescue, unless it is asked for. */
static void lay_bare(const lab *l, const space *s, const drape_integrator_ops *row, json_t *settings)
{
    if (!row->stability)
        return;
    if (lab_has_param(row->entry.params, row->entry.param_count, "substeps") &&
        !is_said(l, s, "/integrator/substeps"))
        json_object_set_new(settings, "/integrator/substeps", json_integer(1));
    if (!is_said(l, s, "/controller/type"))
        json_object_set_new(settings, "/controller/type", json_string("fixed"));
}

static drape_status add_cell(lab *l, const space *s, const drape_integrator_ops *row, size_t cell,
                             int64_t first)
{
    int place[AXES];
    json_t *tags = json_pack("{s:s}", "integrator", row->entry.name),
           *settings = json_pack("{s:s}", "/integrator/method", row->entry.name);
    places_of(s, cell, place);
    lay_bare(l, s, row, settings);
    for (int a = 0; a < s->count; a++) {
        json_object_set_new(tags, s->axes[a].pointer, setting_value(&s->axes[a], place[a]));
        json_object_set_new(settings, s->axes[a].pointer, setting_value(&s->axes[a], place[a]));
    }
    int64_t same = same_cell(s, row, place);
    return lab_add_case(l, tags, settings, same < 0 ? -1 : first + same);
}

static bool is_usual(const char *name)
{
    for (size_t i = 0; i < sizeof usual / sizeof *usual; i++)
        if (strcmp(usual[i], name) == 0)
            return true;
    return false;
}

static drape_status check_twice(lab *l, const space *s)
{
    for (int a = 0; a < s->count; a++)
        for (int b = 0; b < a; b++)
            if (strcmp(s->axes[a].pointer, s->axes[b].pointer) == 0)
                return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "--axis \"%.100s\" is given twice",
                                  s->axes[a].pointer);
    return DRAPE_OK;
}

static drape_status read_space(lab *l, space *s)
{
    const drape_lab_def *def = l->def;
    if (def->axis_count < 2 || def->axis_count > AXES)
        return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "a map has 2 or 3 axes; %zu are given", def->axis_count);
    s->count = (int)def->axis_count;
    for (int a = 0; a < s->count; a++) {
        drape_status status = read_axis(l, def->axes[a], &s->axes[a]);
        if (!status)
            status = check_integers(l, &s->axes[a]);
        if (status)
            return status;
    }
    if (cells_of(s) > MOST_RUNS)
        return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "a map has at most %d points; the axes have %zu",
                          MOST_RUNS, cells_of(s));
    return check_twice(l, s);
}

/* The cell at the second place of every axis. */
static size_t second_of(const space *s)
{
    size_t cell = 0, stride = 1;
    for (int a = 0; a < s->count; a++) {
        cell += stride;
        stride *= (size_t)s->axes[a].count;
    }
    return cell;
}

/* The scene must compile at both ends of every axis, before hours are spent, and one step inside: an axis with integer
 * ends may have other numbers between. */
static drape_status try_ends(lab *l, size_t first, const space *s)
{
    const size_t ends[] = {first, first + second_of(s), first + cells_of(s) - 1};
    drape_status status = DRAPE_OK;
    for (size_t i = 0; i < sizeof ends / sizeof *ends && !status; i++)
        status = lab_try(l->ctx, l->def, json_object_get(json_array_get(l->cases, ends[i]), "settings"));
    return status;
}

static drape_status plan(lab *l)
{
    space s = {.count = 0};
    drape_status status = read_space(l, &s);
    if (!status)
        status = lab_check_integrators(l);
    json_t *axes = json_array();
    for (int a = 0; a < s.count; a++)
        json_array_append_new(axes, json_string(l->def->axes[a]));
    json_object_set_new(l->arguments, "axes", axes);
    json_object_set_new(l->arguments, "strain_limit", json_real(l->def->strain_limit));
    json_object_set_new(l->arguments, "case_seconds", json_real(l->def->case_seconds));
    for (int i = 0; !status && drape_integrators[i]; i++) {
        const drape_integrator_ops *row = drape_integrators[i];
        size_t first = json_array_size(l->cases);
        if (!lab_wants_integrator(l, row->entry.name, is_usual(row->entry.name)))
            continue;
        for (size_t cell = 0; cell < cells_of(&s) && !status; cell++)
            status = add_cell(l, &s, row, cell, (int64_t)first);
        if (!status)
            status = try_ends(l, first, &s);
    }
    return status;
}

/* ---- Verdicts ---- */

typedef enum verdict { CLEAN, REJECTIONS, STRAINED, STOPPED, EXPLODED, LATE, VERDICTS } verdict;

static const struct {
    const char *name;
    int colour;
} verdicts[VERDICTS] = {
    [CLEAN] = {"clean", 0x1a7f5a},
    [REJECTIONS] = {"with rejections", 0}, /* a scale */
    [STRAINED] = {"unphysical strain", 0xb07cc6},
    [STOPPED] = {"stopped", 0xf0a03c},
    [EXPLODED] = {"exploded", 0xc0392b},
    [LATE] = {"over budget", 0xb9bec6},
};

static double strain_limit(const lab *l)
{
    return lab_number(l->arguments, "strain_limit");
}

static verdict judge(const lab *l, const json_t *result)
{
    const drape_integrator_ops *row = lab_find_integrator(lab_tag_word(result, "integrator"));
    if (strcmp(lab_word(result, "status"), "over_budget") == 0)
        return LATE;
    if (!lab_is_good(result))
        return row && row->stability ? EXPLODED : STOPPED; /* explicit rows end because waves grow */
    if (lab_number(result, "strain_max") > strain_limit(l))
        return STRAINED;
    return lab_number(result, "rejected") > 0 ? REJECTIONS : CLEAN;
}

/* From green to sand by the logarithm of how many steps are rejected for one that is accepted: the ends of the scale. */
#define FEWEST 1e-3
#define MOST   1.0

static int colour_of_share(double share)
{
    const double pale = fmin(1, fmax(0, log(share / FEWEST) / log(MOST / FEWEST)));
    const int from[] = {0x4f, 0xa9, 0x7c}, to[] = {0xe4, 0xe0, 0xa8};
    int colour = 0;
    for (int k = 0; k < 3; k++)
        colour = colour << 8 | (int)lround(from[k] + pale * (to[k] - from[k]));
    return colour;
}

static int colour_of(const lab *l, const json_t *result)
{
    const verdict v = judge(l, result);
    return v == REJECTIONS
               ? colour_of_share(lab_number(result, "rejected") / fmax(1, lab_number(result, "accepted")))
               : verdicts[v].colour;
}

/* ---- Pictures ---- */

static const char *axis_name(const axis *a)
{
    return strrchr(a->pointer, '/') + 1;
}

/* "young_modulus [Pa]" */
static void axis_label(const axis *a, char *label, size_t size)
{
    const char *unit = lab_unit(a->pointer);
    snprintf(label, size, *unit ? "%.100s [%s]" : "%.100s", axis_name(a), unit);
}

/* Half a step to either side, in the axis' own measure. */
static void cell_bounds(const axis *a, int k, double *low, double *high)
{
    if (a->log) {
        double half = sqrt(pow(a->to / a->from, 1.0 / (a->count - 1)));
        *low = axis_value(a, k) / half;
        *high = axis_value(a, k) * half;
    } else {
        double half = 0.5 * (a->to - a->from) / (a->count - 1);
        *low = axis_value(a, k) - half;
        *high = axis_value(a, k) + half;
    }
}

/* The cells of one integrator and one place on the third axis. */
static void write_cells(const lab *l, const space *s, FILE *out, size_t first, int third)
{
    fprintf(out, "$cells << EOD\n");
    for (size_t cell = 0; cell < cells_of(s); cell++) {
        int place[AXES] = {0};
        double x[2], y[2];
        places_of(s, cell, place);
        if (s->count == AXES && place[2] != third)
            continue;
        cell_bounds(&s->axes[0], place[0], &x[0], &x[1]);
        cell_bounds(&s->axes[1], place[1], &y[0], &y[1]);
        fprintf(out, "%.9g %.9g %.9g %.9g %.9g %.9g %d\n", axis_value(&s->axes[0], place[0]),
                axis_value(&s->axes[1], place[1]), x[0], x[1], y[0], y[1],
                colour_of(l, l->results[first + cell]));
    }
    fprintf(out, "EOD\n");
}

/* Along the axis that is no step, where the step is the limit. */
static bool write_limit(const lab *l, const space *s, FILE *out, size_t first, int third)
{
    int step = strcmp(s->axes[0].pointer, "/integrator/dt") == 0   ? 0
               : strcmp(s->axes[1].pointer, "/integrator/dt") == 0 ? 1
                                                                   : -1;
    bool any = false;
    fprintf(out, "$limit << EOD\n");
    for (size_t cell = 0; step >= 0 && cell < cells_of(s); cell++) {
        int place[AXES] = {0};
        places_of(s, cell, place);
        double limit = lab_number(l->results[first + cell], "explicit_limit_s"),
               other = axis_value(&s->axes[1 - step], place[1 - step]);
        if (place[step] != 0 || (s->count == AXES && place[2] != third) || isnan(limit))
            continue;
        fprintf(out, "%.9g %.9g\n", step == 0 ? limit : other, step == 0 ? other : limit);
        any = true;
    }
    fprintf(out, "EOD\n");
    return any;
}

static void write_range(const axis *a, const char *name, FILE *out)
{
    double ends[4];
    char label[128];
    axis_label(a, label, sizeof label);
    cell_bounds(a, 0, &ends[0], &ends[1]);
    cell_bounds(a, a->count - 1, &ends[2], &ends[3]);
    double low = fmin(fmin(ends[0], ends[1]), fmin(ends[2], ends[3])),
           high = fmax(fmax(ends[0], ends[1]), fmax(ends[2], ends[3]));
    fprintf(out, "set %srange [%.9g:%.9g]\nset %slabel '%s' noenhanced\n", name, low, high, name, label);
    if (a->log)
        fprintf(out, "set logscale %s\nset format %s '10^{%%T}'\n", name, name);
}

static void write_swatch(FILE *out, int colour, const char *title)
{
    fprintf(out, ", NaN with points pt 5 ps 1.5 lc rgb '#%06x' title '%s'", colour, title);
}

/* A swatch for each verdict; of rejections the scale, where the map has some. */
static void write_legend(FILE *out, bool rejections)
{
    static const struct {
        double share;
        const char *title;
    } scale[] = {{1e-3, "1 rejected in 1 000 steps"}, {1e-2, "1 in 100"}, {1e-1, "1 in 10"}, {1, "1 a step"}};
    for (int v = 0; v < VERDICTS; v++)
        if (v != REJECTIONS)
            write_swatch(out, verdicts[v].colour, verdicts[v].name);
    for (size_t i = 0; rejections && i < sizeof scale / sizeof *scale; i++)
        write_swatch(out, colour_of_share(scale[i].share), scale[i].title);
}

static bool has_rejections(const lab *l, const space *s, size_t first)
{
    for (size_t cell = 0; cell < cells_of(s); cell++)
        if (judge(l, l->results[first + cell]) == REJECTIONS)
            return true;
    return false;
}

static void write_script(const lab *l, const space *s, FILE *out, const char *name, const char *title,
                         size_t first, int third)
{
    fprintf(out,
            "set terminal svg size 620,470 dynamic font 'sans-serif,13' background '#ffffff' name '%s'\n"
            "cd '%s'\nset output '%s.svg'\nset title '%s' noenhanced\nset key below\nset style fill solid 1 "
            "noborder\n",
            name, l->folder, name, title);
    write_range(&s->axes[0], "x", out);
    write_range(&s->axes[1], "y", out);
    write_cells(l, s, out, first, third);
    bool limited = write_limit(l, s, out, first, third);
    fprintf(out, "plot $cells using 1:2:3:4:5:6:7 with boxxyerror lc rgb variable notitle");
    write_legend(out, has_rejections(l, s, first));
    if (limited)
        fprintf(out, ", $limit with lines lw 2.5 lc rgb '#000000' title 'explicit limit 2/omega'");
    fprintf(out, "\n");
}

static drape_status draw(lab *l, const space *s, size_t first, int third)
{
    const char *row = lab_tag_word(l->results[first], "integrator");
    char name[96], title[320], picture[128], *script = NULL;
    size_t size = 0;
    bool drawn = false;
    FILE *out = open_memstream(&script, &size);
    if (!out)
        return drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for a picture");
    snprintf(name, sizeof name, s->count == AXES ? "map_%s_%d" : "map_%s", row, third);
    if (s->count == AXES)
        snprintf(title, sizeof title, "%s, %.100s = %.4g %s", row, axis_name(&s->axes[2]),
                 axis_value(&s->axes[2], third), lab_unit(s->axes[2].pointer));
    else
        snprintf(title, sizeof title, "%s", row);
    write_script(l, s, out, name, title, first, third);
    fclose(out);
    drape_status status = lab_plot(l, name, script, size, &drawn);
    free(script);
    snprintf(picture, sizeof picture, "%s.svg", name);
    return status || !drawn ? status : lab_page_picture(l, picture, title);
}

static void say(lab *l, const space *s, size_t first)
{
    int64_t count[VERDICTS] = {0};
    for (size_t cell = 0; cell < cells_of(s); cell++)
        count[judge(l, l->results[first + cell])]++;
    fprintf(l->words, "%s:", lab_tag_word(l->results[first], "integrator"));
    for (int v = 0, told = 0; v < VERDICTS; v++)
        if (count[v])
            fprintf(l->words, "%s %lld %s", told++ ? "," : "", (long long)count[v], verdicts[v].name);
    fprintf(l->words, "\n");
}

/* The axes of experiment.json: a merge has no def. */
static drape_status recall_space(lab *l, space *s)
{
    const json_t *axes = json_object_get(l->arguments, "axes");
    *s = (space){.count = (int)json_array_size(axes)};
    if (s->count < 2 || s->count > AXES)
        return drape_fail(l->ctx, DRAPE_E_PARSE, "experiment.json: a map has 2 or 3 axes");
    for (int a = 0; a < s->count; a++) {
        const char *text = json_string_value(json_array_get(axes, (size_t)a));
        drape_status status = read_axis(l, text ? text : "", &s->axes[a]);
        if (status)
            return status;
    }
    return DRAPE_OK;
}

static drape_status report(lab *l)
{
    space s;
    drape_status status = recall_space(l, &s);
    for (size_t first = 0; !status && first + cells_of(&s) <= l->count; first += cells_of(&s)) {
        int thirds = s.count == AXES ? s.axes[2].count : 1;
        say(l, &s, first);
        lab_page_heading(l, lab_tag_word(l->results[first], "integrator"));
        for (int third = 0; third < thirds && !status; third++)
            status = draw(l, &s, first, third);
    }
    return status;
}

const lab_experiment_ops lab_experiment_stability = {
    .entry = {.name = "stability", .summary = "maps of what happens over two or three values of the scene"},
    .plan = plan,
    .report = report,
};
