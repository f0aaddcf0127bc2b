/*
 * tradeoff: work against accuracy. Every integrator over its dt or rtol, under the scene's controller and
 * under those that bound an error; every linear solver at one dt. Errors are distances from a reference
 * solution whose own error is estimated; an error below 100 times that estimate is listed, but not plotted.
 */
#include "lab/figure.h"
#include "lab/lab.h"
#include "lab/series.h"
#include "lab/text.h"
#include "solvers/linear.h"

#include <math.h>
#include <string.h>

#define RESOLVED    100.0 /* times the reference's error: smaller errors cannot be distinguished from it */
#define BASE_METHOD "be"  /* the usual integrator: others are compared with it */
#define BASE_DT     (1.0 / 60)
#define FEWEST      3 /* cases of a series that is compared with others */
#define LINEAR_RANK 6

/* ---- The cases ---- */

/* If there is a budget, cases of low rank come first: a few points of every integrator, over all of its
 * range, then the points between, then controllers and linear solvers. Among cases of equal rank explicit
 * integrators come last: a stiff sheet makes each of their cases long. */
static const lab_level steps[] = {{1.0 / 30, 3},  {1.0 / 60, 0},  {1.0 / 120, 3}, {1.0 / 240, 1},
                                  {1.0 / 480, 4}, {1.0 / 960, 2}, {1.0 / 1920, 5}}; /* [s] */
static const lab_level rtols[] = {{3e-2, 4}, {1e-2, 2}, {3e-3, 4}, {1e-3, 0},
                                  {3e-4, 4}, {1e-4, 1}, {1e-5, 3}, {1e-6, 5}};
static const lab_level controlled[] = {{1e-2, 6}, {1e-3, 5}, {1e-4, 7}};
static const lab_grid grid = {.rtols = rtols,
                              .rtol_count = sizeof rtols / sizeof *rtols,
                              .steps = steps,
                              .step_count = sizeof steps / sizeof *steps,
                              .controlled = controlled,
                              .controlled_count = sizeof controlled / sizeof *controlled,
                              .first_step = 1.0 / 480};

static drape_status plan(lab *l)
{
    drape_status status = DRAPE_OK;
    for (int i = 0; !status && drape_integrators[i]; i++)
        if (lab_wants_integrator(l, drape_integrators[i]->entry.name, !drape_integrators[i]->steady_state))
            status = lab_add_integrator(l, &grid, drape_integrators[i]);
    /* They solve the same equations: only the cost differs. */
    for (int i = 0; !status && drape_linears[i] && l->def->integrator_count == 0; i++) {
        char series[96];
        snprintf(series, sizeof series, BASE_METHOD ", linear solver %s", drape_linears[i]->entry.name);
        status = lab_add_point(l, &(lab_point){.series = series,
                                               .integrator = BASE_METHOD,
                                               .pointer = "/integrator/dt",
                                               .level = {BASE_DT, LINEAR_RANK},
                                               .more = json_pack("{s:s}", "/integrator/linear_solver",
                                                                 drape_linears[i]->entry.name)});
    }
    return status;
}

/* ---- Reading the results ---- */

/* All series but those of linear solvers. */
typedef struct all {
    lab_series *series;
    size_t count;
} all;

static bool is_resolved(const json_t *result)
{
    return lab_is_good(result) &&
           lab_number(result, "error_end_m") > RESOLVED * lab_number(result, "reference_error_m");
}

/* The error of a case if it can be distinguished from that of the reference; otherwise NaN. */
static double resolved_error(const json_t *result)
{
    return is_resolved(result) ? lab_number(result, "error_end_m") : NAN;
}

/* The cheapest case whose error is at most that; of one series, or NULL of any. Series with
 * too few cases do not count. NULL: there is none. */
