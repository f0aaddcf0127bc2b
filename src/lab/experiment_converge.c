/*
 * converge: orders of convergence without a reference. A setting is halved again and again; the distances
 * between the ends of successive runs fall like a power of it, whose exponent is the order: straight lines in
 * logarithms. In time dt is halved (integrators that choose their steps: rtol is cut to a tenth), in space
 * the edges of every mesh, with positions compared at the nodes of the coarsest one.
 *
 * A line is fitted through refinements of one order only: from the finest on, as long as the orders between
 * neighbours agree. Over rtol the slope is that of the error control, 1 where the error is proportional to
 * the tolerance; a method that chooses its order takes another one at another rtol, and no line is fitted.
 */
#include "lab/engine_output.h"
#include "lab/fit.h"
#include "lab/series.h"
#include "model/scene.h"

#include <math.h>
#include <string.h>

#define FIRST_DT     (1.0 / 60)
#define FIRST_RTOL   1e-2
#define SPACE        "space"
#define SPACE_METHOD "bdf2" /* whose error in time is small beside that of the mesh, at the scene's dt */
#define MIN_LEVELS   3
#define MAX_LEVELS   12
#define OWN          "dt, with own substeps" /* the knob of an integrator that dt does not refine */
#define BY_RTOL      "rtol, which sets the order"
#define ROUNDING     1e-12 /* [m]: smaller distances are rounding */
#define MIN_FITTED   3     /* refinements that show that there is one order */

/* ---- The cases ---- */

static drape_status add_time(lab *l, const drape_integrator_ops *integrator, const drape_entry_def *given)
{
    const bool own = integrator->own_steps;
    const double ratio = own ? 0.1 : 0.5;
    lab_level levels[MAX_LEVELS];
    double value = own ? FIRST_RTOL : FIRST_DT;
    /* An integrator that takes as many substeps as its stability limit asks for stays at that limit, whatever
     * dt is, and one may choose its order by rtol, unless the scene fixes their number or the order. */
    const char *fixes = own ? integrator->order_parameter : "substeps";
    bool fixed = own ? !fixes : !integrator->stability || !lab_has_param(&integrator->entry, fixes);
    for (size_t i = 0; !fixed && i < given->setting_count; i++)
        fixed = strcmp(given->settings[i].name, fixes) == 0 && (own || given->settings[i].number > 0);
    for (int k = 0; k < l->def->levels; k++, value *= ratio)
        levels[k] = (lab_level){value, -1};
    const lab_grid grid = {.knob = fixed ? NULL
                                   : own ? BY_RTOL
                                         : OWN,
                           .rtols = {levels, (size_t)l->def->levels},
                           .steps = {levels, (size_t)l->def->levels}};
    return lab_add_integrator(l, &grid, integrator);
}

/* The meshes of all cloths subdivided so many times more. */
static drape_status add_level(lab *l, const drape_scene_def *def, int level)
{
    json_t *settings = json_object();
    for (size_t c = 0; c < def->cloth_count; c++)
        json_object_set_new(settings, DRAPE_FORMAT("/cloth/%zu/mesh/subdivide", c),
                            json_integer(def->cloths[c].mesh.subdivide + level));
    return lab_add_point(
        l, &(lab_point){NULL, SPACE, SPACE_METHOD, NULL, "edge", {ldexp(1, -level), -1}, settings});
}

static drape_status plan(lab *l)
{
    drape_scene *scene = NULL;
    drape_scene_def def;
    if (l->def->levels < MIN_LEVELS || l->def->levels > MAX_LEVELS)
        return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "levels = %d; must be %d to %d", l->def->levels,
                          MIN_LEVELS, MAX_LEVELS);
    drape_status status = lab_load_scene(l->ctx, &(lab_request){.def = l->def}, &scene);
    drape_scene_def_init(&def, sizeof def);
    if (!status)
        status = drape_scene_to_def(scene, &def);
    for (int i = 0; !status && drape_integrators[i]; i++)
        if (lab_wants_integrator(l, drape_integrators[i]->entry.name, true) &&
            !drape_integrators[i]->steady_state)
            status = add_time(l, drape_integrators[i], &def.integrator);
    for (int k = 0; l->def->space && k < l->def->levels && !status; k++)
        status = add_level(l, &def, k);
    drape_scene_destroy(&scene);
    return status;
}

/* All runs are compared at the nodes of the scene's own meshes, which keep their numbers in finer ones. */
static drape_status prepare(lab *l)
{
    drape_model *model = NULL;
    drape_status status = lab_load(l->ctx, &(lab_request){.def = l->def}, &model);
    if (!status &&
        !(l->compared = drape_arena_take(&l->arena, (size_t)model->cloth_count, sizeof *l->compared)))
        status = DRAPE_E_MEMORY;
    for (int32_t c = 0; !status && c < model->cloth_count; c++)
        l->compared[c] = model->cloths[c].mesh.node_count;
    drape_model_destroy(&model);
    return status;
}

