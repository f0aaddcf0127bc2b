/*
 * stability: maps. Values of the scene over one to three axes, every point with every integrator asked
 * for: the outcome is one of a few, each with a colour. Over a single axis all integrators share one
 * figure, a row each. Where the first or second axis is the step of an explicit integrator, its
 * stability limit, as estimated at the start of each run, is drawn over the map.
 */
#include "base/param.h"
#include "lab/figure.h"
#include "lab/sweep.h"
#include "lab/text.h"
#include "sim/warnings.h"

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
    return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "axis \"%.100s\": %s; must be /pointer=from:to:n or ...:nlog",
                      text, why);
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
                              "axis \"%.100s\": its value %d would be %.6g, but must be an integer",
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
    if (def->axis_count < 1 || def->axis_count > MAX_AXES)
        return drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                          "a map has 1 to 3 axes, such as \"/integrator/dt=1e-3:1e-1:9log\"; %zu are given",
                          def->axis_count);
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
                return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "axis \"%.100s\" is given twice",
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
    for (size_t i = 0; i < sizeof cells / sizeof *cells && !status; i++) {
        const lab_request request = lab_request_of(l, first + cells[i]);
        status = lab_try(l->ctx, &request);
    }
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

typedef enum verdict { CLEAN, FEW, SOME, MANY, SHORT, STRAINED, STOPPED, EXPLODED, LATE, VERDICTS } verdict;

#define TEXT(x)   #x
#define NUMBER(x) TEXT(x)

/* Without rejections, and with ever more of them: shades of one blue. */
static const struct {
    const char *name;
    int colour;
} verdicts[VERDICTS] = {
    [CLEAN] = {"none rejected", LAB_BLUE},
    [FEW] = {"up to 1/100 rejected", 0x4c9ccb},
    [SOME] = {"up to 1/10 rejected", 0x93c4e2},
    [MANY] = {"over 1/10 rejected", 0xd3e6f3},
    [SHORT] = {"fewer than " NUMBER(DRAPE_FEW_STEPS) " steps", LAB_YELLOW},
    [STRAINED] = {"unphysical strain", LAB_PURPLE},
    [STOPPED] = {"stopped", LAB_ORANGE},
    [EXPLODED] = {"exploded", LAB_RED},
    [LATE] = {"over budget", LAB_DARK},
};

static verdict judge(const lab *l, const json_t *result)
{
    const drape_integrator_ops *integrator = lab_find_integrator(lab_tag_text(result, "integrator"));
    const double accepted = lab_number(result, "accepted");
    const double share = lab_number(result, "rejected") / fmax(1, accepted);
    if (strcmp(lab_text(result, "status"), "over_budget") == 0)
        return LATE;
    if (!lab_is_good(result)) /* explicit integrators stop because waves grow */
        return integrator && integrator->stability ? EXPLODED : STOPPED;
    if (lab_number(result, "strain_max") > lab_number(l->arguments, "strain_limit"))
        return STRAINED;
    if (accepted < DRAPE_FEW_STEPS) /* what grows has no time to */
        return SHORT;
    return share <= 0 ? CLEAN : share <= 0.01 ? FEW : share <= 0.1 ? SOME : MANY;
}

/* ---- Figures ---- */

/* What one figure shows: the cells of an integrator, at an index on the third axis, or those of all
 * integrators over a single axis. */
typedef struct map {
    const lab *l;
    const space *s;
    size_t first; /* case */
    int third;
    bool seen[VERDICTS];
    int limits; /* drawn so far */
    lab_figure f;
} map;

/* Whether a cell is on the map; its indices. */
static bool is_on(const map *m, size_t cell, int *index)
{
    indices_of(m->s, cell, index);
    return m->s->count < MAX_AXES || index[2] == m->third;
}

/* A row of cells, in which neighbours of one colour are one box. first: its first case. */
static void write_row(map *m, size_t first, double bottom, double top)
{
    const axis *x = &m->s->axes[0];
    double left, right, from = 0;
    for (int i = 0; i < x->count; i++) {
        const verdict v = judge(m->l, m->l->results[first + (size_t)i]);
        const bool begins = i == 0 || v != judge(m->l, m->l->results[first + (size_t)i - 1]);
        const bool ends = i + 1 == x->count || v != judge(m->l, m->l->results[first + (size_t)i + 1]);
        cell_bounds(x, i, &left, &right);
        from = begins ? left : from;
        m->seen[v] = true;
        if (ends)
            fprintf(m->f.script, "%.9g %.9g %.9g %.9g %.9g %.9g %d\n", from, bottom, from, right, bottom, top,
                    verdicts[v].colour);
    }
}

static const char *axis_name(const axis *a)
{
    return strrchr(a->pointer, '/') + 1;
}

/* Range, scale and label, as "young_modulus [Pa]". */
static void set_axis(const axis *a, lab_axis *out)
{
    double ends[4];
    const char *unit = lab_unit(a->pointer);
    cell_bounds(a, 0, &ends[0], &ends[1]);
    cell_bounds(a, a->count - 1, &ends[2], &ends[3]);
    out->from = fmin(fmin(ends[0], ends[1]), fmin(ends[2], ends[3]));
    out->to = fmax(fmax(ends[0], ends[1]), fmax(ends[2], ends[3]));
    out->log = a->log;
    snprintf(out->label, sizeof out->label, *unit ? "%.80s [%s]" : "%.80s", axis_name(a), unit);
}

/* A black line on a white one is seen on every colour. */
static void draw_limit(map *m, int block)
{
    lab_figure_curve(&m->f, block, (lab_style){LAB_WHITE, 1, 0}, NULL);
    lab_figure_curve(&m->f, block, (lab_style){LAB_BLACK, 2, 0},
                     m->limits++ ? NULL : "explicit limit 2/omega");
}

