/*
 * stability: maps. Values of the scene over one to three axes, every point with every integrator asked
 * for: the outcome is one of a few, each with a colour. Further figures show results in colours. Over a
 * single axis all integrators share one figure, a row each, and results are curves. Where the first or second
 * axis is the step of an explicit integrator, its stability limit, as estimated at the start of each run, is
 * drawn over the map.
 */
#include "base/retired.h"
#include "lab/engine.h"
#include "lab/engine_output.h"
#include "lab/figure.h"
#include "sim/warnings.h"

#include <math.h>
#include <string.h>

#define MAX_AXES 3
#define LONGEST  1024
#define MAX_RUNS 1000000

/* ---- What figures show ---- */

/* A result of a case that is a number: a column of results.csv that a map or a curve can show. */
typedef struct lab_quantity {
    drape_entry entry; /* name and meaning */
    const char *unit;  /* "": none */
} lab_quantity;

#define QUANTITY(id, unit_text, text)                                                                        \
    &((const lab_quantity){.entry = {.name = id, .summary = text}, .unit = unit_text}).entry

static const drape_entry *const entries[] = {
    QUANTITY("energy_drift", "", "energy that the method gained (negative) or lost / largest kinetic energy"),
    QUANTITY("energy_numerical_J", "J", "energy that the method gained (negative) or lost"),
    QUANTITY("strain_max", "", "largest strain of an edge"),
    QUANTITY("strain_min", "", "smallest strain of an edge"),
    QUANTITY("accepted", "", "accepted steps"),
    QUANTITY("rejected", "", "rejected attempts at steps"),
    QUANTITY("rejected_share", "", "rejected attempts / all attempts"),
    QUANTITY("unconverged", "", "steps accepted although they had not converged"),
    QUANTITY("iterations", "", "iterations of Newton's method"),
    QUANTITY("iterations_per_step", "", "iterations of Newton's method / accepted steps"),
    QUANTITY("residuals", "", "evaluations of the residual"),
    QUANTITY("jacobians", "", "Jacobian matrices"),
    QUANTITY("factorizations", "", "factorisations"),
    QUANTITY("linear_iterations", "", "iterations of the linear solver"),
    QUANTITY("cpu_s", "s", "CPU time of the steps"),
    QUANTITY("wall_s", "s", "wall-clock time of the steps"),
    QUANTITY("h_min_s", "s", "smallest accepted step"),
    QUANTITY("h_max_s", "s", "largest accepted step"),
    QUANTITY("explicit_limit_s", "s", "stability limit of an explicit method at the start"),
    NULL,
};

static const drape_registry quantities = {
    .noun = "result", .key = "results", .title = "Results", .place = "", .entries = entries};

/* ---- Axes ---- */

/* "/integrator/dt=1e-4:1e-1:32log" */
typedef struct axis {
    char pointer[256];
    lab_axis ends; /* the first and the last value */
    int count;
} axis;

static drape_status wrong_axis(lab *l, const char *text, const char *why)
{
    return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "axis \"%.100s\": %s; must be /pointer=from:to:n or ...:nlog",
                      text, why);
}

static drape_status read_axis(lab *l, const char *text, axis *a)
{
    const char *equals = strchr(text, '=');
    char rest[8] = "";
    if (*text != '/' || !equals || (size_t)(equals - text) >= sizeof a->pointer)
        return wrong_axis(l, text, "a pointer is needed");
    memcpy(a->pointer, text, (size_t)(equals - text));
    a->pointer[equals - text] = 0;
    if (drape_is_retired(a->pointer))
        return wrong_axis(l, text, "the setting has no effect any more");
    lab_axis *ends = &a->ends;
    const char *at = drape_number_read(equals + 1, &ends->from);
    at = at && *at == ':' ? drape_number_read(at + 1, &ends->to) : NULL;
    if (!at || sscanf(at, ":%d%7s", &a->count, rest) < 1)
        return wrong_axis(l, text, "three numbers are needed");
    ends->log = strcmp(rest, "log") == 0;
    if (*rest && !ends->log)
        return wrong_axis(l, text, "only log may follow the count");
    if (ends->from == ends->to)
        return wrong_axis(l, text, "from and to must be different numbers");
    if (ends->log && !(ends->from > 0 && ends->to > 0))
        return wrong_axis(l, text, "a logarithmic axis needs positive numbers");
    if (a->count < 2 || a->count > LONGEST)
        return wrong_axis(l, text, "n must be 2 to 1024");
    return DRAPE_OK;
}

