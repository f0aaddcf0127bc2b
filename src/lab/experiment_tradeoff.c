/*
 * tradeoff: work against accuracy. Every integrator over its dt or rtol, under the scene's controller and
 * under those that bound an error; every linear solver at one dt. Errors are distances from a reference
 * solution whose own error is estimated; an error below 100 times that estimate is listed, but not plotted.
 */
#include "base/clock.h"
#include "lab/engine_output.h"
#include "lab/series.h"
#include "model/model.h"
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
static const lab_grid grid = {.rtols = LAB_LEVELS(rtols),
                              .steps = LAB_LEVELS(steps),
                              .controlled = LAB_LEVELS(controlled),
                              .first_step = 1.0 / 480};

static drape_status plan(lab *l)
{
    for (int i = 0; drape_integrators[i]; i++)
        if (lab_wants_integrator(l, drape_integrators[i]->entry.name, !drape_integrators[i]->steady_state))
            DRAPE_TRY(lab_add_integrator(l, &grid, drape_integrators[i]));
    /* They solve the same equations: only the cost differs. */
    for (int i = 0; drape_linears[i] && l->def->integrator_count == 0; i++) {
        char series[96];
        snprintf(series, sizeof series, BASE_METHOD ", linear solver %s", drape_linears[i]->entry.name);
        const lab_point point = {
            .series = series,
            .integrator = BASE_METHOD,
            .pointer = "/integrator/dt",
            .level = {BASE_DT, LINEAR_RANK},
            .more = json_pack("{s:s}", "/integrator/linear_solver", drape_linears[i]->entry.name)};
        DRAPE_TRY(lab_add_point(l, &point));
    }
    return DRAPE_OK;
}

/* ---- The reference solution ----
 *
 * The motion of the most accurate run that the time allows, with its distance from the next less accurate one
 * as the estimate of its error. There are two sequences of refinements: ida over rtol at order 5, and trbdf2
 * over dt; the one with the smaller distance between its last two levels is taken. */

#define MAX_LEVELS  6
#define BUDGET      20.0 /* case_seconds that each sequence may take */
#define SHARE       0.5  /* of the experiment's budget, if it has one, that the sequences may take together */
#define BEST        1e-8 /* of the scene's size: no further level is needed */
#define GOOD_ENOUGH 1e-5 /* of the scene's size: no second sequence is tried */
#define GROWTH      2.5  /* expected cost of a level over that of the one before */
#define FORMAT      "little endian doubles: frames x nodes x 3, the last one the end"

/* A sequence of refinements. */
typedef struct sequence {
    const char *method, *knob; /* knob: pointer of the value that changes */
    double first, ratio;       /* its values */
    const char *also;          /* pointer of another value that is set; NULL: none */
    double also_value;
} sequence;

static const sequence sequences[] = {
    {"ida", "/integrator/rtol", 1e-5, 0.1, "/integrator/max_order", 5},
    {"trbdf2", "/integrator/dt", 1.0 / 960, 0.5, NULL, 0},
};
#define SEQUENCES ((int)(sizeof sequences / sizeof *sequences))

/* What ended a sequence before its last level. */
typedef enum limit { NOTHING, BUDGET_SECONDS, CASE_SECONDS, FAILURE } limit;

/* The last refinement level of a sequence. Every level is saved in the folder; interrupted runs resume. */
typedef struct level {
    lab_trace trace;
    double error; /* distance of its end from that of the level before; INFINITY: first level */
    double knob;
    int count;          /* levels so far; 0: none */
    double took, spent; /* CPU [s] of this level, of all */
    limit ended_by;
    char failure[200]; /* the message of a run that failed */
} level;

static json_t *settings_of(const sequence *s, double knob)
{
    json_t *settings = json_pack("{s:s, s:f}", "/integrator/method", s->method, s->knob, knob);
    if (s->also)
        json_object_set_new(settings, s->also, json_real(s->also_value));
    return settings;
}

/* Whether the scene compiles for every sequence, before anything is written. */
static drape_status check_reference(lab *l)
{
    drape_status status = DRAPE_OK;
    for (int i = 0; !status && i < SEQUENCES; i++) {
        json_t *settings = settings_of(&sequences[i], sequences[i].first);
        status = lab_load(l->ctx, &(lab_request){.def = l->def, .settings = settings}, NULL);
        json_decref(settings);
    }
    return status;
}

/* ---- Files ---- */

/* The name of a file of a sequence; s NULL: of the reference that was chosen. Each shard has reference files
 * of its own. */
static void name_file(const lab *l, const sequence *s, const char *ending, char name[64])
{
    char shard[32] = "";
    if (l->def->shards > 1)
        snprintf(shard, sizeof shard, "-%d-of-%d", l->def->shard, l->def->shards);
    snprintf(name, 64, "reference%s%s%s.%s", s ? "-" : "", s ? s->method : "", shard, ending);
}

