/*
 * tradeoff: work against accuracy. Every row of the integrators over its dt or rtol, under the scene's controller and
 * under those that bound an error; every linear solver at one dt. Errors are distances to a reference whose own
 * error is estimated; what comes within 100 times that estimate is listed, but not judged.
 */
#include "control/control.h"
#include "lab/grid.h"
#include "lab/reference.h"
#include "lab/text.h"
#include "solvers/linear.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RESOLVED    100.0 /* times the reference's error: what is below is not told apart from it */
#define BASE_METHOD "be"  /* what everybody else has: others are compared with it */
#define BASE_DT     (1.0 / 60)

static const double rates[] = {30, 60, 120, 240, 480, 960, 1920}; /* [1/s] */
static const double rtols[] = {3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6};
static const double controlled[] = {1e-2, 1e-3, 1e-4};
static const int orders[] = {2, 5};

/* ---- The cases ---- */

static drape_status add(lab *l, const char *series, const char *method, const char *knob, double value,
                        json_t *more)
{
    char pointer[64];
    snprintf(pointer, sizeof pointer, "/%s", knob);
    json_t *settings = json_pack("{s:s, s:f}", "/integrator/method", method, pointer, value);
    json_t *tags = json_pack("{s:s, s:s, s:s, s:f}", "series", series, "integrator", method, "knob",
                             strrchr(knob, '/') + 1, "value", value);
    json_object_update(settings, more);
    json_decref(more);
    return lab_add_case(l, tags, settings, -1);
}

static drape_status add_own_steps(lab *l, const drape_integrator_ops *row)
{
    drape_status status = DRAPE_OK;
    bool ordered = lab_has_param(row->entry.params, row->entry.param_count, "max_order");
    for (size_t k = 0; k < (ordered ? sizeof orders / sizeof *orders : 1); k++) {
        char series[96];
        if (ordered)
            snprintf(series, sizeof series, "%s, order %d", row->entry.name, orders[k]);
        else
            snprintf(series, sizeof series, "%s", row->entry.name);
        for (size_t i = 0; !status && i < sizeof rtols / sizeof *rtols; i++)
            status = add(l, series, row->entry.name, "integrator/rtol", rtols[i],
                         ordered ? json_pack("{s:i}", "/integrator/max_order", orders[k]) : json_object());
    }
    return status;
}

static drape_status add_controlled(lab *l, const drape_integrator_ops *row)
{
    drape_status status = DRAPE_OK;
    for (int c = 0; drape_controllers[c]; c++) {
        const drape_controller_ops *controller = drape_controllers[c];
        char series[96];
        if (!lab_has_param(controller->entry.params, controller->entry.param_count, "rtol"))
            continue;
        snprintf(series, sizeof series, "%s, %s control", row->entry.name, controller->entry.name);
        for (size_t i = 0; !status && i < sizeof controlled / sizeof *controlled; i++)
            status = add(l, series, row->entry.name, "controller/rtol", controlled[i],
                         json_pack("{s:s, s:f}", "/controller/type", controller->entry.name, "/integrator/dt",
                                   1.0 / 480));
    }
    return status;
}

static drape_status add_fixed(lab *l, const drape_integrator_ops *row)
{
    drape_status status = DRAPE_OK;
    for (size_t i = 0; !status && i < sizeof rates / sizeof *rates; i++)
        status = add(l, row->entry.name, row->entry.name, "integrator/dt", 1 / rates[i], json_object());
    return status ? status : add_controlled(l, row);
}

/* They solve the same equations: only the cost differs. */
static drape_status add_linear_solvers(lab *l)
{
    drape_status status = DRAPE_OK;
    for (int i = 0; !status && drape_linears[i]; i++) {
        char series[96];
        snprintf(series, sizeof series, BASE_METHOD ", linear solver %s", drape_linears[i]->entry.name);
        status = add(l, series, BASE_METHOD, "integrator/dt", BASE_DT,
                     json_pack("{s:s}", "/integrator/linear_solver", drape_linears[i]->entry.name));
    }
    return status;
}