/* ---- Reading the results ---- */

/* The refinements of one series: how far the end moved from each to the next. */
typedef struct sequence {
    const char *series, *integrator, *knob;
    size_t variant;                              /* among those of the integrator over the knob */
    double value[MAX_LEVELS], moved[MAX_LEVELS]; /* of the coarser of two, [m] */
    size_t count;
    size_t fitted; /* the last so many of them, by the line */
    int failed;
    int64_t rejected;   /* steps that the controller cut: there dt was not that of the case */
    size_t cut;         /* the last refinement with such steps, counted from 1; 0: none */
    bool unrefined;     /* the integrator chooses its substeps, and dt does not refine them: there is no order
                           */
    bool chooses_order; /* the integrator takes another order at another value of the knob */
    lab_line line;      /* NaN: fewer than 3 refinements have one order */
} sequence;

static bool is_tolerance(const sequence *s)
{
    return strcmp(s->knob, "rtol") == 0 || strcmp(s->knob, BY_RTOL) == 0;
}

/* Fits a line through the finest refinements of one order. */
static void fit(sequence *s)
{
    double x[MAX_LEVELS], y[MAX_LEVELS];
    size_t count = 0;
    s->line = (lab_line){NAN, NAN, NAN, NAN};
    if (s->unrefined || s->chooses_order)
        return;
    for (size_t i = s->count; i-- > s->cut; count++) {
        x[count] = s->value[i];
        y[count] = s->moved[i];
    }
    /* Error control scatters too much for orders between neighbours. */
    s->fitted = is_tolerance(s) ? count : lab_same_order(x, y, count);
    if (s->fitted >= MIN_FITTED || (s->fitted == 2 && s->count == 2)) /* of two at all: without confidence */
        s->line = lab_fit_power(x, y, s->fitted);
    else
        s->fitted = 0;
}

static double distance(const json_t *first, const json_t *second)
{
    const json_t *x = json_object_get(first, "positions"), *y = json_object_get(second, "positions");
    double sum = 0;
    size_t size = json_array_size(x);
    for (size_t i = 0; i < size; i++) {
        const json_t *a = json_array_get(x, i), *b = json_array_get(y, i);
        double d = json_is_number(a) && json_is_number(b) ? json_number_value(a) - json_number_value(b) : NAN;
        sum += d * d;
    }
    return size > 0 && size == json_array_size(y) ? sqrt(sum / ((double)size / 3)) : NAN;
}

static void read_sequence(const lab_series *series, const lab_series *before_it, sequence *s)
{
    const json_t *before = NULL;
    *s = (sequence){.series = series->name, .integrator = series->integrator, .knob = series->knob};
    if (before_it && strcmp(before_it->knob, s->knob) == 0)
        s->variant = series->variant;
    for (size_t i = 0; i < series->count; i++) {
        const json_t *r = series->results[i];
        bool good = lab_is_good(r);
        double moved = before && good ? distance(before, r) : NAN;
        s->failed += !good;
        s->rejected += json_integer_value(json_object_get(r, "rejected"));
        if (moved > ROUNDING && s->count < MAX_LEVELS) {
            s->value[s->count] = lab_tag_number(before, "value");
            s->moved[s->count++] = moved;
            if (lab_number(before, "rejected") > 0 || lab_number(r, "rejected") > 0)
                s->cut = is_tolerance(s) ? 0 : s->count;
        }
        before = good ? r : NULL;
    }
    const drape_integrator_ops *integrator = lab_find_integrator(s->integrator);
    s->unrefined = strcmp(s->knob, OWN) == 0;
    s->chooses_order = strcmp(s->knob, BY_RTOL) == 0 ||
                       (is_tolerance(s) && integrator && lab_has_param(&integrator->entry, "max_order"));
    fit(s);
}

/* The order between a refinement and the one before. */
static double local_order(const sequence *s, size_t i)
{
    return log(s->moved[i - 1] / s->moved[i]) / log(s->value[i - 1] / s->value[i]);
}

