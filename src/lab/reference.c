/* reference.c: see reference.h. */
#include "lab/reference.h"

#include "base/clock.h"
#include "io/file.h"
#include "lab/run.h"
#include "lab/text.h"
#include "model/model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RUNGS       6
#define BUDGET      20.0 /* case_seconds that each ladder may take */
#define BEST        1e-8 /* of the scene's size: a ladder ends there */
#define GOOD_ENOUGH 1e-5 /* of the scene's size: no second ladder is tried */
#define GROWTH      2.5  /* a rung costs so much more than the one before, until measured */
#define ENDIAN      "little endian doubles: frames x nodes x 3, the last one the end"
#define FINAL       "reference"

typedef struct ladder {
    const char *method, *knob; /* pointer of what changes */
    double first, ratio;
    const char *also; /* pointer that is set too; NULL: none */
    double also_value;
} ladder;

static const ladder ladders[] = {
    {"ida", "/integrator/rtol", 1e-5, 0.1, "/integrator/max_order", 5},
    {"trbdf2", "/integrator/dt", 1.0 / 960, 0.5, NULL, 0},
};

/* How far a ladder was climbed. Kept in the folder after each rung, so that an interrupted climb goes on. */
typedef struct climb {
    lab_trace best; /* of the last rung */
    double error;   /* distance of its end to that of the rung before; INFINITY: there is none */
    double knob;
    int rungs;          /* climbed */
    double took, spent; /* CPU [s] of the last rung, of all */
} climb;

static json_t *settings_of(const ladder *one, double knob)
{
    json_t *settings = json_pack("{s:s, s:f}", "/integrator/method", one->method, one->knob, knob);
    if (one->also)
        json_object_set_new(settings, one->also, json_real(one->also_value));
    return settings;
}

static drape_status run_rung(lab *l, const ladder *one, double knob, double seconds, lab_trace *trace,
                             bool *good)
{
    json_t *settings = settings_of(one, knob), *result = NULL;
    const lab_request request = {
        .def = l->def, .settings = settings, .record = trace, .seconds = seconds, .repeats = 1};
    drape_status status = lab_run(l->ctx, &request, &result);
    *good = !status && lab_is_good(result);
    json_decref(settings);
    json_decref(result);
    return status;
}

static const double *end_of(const lab_trace *trace)
{
    return trace->x + trace->size * (size_t)(trace->frames - 1);
}

drape_status lab_check_reference(lab *l)
{
    drape_status status = DRAPE_OK;
    for (size_t i = 0; !status && i < sizeof ladders / sizeof *ladders; i++) {
        json_t *settings = settings_of(&ladders[i], ladders[i].first);
        status = lab_try(l->ctx, l->def, settings);
        json_decref(settings);
    }
    return status;
}

/* ---- Keeping it ---- */

static drape_status keep(lab *l, const char *name, const ladder *one, const climb *c)
{
    char file[64];
    size_t bytes = c->best.size * (size_t)c->best.frames * sizeof(double);
    snprintf(file, sizeof file, "%s.f64", name);
    drape_status status = lab_write_text(l, file, (const char *)c->best.x, bytes);
    json_t *about = json_pack("{s:s, s:s, s:f, s:o, s:I, s:I, s:s, s:i, s:f, s:f}", "method", one->method,
                              "knob", one->knob, "value", c->knob, "error_m", lab_real(c->error), "frames",
                              (json_int_t)c->best.frames, "size", (json_int_t)c->best.size, "format", ENDIAN,
                              "rungs", c->rungs, "took_s", c->took, "spent_s", c->spent);
    char *text = about ? json_dumps(about, JSON_INDENT(1) | JSON_REAL_PRECISION(17)) : NULL;
    snprintf(file, sizeof file, "%s.json", name);
    if (!status)
        status = text ? lab_write_text(l, file, text, strlen(text))
                      : drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for the reference");
    free(text);
    json_decref(about);
    return status;
}

/* Both files are there and fit each other: an earlier run's. */
static bool read_back(lab *l, const char *name, climb *c)
{
    char file[64], *text = NULL, *data = NULL;
    size_t length = 0, bytes = 0;
    snprintf(file, sizeof file, "%s.json", name);
    bool read = !lab_read_text(l->ctx, l->folder, file, &text, &length);
    snprintf(file, sizeof file, "%s.f64", name);
    read = read && !lab_read_text(l->ctx, l->folder, file, &data, &bytes);
    json_t *about = read ? json_loadb(text, length, 0, NULL) : NULL;
    int64_t frames = json_integer_value(json_object_get(about, "frames"));
    size_t size = (size_t)json_integer_value(json_object_get(about, "size"));
    bool fits = about && frames > 0 && bytes == size * (size_t)frames * sizeof(double) &&
                !lab_trace_create(l->ctx, size, frames, &c->best);
    if (fits) {
        const double error = lab_number(about, "error_m");
        memcpy(c->best.x, data, bytes);
        c->best.frames = frames;
        c->error = isnan(error) ? INFINITY : error;
        c->knob = lab_number(about, "value");
        c->rungs = (int)json_integer_value(json_object_get(about, "rungs"));
        c->took = lab_number(about, "took_s");
        c->spent = lab_number(about, "spent_s");
    }
    free(text);
    free(data);
    json_decref(about);
    return fits;
}