static drape_status plan(lab *l)
{
    drape_status status = lab_check_integrators(l);
    for (int i = 0; !status && drape_integrators[i]; i++) {
        const drape_integrator_ops *row = drape_integrators[i];
        if (!lab_wants_integrator(l, row->entry.name, !row->timeless))
            continue;
        status = row->own_steps ? add_own_steps(l, row) : add_fixed(l, row);
    }
    if (!status && lab_wants_integrator(l, BASE_METHOD, true))
        status = add_linear_solvers(l);
    json_object_set_new(l->arguments, "case_seconds", json_real(l->def->case_seconds));
    json_object_set_new(l->arguments, "repeats", json_integer(l->def->repeats));
    return status;
}

/* ---- Reading the results ---- */

static bool is_linear_case(const json_t *result)
{
    return strstr(lab_tag_word(result, "series"), "linear solver") != NULL;
}

/* The error of a case that is told apart from the reference's; NaN for others. */
static double resolved_error(const json_t *result)
{
    double error = lab_number(result, "error_end_m");
    return lab_is_good(result) && error > RESOLVED * lab_number(result, "reference_error_m") ? error : NAN;
}

/* The cheapest case whose error is at most that; of one integrator, or NULL of any. NULL: there is none. */
static const json_t *cheapest(const lab *l, double error, const char *integrator)
{
    const json_t *best = NULL;
    for (size_t i = 0; i < l->count; i++) {
        const json_t *r = l->results[i];
        if (is_linear_case(r) || !(resolved_error(r) <= error) ||
            (integrator && strcmp(lab_tag_word(r, "series"), integrator) != 0))
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
    const char *knob = lab_tag_word(result, "knob");
    if (strcmp(knob, "dt") == 0 && value > 0)
        snprintf(text, size, "dt 1/%.4g s", 1 / value);
    else
        snprintf(text, size, "%s %.3g", knob, value);
}

static bool has_series(const lab *l, const char *series)
{
    for (size_t i = 0; i < l->count; i++)
        if (strcmp(lab_tag_word(l->results[i], "series"), series) == 0)
            return true;
    return false;
}

/* "At 1 mm error the cheapest is ida, order 2, rtol 0.0003 (0.21 s of CPU); be needs 0.86 s, 4.1 times as much". */
static void say_cheapest(lab *l, double error)
{
    const json_t *best = cheapest(l, error, NULL), *base = cheapest(l, error, BASE_METHOD);
    char length[32], knob[64];
    if (!best)
        return;
    length_text(error, length, sizeof length);
    knob_text(best, knob, sizeof knob);
    double cost = lab_number(best, "cpu_s");
    fprintf(l->words, "At %s error the cheapest is %s, %s (%.3g s of CPU)", length,
            lab_tag_word(best, "series"), knob, cost);
    if (best == base || !has_series(l, BASE_METHOD))
        fprintf(l->words, ".\n");
    else if (base)
        fprintf(l->words, ", %.2g times cheaper than " BASE_METHOD ".\n", lab_number(base, "cpu_s") / cost);
    else
        fprintf(l->words, "; " BASE_METHOD " does not come so close in this grid.\n");
}

/* How far the step size that programs take by habit is from the truth. */
static void say_headline(lab *l)
{
    const double habits[] = {BASE_DT, BASE_DT / 16};
    char errors[2][32];
    for (int k = 0; k < 2; k++) {
        const json_t *found = NULL;
        for (size_t i = 0; i < l->count && !found; i++)
            if (strcmp(lab_tag_word(l->results[i], "series"), BASE_METHOD) == 0 &&
                fabs(lab_tag_number(l->results[i], "value") / habits[k] - 1) < 1e-9 &&
                lab_is_good(l->results[i]))
                found = l->results[i];
        if (!found)
            return;
        length_text(lab_number(found, "error_end_m"), errors[k], sizeof errors[k]);
    }
    fprintf(l->words,
            BASE_METHOD " with steps of 1/60 s ends %s (root mean square over the nodes) from the converged "
                        "motion, with steps of 1/960 s %s.\n",
            errors[0], errors[1]);
}

static void say_reference(lab *l)
{
    double smallest = INFINITY, reference = NAN;
    int unresolved = 0, late = 0;
    for (size_t i = 0; i < l->count; i++) {
        const json_t *r = l->results[i];
        double error = resolved_error(r);
        reference = lab_number(r, "reference_error_m");
        smallest = error < smallest ? error : smallest;
        unresolved += lab_is_good(r) && isnan(error);
        late += strcmp(lab_word(r, "status"), "over_budget") == 0;
    }
    fprintf(l->words, "The reference's error is estimated as %.2g m; ", reference);
    if (!isfinite(smallest))
        fprintf(l->words, "no error is plotted. ");
    else if (reference > 0)
        fprintf(l->words, "the smallest error plotted is %.2g m, %.3g times that. ", smallest,
                smallest / reference);
    else
        fprintf(l->words, "the smallest error plotted is %.2g m. ", smallest);
    fprintf(l->words,
            "%d cases closer than 100 times are listed and not plotted; %d took more than their CPU time "
            "and were stopped.\n",
            unresolved, late);
}

/* ---- Pictures ---- */

typedef struct chart {
    const char *file, *x_label, *x_key, *y_label, *y_key;
} chart;

static const chart charts[] = {
    {"error_cpu", "CPU [s]", "cpu_s", "error at the end, RMS [m]", "error_end_m"},
    {"error_l2_cpu", "CPU [s]", "cpu_s", "error over time, RMS [m]", "error_l2_m"},
    {"error_residuals", "residuals", "residuals", "error at the end, RMS [m]", "error_end_m"},
    {"error_jacobians", "Jacobians", "jacobians", "error at the end, RMS [m]", "error_end_m"},
};

/* The index of the first case of each series, in order. */
static size_t list_series(const lab *l, size_t *first, size_t room)
{
    size_t count = 0;
    for (size_t i = 0; i < l->count && count < room; i++) {
        bool known = is_linear_case(l->results[i]);
        for (size_t k = 0; k < count && !known; k++)
            known = strcmp(lab_tag_word(l->results[first[k]], "series"),
                           lab_tag_word(l->results[i], "series")) == 0;
        if (!known)
            first[count++] = i;
    }
    return count;
}

static int write_points(const lab *l, FILE *out, size_t k, const char *series, const chart *c)
{
    int points = 0;
    fprintf(out, "$s%zu << EOD\n", k);
    for (size_t i = 0; i < l->count; i++) {
        const json_t *r = l->results[i];
        double x = lab_number(r, c->x_key), y = lab_number(r, c->y_key);
        if (strcmp(lab_tag_word(r, "series"), series) != 0 || isnan(resolved_error(r)) || !(x > 0) ||
            !(y > 0))
            continue;
        fprintf(out, "%.9g %.9g\n", x, y);
        points++;
    }
    fprintf(out, "EOD\n");
    return points;
}

/* A colour for each integrator, dashes and points for its variants. Okabe & Ito 2008, Color Universal Design. */
static const char *const colours[] = {"0072B2", "D55E00", "009E73", "CC79A7",
                                      "E69F00", "56B4E9", "000000", "7F7F7F"};

typedef struct look {
    size_t colour, variant;
} look;

static look look_of(const lab *l, const size_t *first, size_t k)
{
    look one = {.colour = 0};
    const char *mine = lab_tag_word(l->results[first[k]], "integrator"), *before = "";
    for (size_t i = 0; i <= k; i++) {
        const char *row = lab_tag_word(l->results[first[i]], "integrator");
        one.colour += i > 0 && strcmp(row, before) != 0;
        one.variant += i < k && strcmp(row, mine) == 0;
        before = row;
    }
    one.colour %= sizeof colours / sizeof *colours;
    return one;
}

/* false: there is no point to draw, and on axes in logarithms not even the axes. */
static bool write_script(const lab *l, FILE *out, const chart *c)
{
    size_t first[128], count = list_series(l, first, 128);
    bool drawn[128], any = false;
    fprintf(
        out,
        "set terminal svg size 900,560 dynamic font 'sans-serif,13' background '#ffffff' name '%s'\n"
        "cd '%s'\nset output '%s.svg'\nset logscale xy\nset format '10^{%%T}'\n"
        "set grid lc rgb '#dddddd'\nset key outside right top noenhanced\nset xlabel '%s'\nset ylabel '%s'\n",
        c->file, l->folder, c->file, c->x_label, c->y_label);
    for (size_t k = 0; k < count; k++)
        drawn[k] = write_points(l, out, k, lab_tag_word(l->results[first[k]], "series"), c) > 0;
    for (size_t k = 0; k < count; k++) {
        if (!drawn[k])
            continue;
        const look one = look_of(l, first, k);
        fprintf(out, "%s $s%zu with linespoints lw 1.8 lc rgb '#%s' dt %zu pt %zu ps .6 title \"%s\"",
                any ? "," : "plot", k, colours[one.colour], one.variant + 1, 7 - 2 * (one.variant % 3),
                lab_tag_word(l->results[first[k]], "series"));
        any = true;
    }
    fprintf(out, "\n");
    return any;
}

static drape_status draw(lab *l, const chart *c)
{
    char *script = NULL, picture[64];
    size_t size = 0;
    bool drawn = false;
    drape_status status = DRAPE_OK;
    FILE *out = open_memstream(&script, &size);
    if (!out)
        return drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for a picture");
    bool any = write_script(l, out, c);
    fclose(out);
    if (any)
        status = lab_plot(l, c->file, script, size, &drawn);
    free(script);
    snprintf(picture, sizeof picture, "%s.svg", c->file);
    return status || !drawn ? status : lab_page_picture(l, picture, c->y_label);
}

/* ---- The table ---- */

static void put_cell(FILE *out, double value)
{
    if (isnan(value))
        fputs("<td></td>", out);
    else
        fprintf(out, "<td>%.4g</td>", value);
}

static void write_table(lab *l)
{
    static const char *const keys[] = {"error_end_m", "error_l2_m",     "energy_drift",     "strain_max",
                                       "cpu_s",       "accepted",       "rejected",         "residuals",
                                       "jacobians",   "factorizations", "linear_iterations"};
    const size_t columns = sizeof keys / sizeof *keys;
    lab_page_heading(l, "All cases");
    fputs("<table><tr><th>row</th><th>setting</th><th>status</th>", l->page);
    for (size_t k = 0; k < columns; k++)
        fprintf(l->page, "<th>%s</th>", keys[k]);
    fputs("</tr>\n", l->page);
    for (size_t i = 0; i < l->count; i++) {
        char knob[64];
        knob_text(l->results[i], knob, sizeof knob);
        fputs("<tr><td>", l->page);
        lab_page_text(l, lab_tag_word(l->results[i], "series"));
        fprintf(l->page, "</td><td>%s</td><td>", knob);
        lab_page_text(l, lab_word(l->results[i], "status"));
        fputs("</td>", l->page);
        for (size_t k = 0; k < columns; k++)
            put_cell(l->page, lab_is_good(l->results[i]) || k > 2 ? lab_number(l->results[i], keys[k]) : NAN);
        fputs("</tr>\n", l->page);
    }
    fputs("</table>\n", l->page);
}

static drape_status report(lab *l)
{
    drape_status status = DRAPE_OK;
    say_headline(l);
    for (int decade = 0; decade >= -7; decade--)
        if (cheapest(l, pow(10, decade), NULL) &&
            cheapest(l, pow(10, decade), NULL) != cheapest(l, pow(10, decade + 1), NULL))
            say_cheapest(l, pow(10, decade));
    say_reference(l);
    for (size_t i = 0; !status && i < sizeof charts / sizeof *charts; i++)
        status = draw(l, &charts[i]);
    write_table(l);
    return status;
}

const lab_experiment_ops lab_experiment_tradeoff = {
    .entry = {.name = "tradeoff", .summary = "work against accuracy of every integrator over its settings"},
    .compares_costs = true,
    .plan = plan,
    .check = lab_check_reference,
    .prepare = lab_make_reference,
    .report = report,
};