/* The index of the axis that is the step; -1: none is. */
static int step_axis(const space *s)
{
    for (int a = 0; a < s->count; a++)
        if (strcmp(s->axes[a].pointer, "/integrator/dt") == 0)
            return a;
    return -1;
}

/* The stability limit of the step, where one of the two axes is the step, along the other. */
static void add_limit(map *m)
{
    const axis *axes = m->s->axes;
    const int step = step_axis(m->s);
    bool any = false;
    if (step < 0 || step > 1)
        return;
    const int block = lab_figure_data(&m->f);
    for (size_t cell = 0; cell < m->s->cells; cell++) {
        int index[MAX_AXES];
        const double limit = lab_number(m->l->results[m->first + cell], "explicit_limit_s");
        if (!is_on(m, cell, index) || index[step] != 0 || isnan(limit))
            continue;
        const double other = axis_value(&axes[1 - step], index[1 - step]);
        fprintf(m->f.script, "%.9g %.9g\n", step == 0 ? limit : other, step == 0 ? other : limit);
        any = true;
    }
    lab_figure_data_end(&m->f);
    if (any)
        draw_limit(m, block);
}

/* A swatch for each verdict that is on the figure. */
static drape_status end_map(lab *l, map *m, const char *caption)
{
    for (int v = 0; v < VERDICTS; v++)
        if (m->seen[v])
            lab_figure_swatch(&m->f, verdicts[v].colour, verdicts[v].name);
    return lab_figure_end(l, &m->f, caption);
}

static drape_status draw_map(lab *l, const space *s, size_t first, int third)
{
    const char *integrator = lab_tag_text(l->results[first], "integrator");
    const axis *y = &s->axes[1];
    char name[96];
    map m = {.l = l, .s = s, .first = first, .third = third};
    snprintf(name, sizeof name, s->count == MAX_AXES ? "map_%s_%d" : "map_%s", integrator, third);
    drape_status status = lab_figure_begin(l, &m.f, name);
    if (status)
        return status;
    snprintf(m.f.title, sizeof m.f.title, s->count == MAX_AXES ? "%s, %.80s = %.4g %s" : "%s", integrator,
             axis_name(&s->axes[s->count - 1]), axis_value(&s->axes[s->count - 1], third),
             lab_unit(s->axes[s->count - 1].pointer));
    set_axis(&s->axes[0], &m.f.axes[0]);
    set_axis(y, &m.f.axes[1]);
    const int block = lab_figure_data(&m.f);
    for (int row = 0; row < y->count; row++) {
        double bottom, top;
        cell_bounds(y, row, &bottom, &top);
        write_row(&m, first + (size_t)s->axes[0].count * (size_t)(row + third * y->count), bottom, top);
    }
    lab_figure_data_end(&m.f);
    lab_figure_boxes(&m.f, block);
    add_limit(&m);
    return end_map(l, &m, m.f.title);
}

/* All integrators over a single axis, a row each, the first on top. */
static drape_status draw_rows(lab *l, const space *s)
{
    const size_t rows = l->count / s->cells;
    map m = {.l = l, .s = s};
    const char **names = drape_arena_take(&l->arena, rows, sizeof *names);
    drape_status status = names ? lab_figure_begin(l, &m.f, "map") : DRAPE_E_MEMORY;
    if (status)
        return status;
    set_axis(&s->axes[0], &m.f.axes[0]);
    m.f.axes[1] = (lab_axis){.from = -0.5, .to = (double)rows - 0.5, .names = names, .name_count = (int)rows};
    m.f.plot_height = 6.0 * (double)rows;
    const int block = lab_figure_data(&m.f);
    for (size_t k = 0; k < rows; k++) {
        names[rows - 1 - k] = lab_tag_text(l->results[k * s->cells], "integrator");
        const double y = (double)(rows - 1 - k);
        write_row(&m, k * s->cells, y - 0.45, y + 0.45);
    }
    lab_figure_data_end(&m.f);
    lab_figure_boxes(&m.f, block);
    for (size_t k = 0; k < rows && step_axis(s) == 0; k++) {
        const double limit = lab_number(l->results[k * s->cells], "explicit_limit_s"),
                     y = (double)(rows - 1 - k);
        if (isnan(limit))
            continue;
        const int line = lab_figure_data(&m.f);
        fprintf(m.f.script, "%.9g %.9g\n%.9g %.9g\n", limit, y - 0.45, limit, y + 0.45);
        lab_figure_data_end(&m.f);
        draw_limit(&m, line);
    }
    return end_map(l, &m, "what happened to each integrator");
}

/* A summary and the maps of each integrator. The axes are those of experiment.json: a merge has no def. */
static drape_status report(lab *l)
{
    const json_t *axes = json_object_get(l->arguments, "axes");
    space s = {.count = (int)json_array_size(axes)};
    const char *texts[MAX_AXES];
    if (s.count < 1 || s.count > MAX_AXES)
        return drape_fail(l->ctx, DRAPE_E_PARSE, "experiment.json: a map has 1 to 3 axes");
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
        if (s.count > 1)
            lab_page_heading(l, integrator);
        for (int third = 0; s.count > 1 && third < (s.count == MAX_AXES ? s.axes[2].count : 1) && !status;
             third++)
            status = draw_map(l, &s, first, third);
    }
    return !status && s.count == 1 ? draw_rows(l, &s) : status;
}

const lab_experiment_ops lab_experiment_stability = {
    .entry = {.name = "stability", .summary = "maps of what happens over one to three values of the scene"},
    .plan = plan,
    .report = report,
};