static void forget(const lab *l, const char *name)
{
    static const char *const endings[] = {"json", "f64"};
    for (int i = 0; i < 2; i++) {
        char path[4096];
        snprintf(path, sizeof path, "%s/%s.%s", l->folder, name, endings[i]);
        remove(path);
    }
}

/* ---- Climbing ---- */

/* Without a ladder that of what was chosen. Shards in one folder climb each by itself. */
static void name_file(const lab *l, const ladder *one, char *name, size_t size)
{
    char shard[32] = "";
    if (l->def->shards > 1)
        snprintf(shard, sizeof shard, "-%d-of-%d", l->def->shard, l->def->shards);
    snprintf(name, size, FINAL "%s%s%s", one ? "-" : "", one ? one->method : "", shard);
}

static void forget_ladders(const lab *l)
{
    char name[64];
    for (size_t i = 0; i < sizeof ladders / sizeof *ladders; i++) {
        name_file(l, &ladders[i], name, sizeof name);
        forget(l, name);
    }
}

/* One rung. *good: it ended; else the climb is where it was. */
static drape_status step_up(lab *l, const drape_model *model, const ladder *one, climb *c, bool *good)
{
    lab_trace trace = {.ctx = NULL};
    const double knob = c->rungs ? c->knob * one->ratio : one->first, start = drape_clock_thread_seconds();
    drape_status status = run_rung(l, one, knob, BUDGET * l->def->case_seconds - c->spent, &trace, good);
    c->took = drape_clock_thread_seconds() - start;
    c->spent += c->took;
    if (!*good) {
        lab_trace_free(&trace);
        return status;
    }
    c->error = c->best.frames ? lab_distance(model, end_of(&trace), end_of(&c->best)) : INFINITY;
    c->knob = knob;
    c->rungs++;
    lab_trace_free(&c->best);
    c->best = trace;
    return status;
}

static drape_status climb_ladder(lab *l, const drape_model *model, const ladder *one, climb *c)
{
    char name[64];
    bool good = true;
    drape_status status = DRAPE_OK;
    *c = (climb){.error = INFINITY};
    name_file(l, one, name, sizeof name);
    read_back(l, name, c);
    while (!status && good && c->rungs < RUNGS && c->error > BEST * model->length &&
           GROWTH * c->took < BUDGET * l->def->case_seconds - c->spent) {
        status = step_up(l, model, one, c, &good);
        if (!status && good)
            status = keep(l, name, one, c);
    }
    return status;
}

/* *which: of the ladders; -1: none ended twice. */
static drape_status climb_all(lab *l, const drape_model *model, climb *best, int *which)
{
    const int count = sizeof ladders / sizeof *ladders;
    drape_status status = DRAPE_OK;
    *best = (climb){.error = INFINITY};
    *which = -1;
    for (int i = 0; !status && i < count && !(best->error < GOOD_ENOUGH * model->length); i++) {
        climb c;
        status = climb_ladder(l, model, &ladders[i], &c);
        if (!status && c.error < best->error) {
            lab_trace_free(&best->best);
            *best = c;
            *which = i;
        } else {
            lab_trace_free(&c.best);
        }
    }
    return status;
}

static drape_status choose(lab *l, const drape_model *model, climb *best)
{
    char name[64];
    int which;
    drape_status status = climb_all(l, model, best, &which);
    if (!status && which < 0) {
        forget_ladders(l);
        return drape_fail(l->ctx, DRAPE_E_SOLVER,
                          "no reference: neither ida nor trbdf2 ends twice within %g s; give more by "
                          "--case-seconds, or a shorter duration",
                          BUDGET * l->def->case_seconds);
    }
    name_file(l, NULL, name, sizeof name);
    if (!status)
        status = keep(l, name, &ladders[which], best);
    if (!status)
        forget_ladders(l);
    return status;
}

drape_status lab_make_reference(lab *l)
{
    drape_model *model = NULL;
    climb best = {.error = INFINITY};
    drape_status status = DRAPE_OK;
    char name[64];
    name_file(l, NULL, name, sizeof name);
    if (!read_back(l, name, &best)) {
        const lab_request request = {.def = l->def};
        if (l->def->progress)
            l->def->progress(l->def->user, 0, 0, NAN);
        status = lab_load(l->ctx, &request, &model);
        if (!status)
            status = choose(l, model, &best);
        drape_model_destroy(&model);
    }
    if (status) {
        lab_trace_free(&best.best);
        return status;
    }
    l->reference = best.best;
    l->reference_error = best.error;
    return DRAPE_OK;
}