static double axis_value(const axis *a, double k)
{
    return lab_axis_value(&a->ends, k / (a->count - 1));
}

/* Half a step to either side, in logarithms on a logarithmic axis. */
static void cell_bounds(const axis *a, int k, double *low, double *high)
{
    *low = axis_value(a, k - 0.5);
    *high = axis_value(a, k + 0.5);
}

static bool is_among(const char *name, const char *const *names)
{
    while (*names && strcmp(*names, name) != 0)
        names++;
    return *names != NULL;
}

/* Whether the scene takes an integer there, as the resolution of a mesh. */
static bool is_integer_axis(const axis *a)
{
    static const char *const integers[] = {"/columns",   "/rows",           "/edges", "/substeps",
                                           "/max_order", "/max_iterations", NULL};
    return is_among(strrchr(a->pointer, '/'), integers);
}

/* The value that is run and recorded; powers are integers up to rounding. */
static json_t *setting_value(const axis *a, int k)
{
    const double value = axis_value(a, k);
    return is_integer_axis(a) ? json_integer((json_int_t)llround(value)) : json_real(value);
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

/* The axes are those of l->arguments: a merge has no def. */
static drape_status read_space(lab *l, space *s)
{
    const json_t *axes = json_object_get(l->arguments, "axes");
    *s = (space){.count = (int)json_array_size(axes), .cells = 1};
    if (s->count < 1 || s->count > MAX_AXES)
        return drape_fail(l->ctx, DRAPE_E_PARSE, "experiment.json: a map has 1 to 3 axes");
    for (int a = 0; a < s->count; a++) {
        DRAPE_TRY(read_axis(l, json_string_value(json_array_get(axes, (size_t)a)), &s->axes[a]));
        s->cells *= (size_t)s->axes[a].count;
    }
    return DRAPE_OK;
}

/* What the axes of a def must be besides: an axis of an integer value with fractions would be rounded, and
 * the map would show wrong values. */
static drape_status check_space(lab *l, const space *s)
{
    for (int i = 0; i < s->count; i++) {
        const axis *a = &s->axes[i];
        for (int k = 0; is_integer_axis(a) && k < a->count; k++) {
            const double value = axis_value(a, k);
            if (!(fabs(value) < 1e15) || fabs(value - round(value)) > 1e-9 * fmax(1, fabs(value)))
                return drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                                  "axis \"%.100s\": its value %d would be %.6g, but must be an integer",
                                  a->pointer, k + 1, value);
        }
        for (int k = 0; k < i; k++)
            if (strcmp(a->pointer, s->axes[k].pointer) == 0)
                return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "axis \"%.100s\" is given twice", a->pointer);
    }
    return s->cells <= MAX_RUNS
               ? DRAPE_OK
               : drape_fail(l->ctx, DRAPE_E_ARGUMENT, "a map has at most %d points; the axes have %zu",
                            MAX_RUNS, s->cells);
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

/* Adds a cell of the map whose first case is `first`. Where the integrator ignores an axis, the cell has
 * the result of the first one along it. */
