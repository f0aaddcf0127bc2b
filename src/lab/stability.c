/*
 * stability: maps. Values of the scene over two or three axes, every point with every integrator asked for:
 * the outcome is one of six, each with a colour. Where the first or second axis is the step of an explicit
 * integrator, its stability limit, as estimated at the start of each run, is drawn over the map.
 */
#include "base/param.h"
#include "lab/run.h"
#include "lab/text.h"

#include <math.h>
#include <string.h>

#define MAX_AXES 3
#define LONGEST  1024
#define MAX_RUNS 1000000

/* ---- Axes ---- */

/* "/integrator/dt=1e-4:1e-1:32log" */
typedef struct axis {
    char pointer[256];
    double from, to;
    int count;
    bool log;
} axis;

static drape_status wrong_axis(lab *l, const char *text, const char *why)
{
    return drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                      "--axis \"%.100s\": %s; must be /pointer=from:to:n or ...:nlog", text, why);
}

static drape_status read_axis(lab *l, const char *text, axis *a)
{
    const char *equals = strchr(text, '=');
    int used = 0;
    char rest[8] = "";
    if (*text != '/' || !equals || (size_t)(equals - text) >= sizeof a->pointer)
        return wrong_axis(l, text, "a pointer is needed");
    memcpy(a->pointer, text, (size_t)(equals - text));
    a->pointer[equals - text] = 0;
    if (sscanf(equals + 1, "%lf:%lf:%d%n%7s", &a->from, &a->to, &a->count, &used, rest) < 3 || used == 0)
        return wrong_axis(l, text, "three numbers are needed");
    a->log = strcmp(rest, "log") == 0;
    if (*rest && !a->log)
        return wrong_axis(l, text, "only log may follow the count");
    if (!isfinite(a->from) || !isfinite(a->to) || a->from == a->to)
        return wrong_axis(l, text, "from and to must be different numbers");
    if (a->log && !(a->from > 0 && a->to > 0))
        return wrong_axis(l, text, "a logarithmic axis needs positive numbers");
    if (a->count < 2 || a->count > LONGEST)
        return wrong_axis(l, text, "n must be 2 to 1024");
    return DRAPE_OK;
}

static double axis_value(const axis *a, int k)
{
    const double share = (double)k / (a->count - 1);
    return a->log ? a->from * pow(a->to / a->from, share) : a->from + share * (a->to - a->from);
}

/* Half a step to either side, in logarithms on a logarithmic axis. */
static void cell_bounds(const axis *a, int k, double *low, double *high)
{
    const double value = axis_value(a, k);
    if (a->log) {
        const double half = sqrt(pow(a->to / a->from, 1.0 / (a->count - 1)));
        *low = value / half;
        *high = value * half;
    } else {
        const double half = 0.5 * (a->to - a->from) / (a->count - 1);
        *low = value - half;
        *high = value + half;
    }
}

/* Whether the scene takes an integer there, as the resolution of a mesh. */
static bool is_integer_axis(const axis *a)
{
    static const char *const integers[] = {"/columns",  "/rows",      "/edges",
                                           "/substeps", "/max_order", "/max_iterations"};
    for (size_t i = 0; i < sizeof integers / sizeof *integers; i++)
        if (strcmp(strrchr(a->pointer, '/'), integers[i]) == 0)
            return true;
    return false;
}

/* The value that is run and recorded; powers are integers up to rounding. */
static json_t *setting_value(const axis *a, int k)
{
    const double value = axis_value(a, k);
    return is_integer_axis(a) ? json_integer((json_int_t)llround(value)) : json_real(value);
}

/* Refuses an axis of an integer value with fractions: they would be rounded, and the map would show wrong
 * values. */
static drape_status check_integers(lab *l, const axis *a)
{
    for (int k = 0; is_integer_axis(a) && k < a->count; k++) {
        double value = axis_value(a, k);
        if (!(fabs(value) < 1e15) || fabs(value - round(value)) > 1e-9 * fmax(1, fabs(value)))
            return drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                              "--axis \"%.100s\": its value %d would be %.6g, but must be an integer",
                              a->pointer, k + 1, value);
    }
    return DRAPE_OK;
}

/* ---- The cases ---- */

typedef struct space {
    axis axes[MAX_AXES];
    int count;
    size_t cells; /* of all axes; the first axis runs fastest */
} space;

/* The indices of a cell along each axis. */
static void indices_of(const space *s, size_t cell, int *indices)
{
    for (int a = 0; a < s->count; a++) {
        indices[a] = (int)(cell % (size_t)s->axes[a].count);
        cell /= (size_t)s->axes[a].count;
    }
}

