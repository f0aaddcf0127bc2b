/* reference.c: see lab.h. */
#include "lab/lab.h"

#include "base/clock.h"
#include "lab/text.h"
#include "model/model.h"

#include <math.h>
#include <string.h>

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

drape_status lab_check_reference(lab *l)
{
    drape_status status = DRAPE_OK;
    for (int i = 0; !status && i < SEQUENCES; i++) {
        json_t *settings = settings_of(&sequences[i], sequences[i].first);
        status = lab_try(l->ctx, &(lab_request){.def = l->def, .settings = settings});
        json_decref(settings);
    }
    return status;
}

/* ---- Files ---- */

/* The name of a file of a sequence; NULL: of the reference that was chosen. Shards in one folder each make
 * their own. */
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

/* Runs and saves the next level. If it does not complete, *last keeps the level before, and why. */
static drape_status refine(lab *l, const drape_model *model, const sequence *s, double deadline, level *last)
{
    const double knob = last->count ? last->knob * s->ratio : s->first, start = drape_clock_thread_seconds();
    lab_trace trace = {0};
    json_t *settings = settings_of(s, knob), *result = NULL;
    const lab_request request = {.def = l->def,
                                 .settings = settings,
                                 .record = &trace,
                                 .arena = &l->arena,
                                 .seconds = BUDGET * l->def->case_seconds - last->spent,
                                 .deadline = deadline,
                                 .repeats = 1};
    drape_status status = lab_run(l->ctx, &request, &result);
    const bool good = !status && lab_is_good(result);
    if (!good) { /* a run that the deadline stopped has no result */
        const bool over = strcmp(lab_text(result, "status"), "over_budget") == 0;
        last->ended_by = !result ? BUDGET_SECONDS : over ? CASE_SECONDS : FAILURE;
        snprintf(last->failure, sizeof last->failure, "%s", lab_text(result, "message"));
    }
    json_decref(settings);
    json_decref(result);
    last->took = drape_clock_thread_seconds() - start;
    last->spent += last->took;
    if (!good) {
        drape_arena_release(&l->arena, trace.x);
        return status;
    }
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

drape_status lab_make_reference(lab *l)
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