static drape_status add_cell(lab *l, const space *s, const drape_integrator_ops *integrator, size_t cell,
                             size_t first)
{
    int index[MAX_AXES];
    size_t same = first, stride = 1;
    bool repeated = false;
    json_t *tags = json_pack("{s:s}", "integrator", integrator->entry.name),
           *settings = json_pack("{s:s}", "/integrator/method", integrator->entry.name);
    /* By default an explicit integrator takes as many substeps as its limit asks for, and the controller
     * retries steps that fail. A map is to show the limit: one substep a step and no retries, unless they
     * are asked for. */
    if (integrator->stability && !is_set(l, s, "/integrator/substeps") &&
        lab_has_param(&integrator->entry, "substeps"))
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

static drape_status plan(lab *l)
{
    static const char *const defaults[] = {"be", "bdf2", "ida", "verlet", NULL};
    const drape_lab_def *def = l->def;
    space s;
    if (def->axis_count < 1 || def->axis_count > MAX_AXES)
        return drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                          "a map has 1 to 3 axes, such as \"/integrator/dt=1e-3:1e-1:9log\"; %zu are given",
                          def->axis_count);
    json_t *axes = json_array(), *results = json_array();
    for (size_t a = 0; a < def->axis_count; a++)
        json_array_append_new(axes, drape_json_text(def->axes[a]));
    json_object_set_new(l->arguments, "axes", axes);
    json_object_set_new(l->arguments, "strain_limit", json_real(def->strain_limit));
    drape_status status = read_space(l, &s);
    if (!status)
        status = check_space(l, &s);
    for (size_t i = 0; !status && i < def->result_count; i++) {
        int k;
        status = drape_registry_choose(l->ctx, &quantities, "", def->results[i], &k);
        json_array_append_new(results, json_string(def->results[i]));
    }
    if (!status && def->result_count == 0 && s.count == 1)
        json_array_append_new(results, json_string("energy_drift"));
    json_object_set_new(l->about, "results", results); /* last: a failure frees it */
    size_t inside = 0, stride = 1;
    for (int a = 0; !status && a < s.count; stride *= (size_t)s.axes[a++].count)
        inside += stride;
    for (int i = 0; !status && drape_integrators[i]; i++) {
        const drape_integrator_ops *integrator = drape_integrators[i];
        const size_t first = json_array_size(l->cases);
        if (!lab_wants_integrator(l, integrator->entry.name, is_among(integrator->entry.name, defaults)))
            continue;
        for (size_t cell = 0; cell < s.cells && !status; cell++)
            status = add_cell(l, &s, integrator, cell, first);
        /* Before hours are spent, checks that the scene compiles at both ends of every axis and one step
         * inside, as an axis with integer ends may have fractions between. */
        const size_t cells[] = {0, inside, s.cells - 1};
        for (size_t k = 0; k < sizeof cells / sizeof *cells && !status; k++) {
            const lab_request request = lab_request_of(l, first + cells[k]);
            status = lab_load(l->ctx, &request, NULL);
        }
    }
    return status;
}

/* ---- Verdicts ---- */

typedef enum verdict { CLEAN, FEW, SOME, MANY, SHORT, STRAINED, STOPPED, EXPLODED, LATE, VERDICTS } verdict;

#define TEXT(x)   #x
#define NUMBER(x) TEXT(x)

/* Without rejections, and with ever more of them: shades of one blue. Runs up to STRAINED completed. */
static const struct {
    const char *name;
    int colour;
} verdicts[VERDICTS] = {
    [CLEAN] = {"none rejected", LAB_BLUE},
    [FEW] = {"up to 1/100 rejected", 0x4c9ccb},
    [SOME] = {"up to 1/10 rejected", 0x93c4e2},
    [MANY] = {"over 1/10 rejected", 0xd3e6f3},
    [SHORT] = {"fewer than " NUMBER(DRAPE_FEW_STEPS) " steps", LAB_WHITE}, /* hatched */
    [STRAINED] = {"unphysical strain", LAB_PURPLE},
    [STOPPED] = {"stopped", LAB_ORANGE},
    [EXPLODED] = {"exploded", LAB_RED},
    [LATE] = {"over budget", LAB_DARK},
};

/* Whether a run completed in so few steps that nothing had the time to grow: its cell is hatched, whatever
 * its verdict is. */
static bool is_short(const json_t *result)
{
    return lab_is_good(result) && lab_number(result, "accepted") < DRAPE_FEW_STEPS;
}

static verdict judge(const lab *l, const json_t *result)
{
    const drape_integrator_ops *integrator = lab_find_integrator(lab_tag_text(result, "integrator"));
    const double share = lab_number(result, "rejected") / fmax(1, lab_number(result, "accepted"));
    if (strcmp(lab_text(result, "status"), "over_budget") == 0)
        return LATE;
    if (!lab_is_good(result)) /* explicit integrators stop because waves grow */
        return integrator && integrator->stability ? EXPLODED : STOPPED;
    if (lab_number(result, "strain_max") > lab_number(l->arguments, "strain_limit"))
        return STRAINED;
    if (is_short(result))
        return SHORT;
    return share <= 0 ? CLEAN : share <= 0.01 ? FEW : share <= 0.1 ? SOME : MANY;
}