/* Reads axes whose texts have been counted. */
static drape_status read_axes(lab *l, const char *const *texts, space *s)
{
    drape_status status = DRAPE_OK;
    s->cells = 1;
    for (int a = 0; !status && a < s->count; a++) {
        status = read_axis(l, texts[a], &s->axes[a]);
        s->cells *= (size_t)s->axes[a].count;
    }
    return status;
}

static drape_status read_space(lab *l, space *s)
{
    const drape_lab_def *def = l->def;
    if (def->axis_count < 2 || def->axis_count > MAX_AXES)
        return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "a map has 2 or 3 axes; %zu are given", def->axis_count);
    *s = (space){.count = (int)def->axis_count};
    drape_status status = read_axes(l, def->axes, s);
    for (int a = 0; !status && a < s->count; a++)
        status = check_integers(l, &s->axes[a]);
    if (status)
        return status;
    if (s->cells > MAX_RUNS)
        return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "a map has at most %d points; the axes have %zu",
                          MAX_RUNS, s->cells);
    for (int a = 0; a < s->count; a++)
        for (int b = 0; b < a; b++)
            if (strcmp(s->axes[a].pointer, s->axes[b].pointer) == 0)
                return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "--axis \"%.100s\" is given twice",
                                  s->axes[a].pointer);
    return DRAPE_OK;
}

/* Whether the command line, or an axis, sets the value at the pointer. */
static bool is_set(const lab *l, const space *s, const char *pointer)
{
    for (size_t i = 0; i < l->def->setting_count; i++)
        if (strcmp(l->def->settings[i].pointer, pointer) == 0)
            return true;
    for (int a = 0; a < s->count; a++)
        if (strcmp(s->axes[a].pointer, pointer) == 0)
            return true;
    return false;
}

/* Adds a cell of the map whose first case is `first`. Where the integrator ignores an axis, the cell has the
 * result of the first one along it. */
static drape_status add_cell(lab *l, const space *s, const drape_integrator_ops *integrator, size_t cell,
                             size_t first)
{
    int index[MAX_AXES];
    size_t same = first, stride = 1;
    bool repeated = false;
    json_t *tags = json_pack("{s:s}", "integrator", integrator->entry.name),
           *settings = json_pack("{s:s}", "/integrator/method", integrator->entry.name);
    /* By default an explicit integrator takes as many substeps as its limit asks for, and the controller
     * retries steps that fail. A map is to show the limit: one substep a step and no retries, unless they are
     * asked for. */
    if (integrator->stability && !is_set(l, s, "/integrator/substeps") &&
        drape_param_find(integrator->entry.params, integrator->entry.param_count, "substeps") >= 0)
        json_object_set_new(settings, "/integrator/substeps", json_integer(1));
    if (integrator->stability && !is_set(l, s, "/controller/type"))
        json_object_set_new(settings, "/controller/type", json_string("fixed"));
    indices_of(s, cell, index);
    for (int a = 0; a < s->count; a++) {
        const axis *one = &s->axes[a];
        const bool ignored = lab_ignores(integrator, one->pointer);
        json_object_set_new(tags, one->pointer, setting_value(one, index[a]));
        json_object_set_new(settings, one->pointer, setting_value(one, index[a]));
        same += ignored ? 0 : stride * (size_t)index[a];
        repeated |= ignored && index[a] > 0;
        stride *= (size_t)one->count;
    }
    return lab_add_case(l, tags, settings, repeated ? (int64_t)same : -1);
}

/* Before hours are spent, checks that the scene compiles at both ends of every axis and one step inside, as
 * an axis with integer ends may have fractions between. */
static drape_status try_ends(lab *l, size_t first, const space *s)
{
    size_t inside = 0, stride = 1;
    drape_status status = DRAPE_OK;
    for (int a = 0; a < s->count; a++) {
        inside += stride;
        stride *= (size_t)s->axes[a].count;
    }
    const size_t cells[] = {0, inside, s->cells - 1};
    for (size_t i = 0; i < sizeof cells / sizeof *cells && !status; i++)
        status =
            lab_try(l->ctx, l->def, json_object_get(json_array_get(l->cases, first + cells[i]), "settings"));
    return status;
}

static bool is_default(const char *integrator)
{
    static const char *const names[] = {"be", "bdf2", "ida", "verlet"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strcmp(names[i], integrator) == 0)
            return true;
    return false;
}

