/*
 * tradeoff: work against accuracy. Integrators over their dt or rtol, each case beside a reference: the
 * measure is that of geometry/deviation.h, the largest RMS distance of all frames as a share of the diagonal.
 * A case counts as within an accuracy if its error plus that of the reference is. A later call in the same
 * folder may ask for other integrators and values, with the same reference.
 */
#include "base/clock.h"
#include "base/param.h"
#include "geometry/deviation.h"
#include "lab/engine_output.h"
#include "lab/series.h"

#include <math.h>
#include <string.h>

#define RESOLVED 3.0 /* times the reference's error: smaller errors are not known to a third of themselves */

/* ---- The cases ----
 *
 * Without names, the methods by which an accuracy is reached (docs/accuracy.md): newton_k with contact, bdf2
 * without, rosenbrock for small errors. Cheap cases, which answer at the loose end, have low ranks and are
 * run first. rosenbrock may cost more at rtol 1e-2 than at 1e-3 (a fabric in wind: 15 s and 9 s of CPU). */
static const char *const usual[] = {"newton_k", "bdf2", "rosenbrock"};
static const lab_level steps[] = {{1.0 / 30, 0},  {1.0 / 60, 0},  {1.0 / 120, 1}, {1.0 / 240, 2},
                                  {1.0 / 480, 3}, {1.0 / 960, 4}, {1.0 / 1920, 5}}; /* [s] */
static const lab_level rtols[] = {{1e-2, 3}, {1e-3, 0}, {1e-4, 1}, {1e-5, 2}, {1e-6, 4}};

/* Reads the values that the command line gives, "1/60,1/240", in descending order. */
static drape_status read_levels(lab *l, const drape_lab_setting *setting, lab_levels *levels)
{
    lab_level *at = drape_arena_take(&l->arena, strlen(setting->value) + 1, sizeof *at);
    const char *text = setting->value;
    double value;
    if (!at)
        return DRAPE_E_MEMORY;
    for (size_t count = 0; text && (text = drape_number_read(text, &value)) && value > 0 && value <= 1;) {
        size_t i = count++;
        at[i].rank = (int)i;
        for (; i > 0 && at[i - 1].value < value; i--)
            at[i].value = at[i - 1].value;
        at[i].value = value;
        *levels = (lab_levels){at, count};
        if (*text == 0)
            return DRAPE_OK;
        text = *text == ',' ? text + 1 : NULL;
    }
    return drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                      "%s = \"%.60s\": must be numbers above 0, at most 1, separated by commas, such as "
                      "1/60,1/240 or 1e-3,1e-4",
                      setting->pointer, setting->value);
}

/* Settings of dt and rtol are the values that are compared; the others are those of all cases. */
static drape_status plan(lab *l)
{
    lab_grid grid = {.rtols = LAB_LEVELS(rtols), .steps = LAB_LEVELS(steps)};
    drape_lab_def *def = drape_arena_take(&l->arena, 1, sizeof *def);
    drape_lab_setting *kept = drape_arena_take(&l->arena, l->def->setting_count, sizeof *kept);
    if (!def || !kept)
        return DRAPE_E_MEMORY;
    *def = *l->def;
    def->settings = kept;
    def->setting_count = 0;
    for (size_t i = 0; i < l->def->setting_count; i++) {
        const drape_lab_setting *one = &l->def->settings[i];
        const bool is_dt = strcmp(one->pointer, "/integrator/dt") == 0;
        if (is_dt || strcmp(one->pointer, "/integrator/rtol") == 0)
            DRAPE_TRY(read_levels(l, one, is_dt ? &grid.steps : &grid.rtols));
        else
            kept[def->setting_count++] = *one;
    }
    if (def->integrator_count == 0) {
        def->integrators = usual;
        def->integrator_count = sizeof usual / sizeof *usual;
    }
    l->def = def;
    for (int i = 0; drape_integrators[i]; i++)
        if (lab_wants_integrator(l, drape_integrators[i]->entry.name, false))
            DRAPE_TRY(lab_add_integrator(l, &grid, drape_integrators[i]));
    return DRAPE_OK;
}