/* The name of a verdict in a legend. */
static void verdict_text(const lab *l, int v, char text[96])
{
    snprintf(text, 96, v == LATE ? "%s (%.3g s)" : "%s", verdicts[v].name,
             lab_number(l->arguments, "case_seconds"));
}

/* ---- Figures ---- */

#define DECADES     8  /* that a logarithmic scale has at most, below its largest value */
#define LOGARITHMIC 30 /* a scale of values of larger ratios is logarithmic */

/* A figure: a map of the cells of an integrator, at an index on the third axis; or all integrators over a
 * single axis, a row or a curve each. */
typedef struct map {
    lab *l;
    const space *s;
    const lab_quantity *quantity; /* whose values are shown; NULL: none, colours are those of the verdicts */
    lab_axis scale;               /* of its values over all cases, so that figures can be compared */
    bool magnitude;               /* the scale is that of the values without their sign */
    size_t first;                 /* the first case of the figure */
    int rows;
    int limits; /* drawn so far */
    lab_figure f;
} map;

/* What a figure shows of a case. */
typedef struct cell {
    verdict verdict;
    bool completed; /* the run has results */
    bool is_short;
    double value; /* of the quantity, as the scale has it; NaN: none */
} cell;

static cell cell_of(const map *m, size_t i)
{
    const json_t *result = m->l->results[i];
    cell c = {judge(m->l, result), false, is_short(result), NAN};
    c.completed = c.verdict <= STRAINED;
    if (c.completed && m->quantity)
        c.value = lab_number(result, m->quantity->entry.name);
    c.value = m->magnitude ? fabs(c.value) : c.value;
    return c;
}

/* Finds the range of the values: logarithmic, of magnitudes, if these differ much. Values that are zero are
 * at the low end then, below all others. */
static void find_scale(map *m)
{
    double low = INFINITY, high = -INFINITY, least = INFINITY, most = 0;
    bool zeros = false;
    for (size_t i = 0; i < m->l->count; i++) {
        const double value = cell_of(m, i).value, size = fabs(value);
        if (isnan(value))
            continue;
        low = fmin(low, value);
        high = fmax(high, value);
        most = fmax(most, size);
        least = size > 0 ? fmin(least, size) : least;
        zeros |= size == 0;
    }
    m->scale.log = most > LOGARITHMIC * least;
    m->magnitude = m->scale.log && low < 0;
    const char *bars = m->magnitude ? "|" : "", *unit = m->quantity->unit;
    snprintf(m->scale.label, sizeof m->scale.label, *unit ? "%s%s%s [%s]" : "%s%s%s", bars,
             m->quantity->entry.name, bars, unit);
    if (m->scale.log) {
        const double floor = most * pow(10, -DECADES);
        m->scale.to = most;
        m->scale.from = least < floor ? floor : zeros ? fmax(floor, least / 3) : least;
    } else if (high >= low) {
        const double margin = high > low ? 0 : fmax(0.5 * fabs(high), 1e-3);
        m->scale.from = low - margin;
        m->scale.to = high + margin;
    }
}

static const char *axis_name(const axis *a)
{
    return strrchr(a->pointer, '/') + 1;
}

/* Range, scale and label, as "young_modulus [Pa]". */
static void set_axis(const axis *a, lab_axis *out)
{
    const double half = 0.5 / (a->count - 1);
    const char *unit = lab_unit(a->pointer);
    *out = a->ends;
    lab_axis_widen(out, half, half);
    if (out->from > out->to)
        *out = (lab_axis){.from = out->to, .to = out->from, .log = out->log};
    snprintf(out->label, sizeof out->label, *unit ? "%.80s [%s]" : "%.80s", axis_name(a), unit);
}

/* ---- The stability limit of an explicit integrator, where an axis of the figure is the step ---- */

/* The index of the axis that is the step; -1: none is. */
static int step_axis(const space *s)
{
    for (int a = 0; a < s->count; a++)
        if (strcmp(s->axes[a].pointer, "/integrator/dt") == 0)
            return a;
    return -1;
}