static void report_order(const sequence *s, FILE *out)
{
    fprintf(out, "%s: ", s->series);
    if (isnan(s->line.slope)) {
        double low = INFINITY, high = -INFINITY; /* of the orders between neighbours */
        for (size_t i = 1; i < s->count; i++) {
            low = fmin(low, local_order(s, i));
            high = fmax(high, local_order(s, i));
        }
        fprintf(out, "no order, as ");
        if (s->unrefined)
            fprintf(out, "it chooses its own substeps and dt does not refine them; a value of "
                         "/integrator/substeps fixes them");
        else if (s->count < 2)
            fprintf(out, "too few of its refinements moved the end");
        else if (s->chooses_order)
            fprintf(out,
                    "it chooses its order, and another one at another rtol; a tenth of rtol divides the "
                    "change by %.2g to %.2g%s",
                    pow(10, low), pow(10, high),
                    strcmp(s->knob, BY_RTOL) == 0 ? "; a value of /integrator/order fixes it" : "");
        else
            fprintf(
                out,
                "it changes from refinement to refinement, between %.2g and %.2g, %.2g at the last: the "
                "order is not determined; try more levels, or a shorter duration, before small differences "
                "grow",
                low, high, local_order(s, s->count - 1));
    } else {
        if (is_tolerance(s))
            fprintf(out, "change proportional to %s^%.3g", s->knob, s->line.slope);
        else
            fprintf(out, "order %.3g in %s", s->line.slope, s->knob);
        if (!isnan(s->line.low))
            fprintf(out, " (95 %% confidence %.3g to %.3g)", s->line.low, s->line.high);
        fprintf(out, ", %.3g at the last refinement", local_order(s, s->count - 1));
        if (s->fitted < s->count)
            fprintf(out, "; of the last %zu of %zu refinements, as the order of the others is another one",
                    s->fitted, s->count);
        if (s->line.low <= 0)
            fprintf(out, ": not wholly above 0, so the order is not determined; try more levels, or a "
                         "shorter duration, before small differences grow");
    }
    if (s->rejected && strcmp(s->knob, "dt") == 0)
        fprintf(out, "; %lld of its steps were rejected and cut, so dt was not halved everywhere",
                (long long)s->rejected);
    if (s->failed)
        fprintf(out, "; %d of its runs did not complete", s->failed);
    fprintf(out, "\n");
}

/* ---- The figures and the tables ---- */

/* The sequences over one knob. The refinements that a line is fitted through are filled markers, or all, if
 * there is none; others are open. */
static drape_status draw(lab *l, const sequence *sequences, size_t count, const char *knob, const char *label)
{
    lab_figure f;
    char name[96], text[96];
    bool others = false;
    snprintf(name, sizeof name, "converge_%s", knob);
    lab_figure_begin(l, &f, name, NULL, label, "change to the next level [m]");
    for (const sequence *s = sequences; s < sequences + count; s++) {
        const lab_style style = lab_style_of(s->integrator, s->variant),
                        open = lab_style_of(s->integrator, 1);
        const size_t first = s->fitted ? s->count - s->fitted : 0;
        if (strcmp(is_tolerance(s) ? "rtol" : s->knob, knob) != 0)
            continue;
        lab_figure_data(&f);
        for (size_t i = 0; i < first; i++)
            lab_figure_point(&f, s->value[i], s->moved[i]);
        lab_figure_curve(&f, (lab_style){style.colour, 0, open.point}, NULL);
        lab_figure_data(&f);
        for (size_t i = first; i < s->count; i++)
            lab_figure_point(&f, s->value[i], s->moved[i]);
        snprintf(text, sizeof text, isnan(s->line.slope) ? "%s" : "%s (%.2f)", s->series, s->line.slope);
        lab_figure_curve(&f, style, text);
        others |= first > 0;
    }
    if (others)
        lab_figure_marker(&f, (lab_style){LAB_BLACK, 0, LAB_OPEN_MARKER}, "not fitted");
    lab_figure_fit(&f, strcmp(knob, "rtol") != 0 ? 2 : 1);
    return lab_figure_end(
        l, &f,
        "How far the end moves with each refinement (root mean square); in brackets the slope of a line "
        "through the filled markers");
}

static drape_status report(lab *l)
{
    static const struct {
        const char *knob, *label;
    } knobs[] = {{"dt", "dt [s]"}, {"rtol", "rtol"}, {"edge", "edge length / that of the coarsest mesh"}};
    const lab_table t = {.l = l};
    size_t count = 0;
    const lab_series *series = lab_list_series(l, NULL, &count);
    sequence *sequences = drape_arena_take(&l->arena, count, sizeof *sequences);
    if (!series || !sequences)
        return DRAPE_E_MEMORY;
    for (size_t k = 0; k < count; k++)
        read_sequence(&series[k], k ? &series[k - 1] : NULL, &sequences[k]);
    for (size_t k = 0; k < count; k++)
        report_order(&sequences[k], l->summary);
    for (size_t i = 0; i < sizeof knobs / sizeof *knobs; i++)
        DRAPE_TRY(draw(l, sequences, count, knobs[i].knob, knobs[i].label));
    for (const sequence *s = sequences; s < sequences + count; s++) {
        lab_table_begin(&t, s->series, "%s\tmoved [m]\torder", s->knob);
        for (size_t i = 0; i < s->count; i++)
            lab_table_row(&t, i > 0 && !s->unrefined ? "%.6g\t%.4g\t%.3f" : "%.6g\t%.4g\t", s->value[i],
                          s->moved[i], i > 0 ? local_order(s, i) : NAN);
        lab_table_end(&t);
    }
    return DRAPE_OK;
}

const lab_experiment_ops lab_experiment_converge = {
    .entry = {.name = "converge", .summary = "orders of convergence in time, and in space"},
    .plan = plan,
    .prepare = prepare,
    .report = report,
};