/* ---- The reference ----
 *
 * The motion of the most accurate run that the time allows, by two families of methods, each over rtol until
 * two runs agree. Its error is estimated by the distance of its last two runs; or, if the families are
 * further apart than their estimates together, by what that leaves to it. Every run is saved; once there are
 * cases, the reference is what is there. */

#define MAX_LEVELS  6
#define SHARE       0.5  /* of the experiment's budget, if it has one, that they may take */
#define GOOD_ENOUGH 1e-6 /* of the diagonal: no further level is needed */
#define GROWTH      2.5  /* expected cost of a level over that of the one before */
#define FIRST       1e-3 /* rtol of the first level: larger ones are not cheaper, see above */

static const char *const families[2] = {"rosenbrock", "radau"};

/* The last level of a family. */
typedef struct level {
    lab_trace trace;
    double error; /* distance from the level before, a share of the diagonal; INFINITY: first level */
    double rtol;
    int count;       /* levels so far; 0: none */
    double took;     /* [s] of the wall clock, of this level; 0: of an earlier call */
    char ended[240]; /* why there is no further one; "": there may be */
} level;

static json_t *settings_of(const char *method, double rtol)
{
    return json_pack("{s:s, s:f}", "/integrator/method", method, "/integrator/rtol", rtol);
}

/* Whether the scene compiles for every family, before anything is written, and runs by the method that it is
 * given. */
static drape_status check_reference(lab *l)
{
    drape_status status = DRAPE_OK;
    for (int i = 0; !status && i < 2; i++) {
        json_t *settings = settings_of(families[i], FIRST);
        drape_model *model;
        status = lab_load(l->ctx, &(lab_request){.def = l->def, .settings = settings}, &model);
        if (!status && model->accuracy.value > 0)
            status = drape_fail(
                l->ctx, DRAPE_E_ARGUMENT,
                "%.400s: /accuracy: an accuracy chooses the method; leave it out to compare methods",
                l->def->scene);
        drape_model_destroy(&model);
        json_decref(settings);
    }
    return status;
}

/* The name of a file of a family. Each shard has files of its own. */
static void name_file(const lab *l, const char *method, const char *ending, char name[64])
{
    char shard[32] = "";
    if (l->def->shards > 1)
        snprintf(shard, sizeof shard, "-%d-of-%d", l->def->shard, l->def->shards);
    snprintf(name, 64, "reference-%s%s.%s", method, shard, ending);
}

static drape_status save(lab *l, const char *method, const level *last)
{
    char name[64];
    const lab_trace *trace = &last->trace;
    name_file(l, method, "f64", name);
    DRAPE_TRY(lab_write_text(l, name, (const char *)trace->x,
                             trace->size * (size_t)trace->frames * sizeof *trace->x));
    name_file(l, method, "json", name);
    return lab_write_json(l, name,
                          json_pack("{s:f, s:o, s:i, s:s}", "rtol", last->rtol, "error",
                                    drape_json_number(last->error), "levels", last->count, "format",
                                    "little endian doubles: frames x nodes x 3, the last one the end"),
                          JSON_INDENT(1) | JSON_REAL_PRECISION(17));
}

/* Reads the saved level of an earlier call, if both files exist and belong to the model. */
static void read_saved(lab *l, const drape_model *model, const char *method, level *last)
{
    char name[64], *data = NULL;
    size_t bytes = 0;
    json_t *about;
    name_file(l, method, "json", name);
    bool read = !lab_read_json(&l->arena, l->folder, name, &about);
    name_file(l, method, "f64", name);
    read = read && !lab_read_text(&l->arena, l->folder, name, &data, &bytes);
    const size_t size = 3 * (size_t)drape_model_node_count(model), frame = size * sizeof(double);
    const int64_t frames = (int64_t)(bytes / frame);
    const double error = lab_number(about, "error"), rtol = lab_number(about, "rtol"),
                 levels = lab_number(about, "levels");
    if (read && frames > 0 && bytes % frame == 0 && rtol > 0 && levels > 0 && levels <= MAX_LEVELS)
        *last = (level){.trace = {size, frames, frames, (double *)(void *)data},
                        .error = error >= 0 ? error : INFINITY,
                        .rtol = rtol,
                        .count = (int)levels};
    json_decref(about);
}