/* Draws the last block of data: a black line on a white one is seen on every colour. One of the lines is in
 * the legend. */
static void draw_limit(map *m)
{
    if (lab_figure_curve(&m->f, (lab_style){LAB_WHITE, 1, 0}, NULL))
        lab_figure_curve(&m->f, (lab_style){LAB_BLACK, 2, 0}, m->limits++ ? NULL : "explicit limit 2/omega");
}

/* Over a single axis: a line from bottom to top at the limit of a case, if it is on the axis. */
static void draw_limit_at(map *m, size_t i, double bottom, double top)
{
    const double limit = lab_number(m->l->results[i], "explicit_limit_s");
    if (step_axis(m->s) != 0 || !(limit >= m->f.axes[0].from && limit <= m->f.axes[0].to))
        return;
    lab_figure_data(&m->f);
    lab_figure_point(&m->f, limit, bottom);
    lab_figure_point(&m->f, limit, top);
    draw_limit(m);
}

/* Over two axes: a curve along the axis that is not the step. */
static void draw_limit_along(map *m)
{
    const int step = step_axis(m->s);
    const axis *other = step == 0 || step == 1 ? &m->s->axes[1 - step] : NULL;
    lab_figure_data(&m->f);
    for (int k = 0; other && k < other->count; k++) {
        const size_t i = m->first + (size_t)k * (step == 0 ? (size_t)m->s->axes[0].count : 1);
        const double limit = lab_number(m->l->results[i], "explicit_limit_s"), along = axis_value(other, k);
        if (!isnan(limit))
            lab_figure_point(&m->f, step == 0 ? limit : along, step == 0 ? along : limit);
    }
    draw_limit(m);
}

/* ---- Maps ---- */

/* How a case looks in a layer of the map, the boxes of one kind: cells that look alike can be one box. */
typedef struct look {
    bool there;
    double fill; /* a colour, or a share of the scale */
} look;

static look look_at(const map *m, lab_fill kind, size_t i)
{
    const cell c = cell_of(m, i);
    const bool shaded = !isnan(c.value);
    /* The middle of one of LAB_SHADES equal parts of the scale, as a share of it. Zeros are at the low
     * end. */
    const double at = c.value == 0 && m->scale.log ? 0 : lab_axis_share(&m->scale, c.value);
    const double share =
        shaded ? (fmin(LAB_SHADES - 1, fmax(0, floor(LAB_SHADES * at))) + 0.5) / LAB_SHADES : 1;
    if (kind == LAB_COLOURED)
        return (look){!shaded, m->quantity && c.completed ? LAB_GREY : verdicts[c.verdict].colour};
    if (kind == LAB_SCALED)
        return (look){shaded, share};
    const bool black = kind == LAB_HATCHED_BLACK;
    return (look){c.is_short && black == (share > 0.5), black ? LAB_BLACK : LAB_WHITE};
}

/* The ends of a row on the y axis. */
static void row_bounds(const map *m, int row, double *bottom, double *top)
{
    if (m->s->count > 1) {
        cell_bounds(&m->s->axes[1], row, bottom, top);
        return;
    }
    *bottom = m->rows - 1 - row - 0.45; /* the first integrator on top */
    *top = *bottom + 0.9;
}

/* Rows of cells, in which neighbours that look alike are one box. */
static void draw_cells(map *m, lab_fill kind)
{
    const axis *x = &m->s->axes[0];
    lab_figure_data(&m->f);
    for (int row = 0; row < m->rows; row++) {
        double left, right, from = 0, bottom, top;
        const size_t first = m->first + (size_t)x->count * (size_t)row;
        look before = {0}, here = look_at(m, kind, first), next = {0};
        row_bounds(m, row, &bottom, &top);
        for (int i = 0; i < x->count; i++, before = here, here = next) {
            next = i + 1 < x->count ? look_at(m, kind, first + (size_t)i + 1) : (look){.there = false};
            cell_bounds(x, i, &left, &right);
            if (!(before.there && before.fill == here.fill))
                from = left;
            if (here.there && !(next.there && next.fill == here.fill))
                lab_figure_box(&m->f, from, right, bottom, top, here.fill);
        }
    }
    lab_figure_boxes(&m->f, kind);
}

