/*
 * tradeoff: work against accuracy. Every integrator over its dt or rtol, under the scene's controller and
 * under those that bound an error; every linear solver at one dt. Errors are distances from a reference
 * solution whose own error is estimated; an error below 100 times that estimate is listed, but not plotted.
 */
#include "base/param.h"
#include "control/control.h"
#include "lab/figure.h"
#include "lab/reference.h"
#include "lab/text.h"
#include "solvers/linear.h"

#include <math.h>
#include <string.h>

#define RESOLVED    100.0 /* times the reference's error: smaller errors cannot be distinguished from it */
#define BASE_METHOD "be"  /* the usual integrator: others are compared with it */
#define BASE_DT     (1.0 / 60)
#define FEWEST      3 /* cases of a series that is compared with others */

/* Values of a knob. If there is a budget, cases of low rank come first: a few points of every integrator,
 * over all of its range, then the points between, then controllers and linear solvers. Among cases of equal
 * rank explicit integrators come last: a stiff sheet makes each of their cases long. */
typedef struct level {
    double value;
    int rank;
} level;

static const level rates[] = {{30, 3},  {60, 0},  {120, 3}, {240, 1},
                              {480, 4}, {960, 2}, {1920, 5}}; /* [1/s] */
static const level rtols[] = {{3e-2, 4}, {1e-2, 2}, {3e-3, 4}, {1e-3, 0},
                              {3e-4, 4}, {1e-4, 1}, {1e-5, 3}, {1e-6, 5}};
static const level controlled[] = {{1e-2, 6}, {1e-3, 5}, {1e-4, 7}};
#define LINEAR_RANK 6

/* ---- The cases ---- */

static drape_status add(lab *l, const char *series, const char *method, const char *knob, level at,
                        json_t *more)
{
    char pointer[64];
    snprintf(pointer, sizeof pointer, "/%s", knob);
    json_t *settings = json_pack("{s:s, s:f}", "/integrator/method", method, pointer, at.value);
    json_t *tags = json_pack("{s:s, s:s, s:s, s:f}", "series", series, "integrator", method, "knob",
                             strrchr(knob, '/') + 1, "value", at.value);
    json_object_update(settings, more);
    json_decref(more);
    drape_status status = lab_add_case(l, tags, settings, -1);
    if (!status)
        lab_rank_case(l, 2 * at.rank + (lab_find_integrator(method)->stability != NULL));
    return status;
}

/* Integrators that choose their steps, at every order that they are limited to. */
static drape_status add_own_steps(lab *l, const drape_integrator_ops *integrator)
{
    int limits[2];
    drape_status status = DRAPE_OK;
    const size_t count = lab_order_limits(l, integrator, limits);
    for (size_t k = 0; k < count; k++) {
        char series[96];
        lab_name_series(integrator, limits[k], series, sizeof series);
        for (size_t i = 0; !status && i < sizeof rtols / sizeof *rtols; i++)
            status = add(l, series, integrator->entry.name, "integrator/rtol", rtols[i],
                         limits[k] ? json_pack("{s:i}", "/integrator/max_order", limits[k]) : json_object());
    }
    return status;
}

/* Others: over dt, and under each controller that bounds an error. */
static drape_status add_fixed(lab *l, const drape_integrator_ops *integrator)
{
    drape_status status = DRAPE_OK;
    for (size_t i = 0; !status && i < sizeof rates / sizeof *rates; i++)
        status = add(l, integrator->entry.name, integrator->entry.name, "integrator/dt",
                     (level){1 / rates[i].value, rates[i].rank}, json_object());
    for (int c = 0; drape_controllers[c]; c++) {
        const drape_controller_ops *controller = drape_controllers[c];
        char series[96];
        if (drape_param_find(controller->entry.params, controller->entry.param_count, "rtol") < 0)
            continue;
        snprintf(series, sizeof series, "%s, %s control", integrator->entry.name, controller->entry.name);
        for (size_t i = 0; !status && i < sizeof controlled / sizeof *controlled; i++)
            status = add(l, series, integrator->entry.name, "controller/rtol", controlled[i],
                         json_pack("{s:s, s:f}", "/controller/type", controller->entry.name, "/integrator/dt",
                                   1.0 / 480));
    }
    return status;
}