/* How far two levels are apart, a share of the diagonal. */
static double distance(drape_deviation *apart, const lab_trace *a, const lab_trace *b)
{
    drape_deviation_restart(apart);
    for (int64_t k = 0; k < a->frames && k < b->frames; k++)
        drape_deviation_add(apart, (double)k, a->x + a->size * (size_t)k, b->x + b->size * (size_t)k);
    const drape_deviation_cloth *worst = &apart->cloths[drape_deviation_worst(apart)];
    return worst->largest.rms / worst->diagonal;
}

/* Runs and saves the next level. If its run does not complete, *last stays the level before it. */
static drape_status refine(lab *l, drape_deviation *apart, const char *method, double deadline, level *last)
{
    const double rtol = last->count ? last->rtol / 10 : FIRST, start = drape_clock_seconds();
    lab_trace trace = {0};
    json_t *settings = settings_of(method, rtol), *result = NULL;
    const lab_request request = {.def = l->def,
                                 .settings = settings,
                                 .record = &trace,
                                 .arena = &l->arena,
                                 .seconds = INFINITY,
                                 .deadline = deadline,
                                 .repeats = 1};
    const bool late = deadline > 0 && !(start + GROWTH * last->took < deadline);
    drape_status status = late ? DRAPE_OK : lab_run(l->ctx, &request, &result);
    if (result)
        snprintf(last->ended, sizeof last->ended, "%s", lab_text(result, "message"));
    else
        snprintf(last->ended, sizeof last->ended, "half of budget_seconds = %g was used up",
                 l->def->budget_seconds);
    json_decref(settings);
    json_decref(result);
    if (status || !trace.frames)
        return status;
    last->took = drape_clock_seconds() - start;
    last->error = last->count ? distance(apart, &trace, &last->trace) : INFINITY;
    drape_arena_release(&l->arena, last->trace.x);
    last->trace = trace;
    last->rtol = rtol;
    last->count++;
    return save(l, method, last);
}

/* Takes the level with the smaller error as l->reference. DRAPE_E_SOLVER: no two runs completed. */
static drape_status choose(lab *l, drape_deviation *apart, const level last[2])
{
    const bool both = last[0].count && last[1].count;
    const double gap = both ? distance(apart, &last[0].trace, &last[1].trace) : 0;
    l->reference_error = INFINITY;
    for (int i = 0; i < 2; i++) {
        const double own = last[i].error, other = last[!i].error;
        const double error =
            isfinite(own) || !both ? fmax(own, gap - other) : gap + (isfinite(other) ? other : 0);
        if (error < l->reference_error) {
            l->reference_error = error;
            l->reference = last[i].trace;
        }
    }
    l->resumable = last[0].count + last[1].count > 0;
    if (isfinite(l->reference_error))
        return DRAPE_OK;
    return drape_fail(
        l->ctx, DRAPE_E_SOLVER,
        "no reference, which takes two runs that complete: %s completed %d (%s), %s completed %d "
        "(%s). What helps: a larger budget_seconds, a shorter duration, damping if the sheet is stiff and "
        "has none%s",
        families[0], last[0].count, last[0].ended, families[1], last[1].count, last[1].ended,
        l->resumable ? ". The runs are kept, and the same call continues with them" : "");
}