/* Adds a swatch for each verdict that is on the figure; with a scale, for those that hide it. */
static void add_legend(map *m)
{
    const size_t end = m->first + (size_t)m->rows * (size_t)m->s->axes[0].count;
    bool seen[VERDICTS] = {false}, blank = false;
    char text[96];
    for (size_t i = m->first; i < end; i++) {
        const cell c = cell_of(m, i);
        seen[c.verdict] |= !m->quantity || !c.completed;
        seen[SHORT] |= c.is_short;
        blank |= m->quantity && c.completed && isnan(c.value);
    }
    for (int v = 0; v < VERDICTS; v++)
        if (seen[v]) {
            verdict_text(m->l, v, text);
            lab_figure_swatch(&m->f, verdicts[v].colour, v == SHORT, text);
        }
    if (blank)
        lab_figure_swatch(&m->f, LAB_GREY, false, "no value");
}

/* The map of an integrator, at an index on the third axis; or of all over a single axis, the first on top. */
static drape_status draw_map(map *m, int third)
{
    const space *s = m->s;
    const lab_quantity *quantity = m->quantity;
    const char *integrator = lab_tag_text(m->l->results[m->first], "integrator");
    const axis *last = &s->axes[s->count - 1];
    const char **names = drape_arena_take(&m->l->arena, (size_t)m->rows, sizeof *names);
    char name[96] = "map", caption[256] = "what happened to each integrator", number[16];
    if (!names)
        return DRAPE_E_MEMORY;
    snprintf(number, sizeof number, s->count == MAX_AXES ? "_%d" : "", third);
    if (s->count > 1)
        snprintf(name, sizeof name, "map_%s%s%s%s", integrator, number, quantity ? "_" : "",
                 quantity ? quantity->entry.name : "");
    lab_figure_begin(m->l, &m->f, name, NULL, NULL, NULL);
    set_axis(&s->axes[0], &m->f.axes[0]);
    if (s->count > 1) {
        set_axis(&s->axes[1], &m->f.axes[1]);
        snprintf(m->f.title, sizeof m->f.title, s->count == MAX_AXES ? "%s, %.80s = %.4g %s" : "%s",
                 integrator, axis_name(last), axis_value(last, third), lab_unit(last->pointer));
        snprintf(caption, sizeof caption, "%s%s%s", m->f.title, quantity ? ": " : "",
                 quantity ? quantity->entry.summary : "");
    } else {
        m->f.axes[1] = (lab_axis){.from = -0.5, .to = m->rows - 0.5, .names = names, .name_count = m->rows};
        m->f.plot_height = 6.0 * m->rows;
    }
    for (lab_fill kind = LAB_COLOURED; kind <= LAB_HATCHED_WHITE; kind++)
        draw_cells(m, kind);
    if (quantity)
        m->f.scale = m->scale;
    if (s->count > 1)
        draw_limit_along(m);
    for (int row = 0; s->count == 1 && row < m->rows; row++) {
        const size_t first = m->first + s->cells * (size_t)row;
        double bottom, top;
        row_bounds(m, row, &bottom, &top);
        names[m->rows - 1 - row] = lab_tag_text(m->l->results[first], "integrator");
        draw_limit_at(m, first, bottom, top);
    }
    add_legend(m);
    return lab_figure_end(m->l, &m->f, caption);
}

/* ---- Curves over a single axis ---- */

#define FAILED_ROOM 2.4 /* [mm] above the curves, for the runs of an integrator that have no results */
#define CURVE_ROOM  46.0

/* The kinds of marks on a curve. */
typedef enum mark { ON_CURVE, FEW_STEPS, NO_RESULT, OVER_BUDGET, MARKS } mark;

static mark mark_of(const map *m, size_t i)
{
    const cell c = cell_of(m, i);
    return c.verdict == LATE ? OVER_BUDGET : isnan(c.value) ? NO_RESULT : c.is_short ? FEW_STEPS : ON_CURVE;
}

/* Counts the marks of each kind of an integrator. Returns whether any has no result. */
static bool count_marks(const map *m, size_t first, int counts[MARKS])
{
    memset(counts, 0, MARKS * sizeof *counts);
    for (size_t i = first; i < first + m->s->cells; i++)
        counts[mark_of(m, i)]++;
    return counts[NO_RESULT] + counts[OVER_BUDGET] > 0;
}