/* They solve the same equations: only the cost differs. */
static drape_status add_linear_solvers(lab *l)
{
    drape_status status = DRAPE_OK;
    for (int i = 0; !status && drape_linears[i]; i++) {
        char series[96];
        snprintf(series, sizeof series, BASE_METHOD ", linear solver %s", drape_linears[i]->entry.name);
        status = add(l, series, BASE_METHOD, "integrator/dt", (level){BASE_DT, LINEAR_RANK},
                     json_pack("{s:s}", "/integrator/linear_solver", drape_linears[i]->entry.name));
    }
    return status;
}

static drape_status plan(lab *l)
{
    drape_status status = lab_check_integrators(l);
    for (int i = 0; !status && drape_integrators[i]; i++) {
        const drape_integrator_ops *integrator = drape_integrators[i];
        if (!lab_wants_integrator(l, integrator->entry.name, !integrator->steady_state))
            continue;
        status = integrator->own_steps ? add_own_steps(l, integrator) : add_fixed(l, integrator);
    }
    if (!status && l->def->integrator_count == 0)
        status = add_linear_solvers(l);
    json_object_set_new(l->arguments, "case_seconds", json_real(l->def->case_seconds));
    json_object_set_new(l->arguments, "repeats", json_integer(l->def->repeats));
    return status;
}

/* ---- Reading the results ---- */

static bool is_linear_case(const json_t *result)
{
    return strstr(lab_tag_text(result, "series"), "linear solver") != NULL;
}

/* The error of a case if it can be distinguished from that of the reference; otherwise NaN. */
static double resolved_error(const json_t *result)
{
    double error = lab_number(result, "error_end_m");
    return lab_is_good(result) && error > RESOLVED * lab_number(result, "reference_error_m") ? error : NAN;
}

/* Cases that were run of the series of a case, which stand side by side. */
static int count_beside(const lab *l, size_t i)
{
    const char *series = lab_tag_text(json_array_get(l->cases, i), "series");
    int count = 0;
    while (i > 0 && strcmp(lab_tag_text(json_array_get(l->cases, i - 1), "series"), series) == 0)
        i--;
    for (; i < l->count && strcmp(lab_tag_text(json_array_get(l->cases, i), "series"), series) == 0; i++)
        count += l->results[i] != NULL;
    return count;
}

/* The same of a series by its name. */
static int count_run(const lab *l, const char *series)
{
    for (size_t i = 0; i < l->count; i++)
        if (strcmp(lab_tag_text(json_array_get(l->cases, i), "series"), series) == 0)
            return count_beside(l, i);
    return 0;
}

/* The cheapest case whose error is at most that; of one series, or NULL of any. Series with
 * too few cases do not count. NULL: there is none. */
static const json_t *cheapest(const lab *l, double error, const char *series)
{
    const json_t *best = NULL;
    const char *counted = "";
    int count = 0; /* of that series */
    for (size_t i = 0; i < l->count; i++) {
        const json_t *r = l->results[i];
        const char *own = lab_tag_text(r, "series");
        if (is_linear_case(r) || !(resolved_error(r) <= error) || (series && strcmp(own, series) != 0))
            continue;
        if (strcmp(own, counted) != 0)
            count = count_beside(l, i);
        counted = own;
        if (count < FEWEST)
            continue;
        if (!best || lab_number(r, "cpu_s") < lab_number(best, "cpu_s"))
            best = r;
    }
    return best;
}

static void length_text(double metres, char *text, size_t size)
{
    if (metres >= 1)
        snprintf(text, size, "%.3g m", metres);
    else if (metres >= 1e-3)
        snprintf(text, size, "%.3g mm", 1e3 * metres);
    else
        snprintf(text, size, "%.3g um", 1e6 * metres);
}

static void knob_text(const json_t *result, char *text, size_t size)
{
    double value = lab_tag_number(result, "value");
    const char *knob = lab_tag_text(result, "knob");
    if (strcmp(knob, "dt") == 0 && value > 0)
        snprintf(text, size, "dt 1/%.4g s", 1 / value);
    else
        snprintf(text, size, "%s %.3g", knob, value);
}

/* "At 1 mm error the cheapest is ida, order 2, rtol 0.0003 (0.21 s of CPU); be needs 0.86 s, 4.1 times as
 * much". */