/* Makes the reference, or reads it if there are cases. */
static drape_status make_reference(lab *l)
{
    drape_deviation apart;
    drape_model *model = NULL;
    level last[2] = {{.error = INFINITY}, {.error = INFINITY}};
    const double budget = l->def->budget_seconds, deadline = budget > 0 ? l->start + SHARE * budget : 0;
    bool goes_on = l->def->shards > 1 || json_array_size(l->others) == 0;
    size_t done = 0;
    for (size_t i = 0; i < l->count; i++) {
        goes_on &= !l->results[i] || !lab_is_ours(l, i);
        done += l->results[i] != NULL;
    }
    drape_status status = lab_load(l->ctx, &(lab_request){.def = l->def}, &model);
    if (!status)
        status = drape_deviation_create(&l->arena, model, model, &apart);
    if (!status && goes_on && l->def->progress)
        l->def->progress(l->def->user, 0, 0, NAN);
    for (int i = 0; !status && i < 2; i++)
        read_saved(l, model, families[i], &last[i]);
    const bool none = last[0].count + last[1].count == 0;
    goes_on = goes_on || none; /* such as of cases that were merged, which have their own */
    while (!status && goes_on &&
           !(none &&
             done == l->count)) { /* a run of each in turn, so that there are two that can be compared soon */
        goes_on = false;
        for (int i = 0; !status && i < 2; i++)
            if (!*last[i].ended && last[i].count < MAX_LEVELS && last[i].error > GOOD_ENOUGH) {
                status = refine(l, &apart, families[i], deadline, &last[i]);
                goes_on = true;
            }
    }
    if (!status && !(none && done == l->count))
        status = choose(l, &apart, last);
    drape_model_destroy(&model);
    return status;
}

/* ---- Reading the results ---- */

/* The accuracies that people ask for, shares of the diagonal. */
static const double accuracies[] = {1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5};
#define ACCURACIES ((int)(sizeof accuracies / sizeof *accuracies))
#define OPENING    2 /* the one that opens the report, or the next larger one that is reached */

static bool is_within(const json_t *result, double accuracy)
{
    return lab_is_good(result) &&
           lab_number(result, "error") + lab_number(result, "reference_error") <= accuracy;
}

static bool is_resolved(const json_t *result)
{
    return lab_is_good(result) &&
           lab_number(result, "error") > RESOLVED * lab_number(result, "reference_error");
}

/* The cheapest case of some series that is as accurate. NULL: none is. */
static const json_t *cheapest(const lab_series *list, size_t count, double accuracy)
{
    const json_t *best = NULL;
    for (const lab_series *s = list; s < list + count; s++)
        for (size_t i = 0; i < s->count; i++)
            if (is_within(s->results[i], accuracy) &&
                (!best || lab_number(s->results[i], "cpu_s") < lab_number(best, "cpu_s")))
                best = s->results[i];
    return best;
}

/* "2.1 (1.9 to 2.4)": CPU times of a case over those of another one; the range is that of their runs, if they
 * were repeated. "": there is no such case. */
#define RATIO_TEXT(of, to) ratio_text(of, to, (char[64]){0})
static const char *ratio_text(const json_t *of, const json_t *to, char text[64])
{
    const double least = lab_number(of, "cpu_s"), most = lab_number(of, "cpu_most_s");
    const double to_least = lab_number(to, "cpu_s"), to_most = lab_number(to, "cpu_most_s");
    if (of && most * to_most > least * to_least)
        snprintf(text, 64, "%.2g (%.2g to %.2g)", least / to_least, least / to_most, most / to_least);
    else if (of)
        snprintf(text, 64, "%.2g", least / to_least);
    return text;
}

/* A word of a command as a shell takes it. */
static void put_word(FILE *out, const char *before, const char *word)
{
    static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789/=._-+:,%@";
    const bool quoted = word[strspn(word, plain)] != 0;
    bool controls = false;
    for (const char *c = word; *c; c++)
        controls = controls || (unsigned char)*c < ' ' || *c == 127;
    fprintf(out, controls ? "%s$'" : quoted ? "%s'" : "%s", before);
    for (; *word; word++)
        if (controls && ((unsigned char)*word < ' ' || *word == 127 || *word == '\'' || *word == '\\'))
            fprintf(out, "\\%03o", (unsigned)*word);
        else
            fputs(*word == '\'' ? "'\\''" : (char[]){*word, 0}, out);
    fputs(quoted ? "'" : "", out);
}

/* Makes the command that runs a case, "drape run drop.json --integrator be --dt 1/60", in the arena; NULL: no
 * memory. */