/* Adds the marks of a kind of one integrator; missing values break the curve. height: of those without
 * results. A logarithmic axis shows no zeros. */
static void add_marks(map *m, size_t first, mark kind, double height)
{
    const double least = m->scale.log ? m->scale.from : -INFINITY;
    bool any = false;
    lab_figure_data(&m->f);
    for (int k = 0; k < m->s->axes[0].count; k++) {
        const size_t i = first + (size_t)k;
        const bool here = mark_of(m, i) == kind;
        if (here)
            lab_figure_point(&m->f, axis_value(&m->s->axes[0], k),
                             kind >= NO_RESULT ? height : fmax(cell_of(m, i).value, least));
        else if (any)
            lab_figure_point(&m->f, NAN, NAN);
        any |= here;
    }
}

/* Values over a single axis, a curve for each integrator. Runs of few steps are open markers off the curve,
 * and those without a result a row of crosses above the curves. */
static drape_status draw_curves(map *m)
{
    static const int markers[MARKS] = {
        [FEW_STEPS] = LAB_OPEN_MARKER, [NO_RESULT] = LAB_CROSS_MARKER, [OVER_BUDGET] = LAB_PLUS_MARKER};
    static const char *const none[] = {""};
    const lab *l = m->l;
    lab_axis *y = &m->f.axes[1];
    char name[96], text[96];
    int failed = 0, counts[MARKS];
    bool seen[MARKS] = {false}, stopped = false, completed = false; /* runs that have no value */
    snprintf(name, sizeof name, "curve_%s", m->quantity->entry.name);
    lab_figure_begin(m->l, &m->f, name, NULL, NULL, NULL);
    set_axis(&m->s->axes[0], &m->f.axes[0]);
    for (size_t first = 0; first < l->count; first += m->s->cells)
        failed += count_marks(m, first, counts);
    /* The ends of the y axis: the scale with margins, and room above for `failed` lines of markers. */
    *y = m->scale;
    if (!(y->to > y->from)) { /* no run has a value: there are markers only, and no numbers */
        y->to = y->from + 1;
        y->names = none;
        y->name_count = 1;
    }
    m->f.plot_height = CURVE_ROOM + FAILED_ROOM * failed;
    lab_axis_widen(y, 0.04, 0.04 + FAILED_ROOM * failed / CURVE_ROOM);
    for (size_t first = 0; first < l->count; first += m->s->cells)
        draw_limit_at(m, first, y->from, y->to);
    for (size_t first = 0; first < l->count; first += m->s->cells) {
        const char *integrator = lab_tag_text(l->results[first], "integrator");
        const double height = lab_axis_value(y, 1 - FAILED_ROOM * (failed - 0.5) / m->f.plot_height);
        const lab_style filled = lab_style_of(integrator, 0), open = lab_style_of(integrator, 1);
        failed -= count_marks(m, first, counts);
        if (!counts[ON_CURVE])
            lab_figure_marker(&m->f, filled, integrator);
        for (mark kind = ON_CURVE; kind < MARKS; kind++) {
            const int point = kind == FEW_STEPS ? open.point : markers[kind];
            add_marks(m, first, kind, height);
            lab_figure_curve(&m->f, kind == ON_CURVE ? filled : (lab_style){open.colour, 0, point},
                             kind == ON_CURVE ? integrator : NULL);
            seen[kind] |= counts[kind] > 0;
        }
    }
    for (size_t i = 0; i < l->count; i++)
        if (mark_of(m, i) == NO_RESULT)
            *(cell_of(m, i).completed ? &completed : &stopped) = true;
    verdict_text(l, LATE, text);
    const char *const names[MARKS] = {[FEW_STEPS] = verdicts[SHORT].name,
                                      [NO_RESULT] = !completed ? "stopped or exploded"
                                                    : stopped  ? "stopped, exploded or no value"
                                                               : "no value",
                                      [OVER_BUDGET] = text};
    for (mark kind = FEW_STEPS; kind < MARKS; kind++)
        if (seen[kind])
            lab_figure_marker(&m->f, (lab_style){LAB_BLACK, 0, markers[kind]}, names[kind]);
    return lab_figure_end(m->l, &m->f, m->quantity->entry.summary);
}