/* Saves a level of a sequence; chosen: as the reference. */
static drape_status save(lab *l, const sequence *s, bool chosen, const level *last)
{
    char name[64];
    const lab_trace *trace = &last->trace;
    name_file(l, chosen ? NULL : s, "f64", name);
    drape_status status = lab_write_text(l, name, (const char *)trace->x,
                                         trace->size * (size_t)trace->frames * sizeof *trace->x);
    json_t *about = json_pack("{s:s, s:s, s:f, s:o, s:I, s:I, s:s, s:i, s:f, s:f}", "method", s->method,
                              "knob", s->knob, "value", last->knob, "error_m", drape_json_number(last->error),
                              "frames", (json_int_t)trace->frames, "size", (json_int_t)trace->size, "format",
                              FORMAT, "levels", last->count, "took_s", last->took, "spent_s", last->spent);
    name_file(l, chosen ? NULL : s, "json", name);
    if (!status)
        return lab_write_json(l, name, about, JSON_INDENT(1) | JSON_REAL_PRECISION(17));
    json_decref(about);
    return status;
}

/* Reads the saved level of an earlier run, if both files exist and belong together and to the model. s: as in
 * name_file. */
static bool read_saved(lab *l, const drape_model *model, const sequence *s, level *last)
{
    char name[64], *data = NULL;
    size_t bytes = 0;
    json_t *about;
    name_file(l, s, "json", name);
    bool read = !lab_read_json(&l->arena, l->folder, name, &about);
    name_file(l, s, "f64", name);
    read = read && !lab_read_text(&l->arena, l->folder, name, &data, &bytes);
    const size_t size = 3 * (size_t)drape_model_node_count(model), frame = size * sizeof(double);
    const int64_t frames = (int64_t)(bytes / frame);
    const json_int_t levels = json_integer_value(json_object_get(about, "levels"));
    const double error = lab_number(about, "error_m");
    const bool fits = read && frames > 0 && bytes % frame == 0 && levels > 0 && levels <= MAX_LEVELS &&
                      json_integer_value(json_object_get(about, "frames")) == frames &&
                      lab_number(about, "value") > 0 && lab_number(about, "took_s") >= 0 &&
                      lab_number(about, "spent_s") >= 0;
    if (fits) {
        *last = (level){.trace = {size, frames, frames, (double *)(void *)data},
                        .error = isnan(error) ? INFINITY : error,
                        .knob = lab_number(about, "value"),
                        .count = (int)levels,
                        .took = lab_number(about, "took_s"),
                        .spent = lab_number(about, "spent_s")};
    }
    json_decref(about);
    return fits;
}

static bool is_sequence(const void *user, const char *name)
{
    static const char *const endings[] = {"json", "f64"};
    for (int i = 0; i < 2 * SEQUENCES; i++) {
        char known[64];
        name_file(user, &sequences[i / 2], endings[i % 2], known);
        if (strcmp(name, known) == 0)
            return true;
    }
    return false;
}

/* ---- Runs ---- */

/* Runs and saves the next level. If its run does not complete, *last stays the level before it, and keeps
 * what ended the sequence. */
static drape_status refine(lab *l, const drape_model *model, const sequence *s, double deadline, level *last)
{
    const double knob = last->count ? last->knob * s->ratio : s->first, start = drape_clock_thread_seconds();
    lab_trace trace;
    json_t *settings = settings_of(s, knob), *result = NULL;
    const lab_request request = {.def = l->def,
                                 .settings = settings,
                                 .record = &trace,
                                 .arena = &l->arena,
                                 .seconds = BUDGET * l->def->case_seconds - last->spent,
                                 .deadline = deadline,
                                 .repeats = 1};
    drape_status status = lab_run(l->ctx, &request, &result);
    if (!trace.frames) { /* a run that the deadline stopped has no result */
        const bool over = strcmp(lab_text(result, "status"), "over_budget") == 0;
        last->ended_by = !result ? BUDGET_SECONDS : over ? CASE_SECONDS : FAILURE;
        snprintf(last->failure, sizeof last->failure, "%s", lab_text(result, "message"));
    }
    json_decref(settings);
    json_decref(result);
    last->took = drape_clock_thread_seconds() - start;
    last->spent += last->took;
    if (!trace.frames)
        return status;
    last->error =
        last->count ? lab_distance(model, lab_trace_end(&trace), lab_trace_end(&last->trace)) : INFINITY;
    drape_arena_release(&l->arena, last->trace.x);
    last->trace = trace;
    last->knob = knob;
    last->count++;
    return save(l, s, false, last);
}