static char *command_of(lab *l, const json_t *result)
{
    const json_t *one = json_array_get(l->cases, (size_t)json_integer_value(json_object_get(result, "case")));
    const char *pointer;
    char *text = NULL, *kept;
    size_t size;
    json_t *value, *setting;
    FILE *out = open_memstream(&text, &size);
    if (!out)
        return NULL;
    const char *scene = lab_text(l->about, "scene");
    put_word(out, *scene == '-' ? "drape run ./" : "drape run ", scene);
    put_word(out, " --integrator ", lab_tag_text(result, "integrator"));
    for (size_t i = 0; (setting = json_array_get(json_object_get(l->about, "settings"), i)); i++) {
        const char *at = json_string_value(json_array_get(setting, 0)),
                   *to = json_string_value(json_array_get(setting, 1));
        put_word(out, " --set ", at ? at : "");
        put_word(out, "=", to ? to : "");
    }
    json_object_foreach(json_object_get(one, "settings"), pointer, value)
    {
        const double number = json_number_value(value), whole = round(1 / number);
        const bool is_dt = strcmp(pointer, "/integrator/dt") == 0;
        if (strcmp(pointer, "/integrator/method") == 0)
            continue;
        put_word(out, is_dt ? " --dt " : " --set ", is_dt ? "" : pointer);
        fputs(is_dt ? "" : "=", out);
        if (is_dt && 1 / whole == number)
            fprintf(out, "1/%.17g", whole);
        else
            fputs(DRAPE_NUMBER_TEXT(number), out);
    }
    kept = fclose(out) ? NULL : drape_arena_text(&l->arena, text);
    free(text);
    return kept;
}

/* "For 1 % of the size (24.3 mm) use newton_k, dt 1/120 s: 0.83 s of CPU; bdf2 takes 2.1 (1.9 to 2.4) times
 * as much", how far it is off and where, and the command. */
static drape_status report_cheapest(lab *l, const lab_series *list, size_t count, double accuracy)
{
    const json_t *best = cheapest(list, count, accuracy);
    const char *command = command_of(l, best), *times = "times as much";
    char knob[64];
    if (!command)
        return DRAPE_E_MEMORY;
    lab_knob_text(best, knob);
    fprintf(l->summary, "For %.3g %% of the size (%.3g mm) use %s, %s: %.2g s of CPU", 100 * accuracy,
            1e3 * accuracy * lab_number(best, "diagonal_m"), lab_tag_text(best, "series"), knob,
            lab_number(best, "cpu_s"));
    for (const lab_series *s = list; s < list + count; s++) {
        const json_t *other = cheapest(s, 1, accuracy);
        if (!other || other == best)
            continue;
        fprintf(l->summary, "; %s takes %s %s", s->name, RATIO_TEXT(other, best), times);
        times = "times";
    }
    fprintf(
        l->summary,
        ". It is %.2g %% from the reference (%.3g mm, RMS over the nodes of %s at t=%.4g s), node %.0f by "
        "%.3g mm at t=%.4g s near (%.4g, %.4g, %.4g); the reference is off by %.2g %%, by estimate.\n    "
        "%s\n",
        100 * lab_number(best, "error"), 1e3 * lab_number(best, "error_m"), lab_text(best, "error_cloth"),
        lab_number(best, "error_t_s"), lab_number(best, "worst_node"), 1e3 * lab_number(best, "worst_m"),
        lab_number(best, "worst_t_s"), lab_number(best, "worst_x_m"), lab_number(best, "worst_y_m"),
        lab_number(best, "worst_z_m"), 100 * lab_number(best, "reference_error"), command);
    return DRAPE_OK;
}

/* The cases that did not complete, with their reasons; how well the reference is known. */
static void report_rest(lab *l)
{
    const char *comma = "Did not complete: ";
    double reference = NAN;
    int unresolved = 0;
    char knob[64];
    for (size_t i = 0; i < l->count; i++) {
        const json_t *r = l->results[i];
        if (r && !lab_is_good(r)) {
            lab_knob_text(r, knob);
            fprintf(l->summary, "%s%s, %s (%s: %s)", comma, lab_tag_text(r, "series"), knob,
                    lab_text(r, "status"), lab_text(r, "message"));
            comma = "; ";
        } else if (r) {
            reference = lab_number(r, "reference_error");
            unresolved += !is_resolved(r);
        }
    }
    fputs(*comma == ';' ? ".\n" : "", l->summary);
    if (isnan(reference))
        return;
    fprintf(
        l->summary,
        "The reference's error is estimated as %.2g of the size, the diagonal of the cloth; %d cases closer "
        "than three times that are listed and not drawn.\n",
        reference, unresolved);
}