/* ---- The report ---- */

/* Draws a result, or what happened (NULL). */
static drape_status draw(lab *l, const space *s, const lab_quantity *quantity)
{
    const bool single = s->count == 1;
    map m = {.l = l, .s = s, .quantity = quantity};
    m.rows = single ? (int)(l->count / s->cells) : s->axes[1].count;
    const size_t cells = (size_t)s->axes[0].count * (size_t)m.rows;
    if (quantity)
        find_scale(&m);
    if (single && quantity)
        return draw_curves(&m);
    for (; m.first + cells <= l->count; m.first += cells) {
        m.limits = 0;
        DRAPE_TRY(draw_map(&m, (int)(m.first % s->cells / cells)));
    }
    return DRAPE_OK;
}

/* The result that the figures show, by its number in experiment.json. */
static drape_status read_result(lab *l, size_t i, const lab_quantity **quantity)
{
    const json_t *results = json_object_get(l->about, "results");
    int k = 0;
    drape_status status =
        drape_registry_choose(l->ctx, &quantities, "", json_string_value(json_array_get(results, i)), &k);
    *quantity = status ? NULL : (const lab_quantity *)(const void *)entries[k]; /* its first member */
    return status;
}

/* Checks that the cases are those of the axes, the cells of one integrator after those of another, and that
 * the results to be shown are known. */
static drape_status verify(lab *l)
{
    space s;
    const lab_quantity *quantity;
    DRAPE_TRY(read_space(l, &s));
    for (size_t i = 0; i < json_array_size(json_object_get(l->about, "results")); i++)
        DRAPE_TRY(read_result(l, i, &quantity));
    if (l->count % s.cells != 0)
        return drape_fail(l->ctx, DRAPE_E_PARSE, "experiment.json: %zu cases are no whole map of %zu cells",
                          l->count, s.cells);
    for (size_t i = 0; i < l->count; i++) {
        const json_t *one = json_array_get(l->cases, i), *first = json_array_get(l->cases, i - i % s.cells);
        int index[MAX_AXES];
        indices_of(&s, i % s.cells, index);
        bool there = strcmp(lab_tag_text(one, "integrator"), lab_tag_text(first, "integrator")) == 0;
        for (int a = 0; a < s.count; a++) {
            const axis *x = &s.axes[a];
            const double value = axis_value(x, index[a]),
                         size = x->ends.log ? value : fabs(x->ends.to - x->ends.from);
            there = there && fabs(lab_tag_number(one, x->pointer) - value) <= 1e-9 * size;
        }
        if (!there)
            return drape_fail(l->ctx, DRAPE_E_PARSE,
                              "experiment.json: /cases/%zu is not at its place on the axes", i);
    }
    return DRAPE_OK;
}

/* A summary and the figures. */
static drape_status report(lab *l)
{
    space s;
    const lab_quantity *quantity = NULL;
    DRAPE_TRY(read_space(l, &s));
    for (size_t first = 0; first + s.cells <= l->count; first += s.cells) {
        int64_t count[VERDICTS] = {0};
        const char *comma = "";
        for (size_t k = 0; k < s.cells; k++)
            count[judge(l, l->results[first + k])]++;
        fprintf(l->summary, "%s:", lab_tag_text(l->results[first], "integrator"));
        for (int v = 0; v < VERDICTS; v++)
            if (count[v]) {
                fprintf(l->summary, "%s %lld %s", comma, (long long)count[v], verdicts[v].name);
                comma = ",";
            }
        fprintf(l->summary, "\n");
    }
    for (size_t i = 0; i <= json_array_size(json_object_get(l->about, "results")); i++) {
        if (i > 0)
            DRAPE_TRY(read_result(l, i - 1, &quantity));
        lab_page_heading(l, quantity ? quantity->entry.name : "What happened");
        DRAPE_TRY(draw(l, &s, quantity));
    }
    return DRAPE_OK;
}

const lab_experiment_ops lab_experiment_stability = {
    .entry = {.name = "stability", .summary = "maps of what happens over one to three values of the scene"},
    .plan = plan,
    .verify = verify,
    .report = report,
    .shows_results = true,
};
