/* reference.c: see reference.h. */
#include "lab/reference.h"

#include "base/clock.h"
#include "lab/run.h"
#include "lab/text.h"
#include "model/model.h"

#include <math.h>
#include <stdlib.h>
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

/* The last refinement level of a sequence. Every level is saved in the folder; interrupted runs resume. */
typedef struct level {
    lab_trace trace;
    double error; /* distance of its end from that of the level before; INFINITY: first level */
    double knob;
    int count;          /* levels so far; 0: none */
    double took, spent; /* CPU [s] of this level, of all */
} level;

/* [s] of the wall clock by which the next level of sequence i has to be done; 0: the experiment has no
 * budget. needed: there is no reference yet, and without one there is no experiment. */
static double deadline_of(const lab *l, int i, bool needed)
{
    const double budget = l->def->budget_seconds;
    return budget > 0 ? l->start + (needed ? 1 : SHARE * (i + 1) / SEQUENCES) * budget : 0;
}

/* Whether the next level, which takes GROWTH times the last one, is expected to end in time. */
static bool has_time(const lab *l, const level *last, double deadline)
{
    const double next = GROWTH * last->took;
    return next < BUDGET * l->def->case_seconds - last->spent &&
           (deadline <= 0 || drape_clock_seconds() + next < deadline);
}

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
        status = lab_try(l->ctx, l->def, settings);
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
    char *text = about ? json_dumps(about, JSON_INDENT(1) | JSON_REAL_PRECISION(17)) : NULL;
    name_file(l, chosen ? NULL : s, "json", name);
    if (!status)
        status = text ? lab_write_text(l, name, text, strlen(text))
                      : drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for the reference");
    free(text);
    json_decref(about);
    return status;
}

/* Reads the saved level of an earlier run, if both files exist and belong together. s: as in name_file. */
static bool read_saved(lab *l, const sequence *s, level *last)
{
    char name[64], *text = NULL, *data = NULL;
    size_t length = 0, bytes = 0;
    name_file(l, s, "json", name);
    bool read = !lab_read_text(&l->arena, l->folder, name, &text, &length);
    name_file(l, s, "f64", name);
    read = read && !lab_read_text(&l->arena, l->folder, name, &data, &bytes);
    json_t *about = read ? json_loadb(text, length, 0, NULL) : NULL;
    const int64_t frames = json_integer_value(json_object_get(about, "frames"));
    const size_t size = (size_t)json_integer_value(json_object_get(about, "size"));
    const bool fits = about && frames > 0 && bytes == size * (size_t)frames * sizeof(double);
    if (fits) {
        const double error = lab_number(about, "error_m");
        *last = (level){.trace = {size, frames, frames, (double *)(void *)data},
                        .error = isnan(error) ? INFINITY : error,
                        .knob = lab_number(about, "value"),
                        .count = (int)json_integer_value(json_object_get(about, "levels")),
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

/* Runs and saves the next level. *good: it completed; otherwise *last keeps the level before. */
static drape_status refine(lab *l, const drape_model *model, const sequence *s, double deadline, level *last,
                           bool *good)
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
    *good = !status && lab_is_good(result);
    json_decref(settings);
    json_decref(result);
    last->took = drape_clock_thread_seconds() - start;
    last->spent += last->took;
    if (!*good) {
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

/* Refines each sequence as far as is useful and takes the better one. */
static drape_status choose(lab *l, const drape_model *model, level *best)
{
    const sequence *chosen = NULL;
    const bool budget = l->def->budget_seconds > 0;
    drape_status status = DRAPE_OK;
    *best = (level){.error = INFINITY};
    for (int i = 0; !status && i < SEQUENCES && !(best->error < GOOD_ENOUGH * model->length); i++) {
        level last = {.error = INFINITY};
        bool good = true;
        read_saved(l, &sequences[i], &last);
        while (!status && good && last.count < MAX_LEVELS && last.error > BEST * model->length) {
            const double deadline = deadline_of(l, i, !isfinite(best->error) && last.count < 2);
            if (!has_time(l, &last, deadline))
                break;
            status = refine(l, model, &sequences[i], deadline, &last, &good);
        }
        if (!status && last.error < best->error) {
            *best = last;
            chosen = &sequences[i];
        }
    }
    if (!status && !chosen)
        status = drape_fail(
            l->ctx, DRAPE_E_SOLVER,
            "no reference: neither ida nor trbdf2 completes two levels within %g s of CPU time%s; raise "
            "case_seconds%s, or shorten the duration",
            BUDGET * l->def->case_seconds, budget ? " and the budget" : "",
            budget ? " and budget_seconds" : "");
    else if (!status)
        status = save(l, chosen, true, best);
    if (status && status != DRAPE_E_SOLVER)
        return status;
    drape_status removed = drape_folder_remove(l->out, is_sequence, l);
    return status ? status : removed;
}

drape_status lab_make_reference(lab *l)
{
    drape_model *model = NULL;
    level best;
    drape_status status = DRAPE_OK;
    if (!read_saved(l, NULL, &best)) {
        if (l->def->progress)
            l->def->progress(l->def->user, 0, 0, NAN);
        status = lab_load(l->ctx, &(lab_request){.def = l->def}, &model);
        if (!status)
            status = choose(l, model, &best);
        drape_model_destroy(&model);
    }
    if (!status) {
        l->reference = best.trace;
        l->reference_error = best.error;
    }
    return status;
}