static drape_status plan(lab *l)
{
    space s;
    drape_status status = read_space(l, &s);
    if (!status)
        status = lab_check_integrators(l);
    if (status)
        return status;
    json_t *axes = json_array();
    for (int a = 0; a < s.count; a++)
        json_array_append_new(axes, json_string(l->def->axes[a]));
    json_object_set_new(l->arguments, "axes", axes);
    json_object_set_new(l->arguments, "strain_limit", json_real(l->def->strain_limit));
    json_object_set_new(l->arguments, "case_seconds", json_real(l->def->case_seconds));
    for (int i = 0; !status && drape_integrators[i]; i++) {
        const drape_integrator_ops *integrator = drape_integrators[i];
        const size_t first = json_array_size(l->cases);
        if (!lab_wants_integrator(l, integrator->entry.name, is_default(integrator->entry.name)))
            continue;
        for (size_t cell = 0; cell < s.cells && !status; cell++)
            status = add_cell(l, &s, integrator, cell, first);
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

static verdict judge(const lab *l, const json_t *result)
{
    const drape_integrator_ops *integrator = lab_find_integrator(lab_tag_text(result, "integrator"));
    if (strcmp(lab_text(result, "status"), "over_budget") == 0)
        return LATE;
    if (!lab_is_good(result)) /* explicit integrators stop because waves grow */
        return integrator && integrator->stability ? EXPLODED : STOPPED;
    if (lab_number(result, "strain_max") > lab_number(l->arguments, "strain_limit"))
        return STRAINED;
    return lab_number(result, "rejected") > 0 ? REJECTIONS : CLEAN;
}

/* From green to sand, by the logarithm of the rejected steps per accepted one, 1e-3 to 1. */
static int colour_of_share(double share)
{
    const double fewest = 1e-3, most = 1, pale = fmin(1, fmax(0, log(share / fewest) / log(most / fewest)));
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

/* A map: an integrator, and an index on the third axis. */
typedef struct map {
    const lab *l;
    const space *s;
    size_t first; /* case */
    int third;
    FILE *out;
} map;

/* Whether a cell is on the map; its indices. */
static bool is_on(const map *m, size_t cell, int *index)
{
    indices_of(m->s, cell, index);
    return m->s->count < MAX_AXES || index[2] == m->third;
}

static void write_cells(const map *m)
{
    const axis *x = &m->s->axes[0], *y = &m->s->axes[1];
    fprintf(m->out, "$cells << EOD\n");
    for (size_t cell = 0; cell < m->s->cells; cell++) {
        int index[MAX_AXES];
        double left, right, bottom, top;
        if (!is_on(m, cell, index))
            continue;
        cell_bounds(x, index[0], &left, &right);
        cell_bounds(y, index[1], &bottom, &top);
        fprintf(m->out, "%.9g %.9g %.9g %.9g %.9g %.9g %d\n", axis_value(x, index[0]),
                axis_value(y, index[1]), left, right, bottom, top,
                colour_of(m->l, m->l->results[m->first + cell]));
    }
    fprintf(m->out, "EOD\n");
}

/* The stability limit of the step along the other axis. false: there is none. */
static bool write_limit(const map *m)
{
    const axis *axes = m->s->axes;
    const int step = strcmp(axes[0].pointer, "/integrator/dt") == 0   ? 0
                     : strcmp(axes[1].pointer, "/integrator/dt") == 0 ? 1
                                                                      : -1;
    bool any = false;
    fprintf(m->out, "$limit << EOD\n");
    for (size_t cell = 0; step >= 0 && cell < m->s->cells; cell++) {
        int index[MAX_AXES];
        const double limit = lab_number(m->l->results[m->first + cell], "explicit_limit_s");
        if (!is_on(m, cell, index) || index[step] != 0 || isnan(limit))
            continue;
        const double other = axis_value(&axes[1 - step], index[1 - step]);
        fprintf(m->out, "%.9g %.9g\n", step == 0 ? limit : other, step == 0 ? other : limit);
        any = true;
    }
    fprintf(m->out, "EOD\n");
    return any;
}

static const char *axis_name(const axis *a)
{
    return strrchr(a->pointer, '/') + 1;
}

/* Range, scale and label, as "young_modulus [Pa]", of gnuplot's axis of that name. */
static void write_axis(const axis *a, const char *name, FILE *out)
{
    double ends[4];
    const char *unit = lab_unit(a->pointer);
    cell_bounds(a, 0, &ends[0], &ends[1]);
    cell_bounds(a, a->count - 1, &ends[2], &ends[3]);
    fprintf(out, "set %srange [%.9g:%.9g]\n", name, fmin(fmin(ends[0], ends[1]), fmin(ends[2], ends[3])),
            fmax(fmax(ends[0], ends[1]), fmax(ends[2], ends[3])));
    fprintf(out, *unit ? "set %slabel '%.100s [%s]' noenhanced\n" : "set %slabel '%.100s' noenhanced\n", name,
            axis_name(a), unit);
    if (a->log)
        fprintf(out, "set logscale %s\nset format %s '10^{%%T}'\n", name, name);
}

static void write_swatch(FILE *out, int colour, const char *title)
{
    fprintf(out, ", NaN with points pt 5 ps 1.5 lc rgb '#%06x' title '%s'", colour, title);
}

/* A swatch for each verdict; for rejections the scale, where the integrator has some. */
static void write_legend(const map *m)
{
    static const struct {
        double share;
        const char *title;
    } scale[] = {{1e-3, "1 rejected in 1 000 steps"}, {1e-2, "1 in 100"}, {1e-1, "1 in 10"}, {1, "1 a step"}};
    bool rejections = false;
    for (size_t cell = 0; cell < m->s->cells && !rejections; cell++)
        rejections = judge(m->l, m->l->results[m->first + cell]) == REJECTIONS;
    for (int v = 0; v < VERDICTS; v++)
        if (v != REJECTIONS)
            write_swatch(m->out, verdicts[v].colour, verdicts[v].name);
    for (size_t i = 0; rejections && i < sizeof scale / sizeof *scale; i++)
        write_swatch(m->out, colour_of_share(scale[i].share), scale[i].title);
}

static drape_status draw(lab *l, const space *s, size_t first, int third)
{
    const char *integrator = lab_tag_text(l->results[first], "integrator");
    char name[96], title[320];
    lab_plot plot;
    snprintf(name, sizeof name, s->count == MAX_AXES ? "map_%s_%d" : "map_%s", integrator, third);
    if (s->count == MAX_AXES)
        snprintf(title, sizeof title, "%s, %.100s = %.4g %s", integrator, axis_name(&s->axes[2]),
                 axis_value(&s->axes[2], third), lab_unit(s->axes[2].pointer));
    else
        snprintf(title, sizeof title, "%s", integrator);
    drape_status status = lab_plot_begin(l, &plot, name, 620, 470);
    if (status)
        return status;
    const map m = {l, s, first, third, plot.script};
    fprintf(m.out, "set title '%s' noenhanced\nset key below\nset style fill solid 1 noborder\n", title);
    write_axis(&s->axes[0], "x", m.out);
    write_axis(&s->axes[1], "y", m.out);
    write_cells(&m);
    const bool limited = write_limit(&m);
    fprintf(m.out, "plot $cells using 1:2:3:4:5:6:7 with boxxyerror lc rgb variable notitle");
    write_legend(&m);
    if (limited)
        fprintf(m.out, ", $limit with lines lw 2.5 lc rgb '#000000' title 'explicit limit 2/omega'");
    fprintf(m.out, "\n");
    return lab_plot_end(l, &plot, true, title);
}

/* A summary and the maps of each integrator. The axes are those of experiment.json: a merge has no def. */
static drape_status report(lab *l)
{
    const json_t *axes = json_object_get(l->arguments, "axes");
    space s = {.count = (int)json_array_size(axes)};
    const char *texts[MAX_AXES];
    if (s.count < 2 || s.count > MAX_AXES)
        return drape_fail(l->ctx, DRAPE_E_PARSE, "experiment.json: a map has 2 or 3 axes");
    for (int a = 0; a < s.count; a++) {
        const char *text = json_string_value(json_array_get(axes, (size_t)a));
        texts[a] = text ? text : "";
    }
    drape_status status = read_axes(l, texts, &s);
    for (size_t first = 0; !status && first + s.cells <= l->count; first += s.cells) {
        const char *integrator = lab_tag_text(l->results[first], "integrator"), *comma = "";
        int64_t count[VERDICTS] = {0};
        for (size_t cell = 0; cell < s.cells; cell++)
            count[judge(l, l->results[first + cell])]++;
        fprintf(l->summary, "%s:", integrator);
        for (int v = 0; v < VERDICTS; v++)
            if (count[v]) {
                fprintf(l->summary, "%s %lld %s", comma, (long long)count[v], verdicts[v].name);
                comma = ",";
            }
        fprintf(l->summary, "\n");
        lab_page_heading(l, integrator);
        for (int third = 0; third < (s.count == MAX_AXES ? s.axes[2].count : 1) && !status; third++)
            status = draw(l, &s, first, third);
    }
    return status;
}

const lab_experiment_ops lab_experiment_stability = {
    .entry = {.name = "stability", .summary = "maps of what happens over two or three values of the scene"},
    .plan = plan,
    .report = report,
};