static void report_cheapest(lab *l, double error)
{
    bool comes_close = false; /* even if that error cannot be distinguished from the reference's */
    const json_t *best = cheapest(l, error, NULL), *base = cheapest(l, error, BASE_METHOD);
    char length[32], knob[64];
    if (!best)
        return;
    length_text(error, length, sizeof length);
    knob_text(best, knob, sizeof knob);
    double cost = lab_number(best, "cpu_s");
    fprintf(l->summary, "At %s error the cheapest is %s, %s (%.3g s of CPU)", length,
            lab_tag_text(best, "series"), knob, cost);
    for (size_t i = 0; i < l->count; i++)
        comes_close |= strcmp(lab_tag_text(l->results[i], "series"), BASE_METHOD) == 0 &&
                       lab_is_good(l->results[i]) && lab_number(l->results[i], "error_end_m") <= error;
    if (base && base != best)
        fprintf(l->summary, ", %.2g times cheaper than " BASE_METHOD ".\n", lab_number(base, "cpu_s") / cost);
    else if (comes_close || count_run(l, BASE_METHOD) < FEWEST)
        fprintf(l->summary, ".\n");
    else
        fprintf(l->summary, "; " BASE_METHOD " does not come so close in this grid.\n");
}

/* How far the step sizes that programs usually take are from the converged motion. */
static void report_headline(lab *l)
{
    const double usual[] = {BASE_DT, BASE_DT / 16};
    char errors[2][32];
    for (int k = 0; k < 2; k++) {
        const json_t *found = NULL;
        for (size_t i = 0; i < l->count && !found; i++)
            if (strcmp(lab_tag_text(l->results[i], "series"), BASE_METHOD) == 0 &&
                fabs(lab_tag_number(l->results[i], "value") / usual[k] - 1) < 1e-9 &&
                lab_is_good(l->results[i]))
                found = l->results[i];
        if (!found)
            return;
        length_text(lab_number(found, "error_end_m"), errors[k], sizeof errors[k]);
    }
    fprintf(l->summary,
            BASE_METHOD " with steps of 1/60 s ends %s (root mean square over the nodes) from the converged "
                        "motion, with steps of 1/960 s %s.\n",
            errors[0], errors[1]);
}

/* Names the series of which too few cases were run; those without any are named among what was left out. */
static void report_sparse(lab *l)
{
    const char *before = "";
    bool any = false;
    for (size_t i = 0; i < l->count; i++) {
        const json_t *one = json_array_get(l->cases, i);
        const char *series = lab_tag_text(one, "series");
        const int count = strcmp(series, before) != 0 && !is_linear_case(one) ? count_beside(l, i) : 0;
        if (count > 0 && count < FEWEST) {
            if (!any)
                fprintf(l->summary, "Too few cases for a comparison, which takes %d:", FEWEST);
            fprintf(l->summary, "%s %s (%d)", any ? "," : "", series, count);
            any = true;
        }
        before = series;
    }
    if (any)
        fprintf(l->summary, ".\n");
}

static void report_reference(lab *l)
{
    double smallest = INFINITY, reference = NAN;
    int unresolved = 0, late = 0;
    for (size_t i = 0; i < l->count; i++) {
        const json_t *r = l->results[i];
        double error = resolved_error(r);
        if (!r)
            continue;
        reference = lab_number(r, "reference_error_m");
        smallest = error < smallest ? error : smallest;
        unresolved += lab_is_good(r) && isnan(error);
        late += strcmp(lab_text(r, "status"), "over_budget") == 0;
    }
    fprintf(l->summary, "The reference's error is estimated as %.2g m; ", reference);
    if (!isfinite(smallest))
        fprintf(l->summary,
                "no error is plotted: a shorter duration, or a larger budget, may give a better one. ");
    else if (reference > 0)
        fprintf(l->summary, "the smallest error plotted is %.2g m, %.3g times that. ", smallest,
                smallest / reference);
    else
        fprintf(l->summary, "the smallest error plotted is %.2g m. ", smallest);
    fprintf(l->summary,
            "%d cases closer than 100 times are listed and not plotted; %d took more than their CPU time "
            "and were stopped.\n",
            unresolved, late);
}

/* ---- Figures ---- */

typedef struct chart {
    const char *file, *x_label, *x_key, *y_label, *y_key;
} chart;

static const chart charts[] = {
    {"error_cpu", "CPU [s]", "cpu_s", "error at the end, RMS [m]", "error_end_m"},
    {"error_l2_cpu", "CPU [s]", "cpu_s", "error over time, RMS [m]", "error_l2_m"},
    {"error_residuals", "residuals", "residuals", "error at the end, RMS [m]", "error_end_m"},
    {"error_jacobians", "Jacobians", "jacobians", "error at the end, RMS [m]", "error_end_m"},
};

/* The points of the series that begins with a case, added to all: x, y in turn. Returns how many are there
 * then. */