/* Sets the message that there is no reference: what ended each sequence, and what helps. */
static drape_status fail_without(lab *l, const level last[SEQUENCES])
{
    bool by[FAILURE + 1] = {false}, kept = false;
    char why[SEQUENCES * 320] = "", help[160] = "";
    size_t end = 0;
    for (int i = 0; i < SEQUENCES; i++) {
        char reason[240];
        by[last[i].ended_by] = true;
        kept |= last[i].count > 0;
        if (last[i].ended_by == BUDGET_SECONDS)
            snprintf(reason, sizeof reason, "its share of budget_seconds = %g was used up",
                     l->def->budget_seconds);
        else if (last[i].ended_by == CASE_SECONDS)
            snprintf(reason, sizeof reason, "its CPU time is limited to %g times case_seconds = %g", BUDGET,
                     l->def->case_seconds);
        else
            snprintf(reason, sizeof reason, "%s", last[i].failure);
        end += (size_t)snprintf(why + end, sizeof why - end, "%s%s completed %d (%s)", i ? ", " : "",
                                sequences[i].method, last[i].count, reason);
    }
    l->resumable = kept && by[BUDGET_SECONDS];
    if (by[BUDGET_SECONDS] || by[CASE_SECONDS])
        snprintf(
            help, sizeof help,
            ". What helps: a larger %s%s%s, a shorter duration, damping if the sheet is stiff and has none",
            by[BUDGET_SECONDS] ? "budget_seconds" : "", by[BUDGET_SECONDS] && by[CASE_SECONDS] ? " and " : "",
            by[CASE_SECONDS] ? "case_seconds" : "");
    return drape_fail(
        l->ctx, DRAPE_E_SOLVER, "no reference, which takes two levels of refinement: %s%s%s", why, help,
        l->resumable ? ". The levels are kept, and a larger budget_seconds continues with them" : "");
}

/* Refines the sequences and takes the better one. */
static drape_status choose(lab *l, const drape_model *model, level *best)
{
    const sequence *chosen = NULL;
    level last[SEQUENCES];
    drape_status status = DRAPE_OK;
    *best = (level){.error = INFINITY};
    for (int i = 0; !status && i < SEQUENCES && !(best->error < GOOD_ENOUGH * model->length); i++) {
        level *now = &last[i];
        /* [s] of the wall clock by which it has to be done; 0: the experiment has no budget. */
        const double budget = l->def->budget_seconds;
        const double deadline = budget > 0 ? l->start + SHARE * (i + 1) / SEQUENCES * budget : 0;
        *now = (level){.error = INFINITY};
        read_saved(l, model, &sequences[i], now);
        while (!status && !now->ended_by && now->count < MAX_LEVELS && now->error > BEST * model->length) {
            const double next = GROWTH * now->took; /* expected */
            if (!(next < BUDGET * l->def->case_seconds - now->spent))
                now->ended_by = CASE_SECONDS;
            else if (deadline > 0 && !(drape_clock_seconds() + next < deadline))
                now->ended_by = BUDGET_SECONDS;
            else
                status = refine(l, model, &sequences[i], deadline, now);
        }
        if (!status && now->error < best->error) {
            *best = *now;
            chosen = &sequences[i];
        }
    }
    if (status)
        return status;
    status = chosen ? save(l, chosen, true, best) : fail_without(l, last);
    if (l->resumable || (status && status != DRAPE_E_SOLVER))
        return status;
    drape_status removed = drape_folder_remove(l->out, is_sequence, l);
    return status ? status : removed;
}

/* Makes l->reference, or reads it if the folder has it (reference.json, reference.f64). DRAPE_E_SOLVER if
 * neither sequence has two levels that complete. */
static drape_status make_reference(lab *l)
{
    drape_model *model = NULL;
    level best;
    drape_status status = lab_load(l->ctx, &(lab_request){.def = l->def}, &model);
    if (!status && !read_saved(l, model, NULL, &best)) {
        if (l->def->progress)
            l->def->progress(l->def->user, 0, 0, NAN);
        status = choose(l, model, &best);
    }
    drape_model_destroy(&model);
    if (!status) {
        l->reference = best.trace;
        l->reference_error = best.error;
    }
    return status;
}

/* ---- Reading the results ---- */

/* All series but those of linear solvers. */
typedef struct all {
    lab_series *series;
    size_t count;
} all;

static double resolved_error(const json_t *result)
{
    return lab_resolved_error(result, "error_end_m", RESOLVED);
}

static bool is_resolved(const json_t *result)
{
    return !isnan(resolved_error(result));
}

/* The cheapest case with at most that error, of one series (`only`) or of all (NULL) that have enough cases
 * to be compared. NULL: no case is so close. */
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
    report_headline(l, usual);
    /* The series of which too few cases were run; those without any are named among what was left out. */
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
    for (int decade = 0; decade >= -7; decade--) {
        const json_t *best = cheapest(a, pow(10, decade), NULL);
        if (best && best != cheapest(a, pow(10, decade + 1), NULL))
            report_cheapest(l, a, usual, best, pow(10, decade));
    }
    report_reference(l);
    for (size_t i = 0; i < sizeof charts / sizeof *charts; i++)
        DRAPE_TRY(lab_draw_series(l, &charts[i], a.series, a.count));
    write_table(l);
    return DRAPE_OK;
}

const lab_experiment_ops lab_experiment_tradeoff = {
    .entry = {.name = "tradeoff", .summary = "work against accuracy of every integrator over its settings"},
    .compares_costs = true,
    .partial = true,
    .plan = plan,
    .check = check_reference,
    .prepare = make_reference,
    .report = report,
};