/* All cases: those that did not complete, or were not run, have no numbers. */
static void write_cases(lab *l)
{
    static const char *const keys[] = {"error",      "error_m",   "error_t_s", "worst_m",   "worst_node",
                                       "worst_t_s",  "worst_x_m", "worst_y_m", "worst_z_m", "cpu_s",
                                       "cpu_most_s", "accepted",  "rejected",  "residuals"};
    enum { KEYS = sizeof keys / sizeof *keys };
    const lab_table t = {.l = l};
    char knob[64], cells[32 * KEYS] = "";
    for (size_t k = 0; k < KEYS; k++)
        snprintf(cells + strlen(cells), sizeof cells - strlen(cells), "\t%s", keys[k]);
    lab_table_begin(&t, "All cases", "integrator\tsetting\tstatus\tcloth%s", cells);
    for (size_t i = 0; i < l->count; i++) {
        const json_t *r = l->results[i], *one = r ? r : json_array_get(l->cases, i);
        lab_knob_text(one, knob);
        *cells = 0;
        for (size_t k = 0; k < KEYS; k++) {
            const double value = lab_number(r, keys[k]);
            snprintf(cells + strlen(cells), sizeof cells - strlen(cells),
                     !lab_is_good(r)         ? "\t"
                     : value == floor(value) ? "\t%.0f"
                                             : "\t%.4g",
                     value);
        }
        lab_table_row(&t, "%s\t%s\t%s\t%s%s", lab_tag_text(one, "series"), knob,
                      r ? lab_text(r, "status") : "not run", lab_text(r, "error_cloth"), cells);
    }
    lab_table_end(&t);
}

static drape_status report(lab *l)
{
#define ERROR .y = "error", .y_label = "largest RMS error / diagonal"
    static const lab_chart charts[] = {
        {.name = "error_cpu", .x = "cpu_s", .x_label = "CPU [s]", ERROR, .shows = is_resolved},
        {.name = "worst_cpu",
         .x = "cpu_s",
         .x_label = "CPU [s]",
         .y = "worst_m",
         .y_label = "largest error of a node [m]",
         .shows = is_resolved},
    };
    size_t count;
    const lab_series *list = lab_list_series(l, NULL, &count);
    const json_t *opening, *next;
    int k = OPENING;
    if (!list)
        return DRAPE_E_MEMORY;
    while (!(opening = cheapest(list, count, accuracies[k])) && k > 0)
        k--;
    if (opening)
        DRAPE_TRY(report_cheapest(l, list, count, accuracies[k]));
    else
        fprintf(l->summary,
                "No case is known to be within %g %% of the size: a shorter duration or a larger "
                "budget may find one.\n",
                100 * accuracies[k]);
    for (const json_t *best = opening; best && ++k <= ACCURACIES; best = next) {
        next = k < ACCURACIES ? cheapest(list, count, accuracies[k]) : NULL;
        if (best != next && best != opening)
            DRAPE_TRY(report_cheapest(l, list, count, accuracies[k - 1]));
    }
    for (size_t i = 0; i < sizeof charts / sizeof *charts; i++) {
        DRAPE_TRY(lab_draw_series(l, &charts[i], list, count));
        fflush(l->page);
        l->lead_size = i == 0 ? l->page_size : l->lead_size;
    }
    report_rest(l);
    write_cases(l);
    return DRAPE_OK;
}

const lab_experiment_ops lab_experiment_tradeoff = {
    .entry = {.name = "tradeoff", .summary = "work against accuracy of integrators over their settings"},
    .compares_costs = true,
    .partial = true,
    .grows = true,
    .plan = plan,
    .check = check_reference,
    .prepare = make_reference,
    .report = report,
};