static size_t take_points(const lab *l, const chart *c, size_t first, double *xy, size_t count)
{
    const char *series = lab_tag_text(json_array_get(l->cases, first), "series");
    for (size_t i = first;
         i < l->count && strcmp(lab_tag_text(json_array_get(l->cases, i), "series"), series) == 0; i++) {
        const json_t *r = l->results[i];
        const double x = lab_number(r, c->x_key), y = lab_number(r, c->y_key);
        if (isnan(resolved_error(r)) || !(x > 0) || !(y > 0))
            continue;
        xy[2 * count] = x;
        xy[2 * count++ + 1] = y;
    }
    return count;
}

/* The curves are the series but those of linear solvers; those of an integrator stand together. */
static drape_status draw(lab *l, const chart *c)
{
    lab_figure f;
    const char *series = "", *integrator = "";
    size_t count = 0, variant = 0;
    double *xy = drape_arena_take(&l->arena, 2 * l->count, sizeof *xy);
    if (!xy)
        return DRAPE_E_MEMORY;
    lab_figure_begin(l, &f, c->file);
    for (size_t i = 0; i < l->count; i++) {
        const json_t *one = json_array_get(l->cases, i);
        if (strcmp(lab_tag_text(one, "series"), series) == 0 || is_linear_case(one))
            continue;
        variant = strcmp(lab_tag_text(one, "integrator"), integrator) == 0 ? variant + 1 : 0;
        series = lab_tag_text(one, "series");
        integrator = lab_tag_text(one, "integrator");
        const size_t before = count;
        count = take_points(l, c, i, xy, count);
        if (count == before)
            continue;
        const size_t block = lab_figure_data(&f);
        for (size_t k = before; k < count; k++)
            lab_figure_point(&f, xy[2 * k], xy[2 * k + 1]);
        lab_figure_series(&f, block, integrator, variant, series);
    }
    snprintf(f.axes[0].label, sizeof f.axes[0].label, "%s", c->x_label);
    snprintf(f.axes[1].label, sizeof f.axes[1].label, "%s", c->y_label);
    if (count > 0)
        lab_figure_fit(&f, xy, count, 0);
    return lab_figure_end(l, &f, c->y_label);
}

/* ---- The table ---- */

static void write_table(lab *l)
{
    static const char *const keys[] = {"error_end_m", "error_l2_m",     "energy_drift",     "strain_max",
                                       "cpu_s",       "accepted",       "rejected",         "residuals",
                                       "jacobians",   "factorizations", "linear_iterations"};
    const size_t columns = sizeof keys / sizeof *keys;
    lab_page_heading(l, "All cases");
    fputs("<table><tr><th>integrator</th><th>setting</th><th>status</th>", l->page);
    for (size_t k = 0; k < columns; k++)
        fprintf(l->page, "<th>%s</th>", keys[k]);
    fputs("</tr>\n", l->page);
    for (size_t i = 0; i < l->count; i++) {
        const json_t *r = l->results[i];
        char knob[64];
        if (!r)
            continue;
        knob_text(r, knob, sizeof knob);
        fputs("<tr><td>", l->page);
        lab_page_text(l, lab_tag_text(r, "series"));
        fputs("</td><td>", l->page);
        lab_page_text(l, knob);
        fputs("</td><td>", l->page);
        lab_page_text(l, lab_text(r, "status"));
        fputs("</td>", l->page);
        for (size_t k = 0; k < columns; k++) {
            const double value = lab_is_good(r) || k > 2 ? lab_number(r, keys[k]) : NAN;
            fprintf(l->page, isnan(value) ? "<td></td>" : "<td>%.4g</td>", value);
        }
        fputs("</tr>\n", l->page);
    }
    fputs("</table>\n", l->page);
}

static drape_status report(lab *l)
{
    drape_status status = DRAPE_OK;
    report_headline(l);
    report_sparse(l);
    for (int decade = 0; decade >= -7; decade--)
        if (cheapest(l, pow(10, decade), NULL) &&
            cheapest(l, pow(10, decade), NULL) != cheapest(l, pow(10, decade + 1), NULL))
            report_cheapest(l, pow(10, decade));
    report_reference(l);
    for (size_t i = 0; !status && i < sizeof charts / sizeof *charts; i++)
        status = draw(l, &charts[i]);
    write_table(l);
    return status;
}

const lab_experiment_ops lab_experiment_tradeoff = {
    .entry = {.name = "tradeoff", .summary = "work against accuracy of every integrator over its settings"},
    .compares_costs = true,
    .partial = true,
    .plan = plan,
    .check = lab_check_reference,
    .prepare = lab_make_reference,
    .report = report,
};