static const json_t *cheapest(all a, double error, const lab_series *only)
{
    const json_t *best = NULL;
    for (const lab_series *s = a.series; s < a.series + a.count; s++) {
        if (s->count < FEWEST || (only && s != only))
            continue;
        for (size_t i = 0; i < s->count; i++)
            if (resolved_error(s->results[i]) <= error &&
                (!best || lab_number(s->results[i], "cpu_s") < lab_number(best, "cpu_s")))
                best = s->results[i];
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

/* "At 1 mm error the cheapest is ida, order 2, rtol 0.0003 (0.21 s of CPU); be needs 0.86 s, 4.1 times as
 * much". */
static void report_cheapest(lab *l, all a, const lab_series *usual, const json_t *best, double error)
{
    bool comes_close = false; /* even if that error cannot be distinguished from the reference's */
    const json_t *base = usual ? cheapest(a, error, usual) : NULL;
    const double cost = lab_number(best, "cpu_s");
    char length[32], knob[64];
    length_text(error, length, sizeof length);
    lab_knob_text(best, knob);
    fprintf(l->summary, "At %s error the cheapest is %s, %s (%.3g s of CPU)", length,
            lab_tag_text(best, "series"), knob, cost);
    for (size_t i = 0; usual && i < usual->count; i++)
        comes_close |=
            lab_is_good(usual->results[i]) && lab_number(usual->results[i], "error_end_m") <= error;
    if (base && base != best)
        fprintf(l->summary, ", %.2g times cheaper than " BASE_METHOD ".\n", lab_number(base, "cpu_s") / cost);
    else if (comes_close || !usual || usual->count < FEWEST)
        fprintf(l->summary, ".\n");
    else
        fprintf(l->summary, "; " BASE_METHOD " does not come so close in this grid.\n");
}

/* How far the step sizes that programs usually take are from the converged motion. */
static void report_headline(lab *l, const lab_series *usual)
{
    const double usual_steps[] = {BASE_DT, BASE_DT / 16};
    char errors[2][32];
    for (int k = 0; k < 2; k++) {
        const json_t *found = NULL;
        for (size_t i = 0; usual && i < usual->count && !found; i++)
            if (fabs(lab_tag_number(usual->results[i], "value") / usual_steps[k] - 1) < 1e-9 &&
                lab_is_good(usual->results[i]))
                found = usual->results[i];
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
static void report_sparse(lab *l, all a)
{
    bool any = false;
    for (const lab_series *s = a.series; s < a.series + a.count; s++)
        if (s->count > 0 && s->count < FEWEST) {
            if (!any)
                fprintf(l->summary, "Too few cases for a comparison, which takes %d:", FEWEST);
            fprintf(l->summary, "%s %s (%zu)", any ? "," : "", s->name, s->count);
            any = true;
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

/* ---- Figures and the table ---- */

static void write_table(lab *l)
{
    static const char *const keys[] = {"error_end_m", "error_l2_m",     "energy_drift",     "strain_max",
                                       "cpu_s",       "accepted",       "rejected",         "residuals",
                                       "jacobians",   "factorizations", "linear_iterations"};
    enum { KEYS = sizeof keys / sizeof *keys, OF_GOOD = 3 }; /* the first are those of completed cases */
    const lab_table t = {.l = l};
    char knob[64], cells[32 * KEYS] = "";
    for (size_t k = 0; k < KEYS; k++)
        snprintf(cells + strlen(cells), sizeof cells - strlen(cells), "\t%s", keys[k]);
    lab_table_begin(&t, "All cases", "integrator\tsetting\tstatus%s", cells);
    for (size_t i = 0; i < l->count; i++) {
        const json_t *r = l->results[i];
        if (!r)
            continue;
        lab_knob_text(r, knob);
        *cells = 0;
        for (size_t k = 0; k < KEYS; k++) {
            const double value = lab_is_good(r) || k >= OF_GOOD ? lab_number(r, keys[k]) : NAN;
            snprintf(cells + strlen(cells), sizeof cells - strlen(cells), isnan(value) ? "\t" : "\t%.4g",
                     value);
        }
        lab_table_row(&t, "%s\t%s\t%s%s", lab_tag_text(r, "series"), knob, lab_text(r, "status"), cells);
    }
    lab_table_end(&t);
}

static drape_status report(lab *l)
{
#define CPU  .x = "cpu_s", .x_label = "CPU [s]"
#define ENDS .y = "error_end_m", .y_label = "error at the end, RMS [m]", .shows = is_resolved
    static const lab_chart charts[] = {
        {.name = "error_cpu", CPU, ENDS},
        {.name = "error_l2_cpu",
         CPU,
         .y = "error_l2_m",
         .y_label = "error over time, RMS [m]",
         .shows = is_resolved},
        {.name = "error_residuals", .x = "residuals", .x_label = "residuals", ENDS},
        {.name = "error_jacobians", .x = "jacobians", .x_label = "Jacobians", ENDS},
    };
    size_t listed;
    all a = {.series = lab_list_series(l, NULL, &listed)};
    if (!a.series)
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < listed; i++)
        if (!strstr(a.series[i].name, "linear solver"))
            a.series[a.count++] = a.series[i];
    const lab_series *usual = lab_find_series(a.series, a.count, BASE_METHOD);
    drape_status status = DRAPE_OK;
    report_headline(l, usual);
    report_sparse(l, a);
    for (int decade = 0; decade >= -7; decade--) {
        const json_t *best = cheapest(a, pow(10, decade), NULL);
        if (best && best != cheapest(a, pow(10, decade + 1), NULL))
            report_cheapest(l, a, usual, best, pow(10, decade));
    }
    report_reference(l);
    for (size_t i = 0; !status && i < sizeof charts / sizeof *charts; i++)
        status = lab_draw_series(l, &charts[i], a.series, a.count);
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
