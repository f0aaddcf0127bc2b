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
#define GOOD_ENOUGH 1e-8 /* of the scene's size: no second ladder is tried */
#define GROWTH      2.5  /* a rung costs so much more than the one before, until measured */
#define ENDIAN      "little endian doubles: frames x nodes x 3, the last one the end"

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

typedef struct climb {
    lab_trace best; /* of the last rung */
    double error;   /* distance of its end to that of the rung before; INFINITY: there is none */
    double knob;
    const ladder *ladder;
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

static drape_status climb_ladder(lab *l, const drape_model *model, const ladder *one, double enough, climb *c)
{
    double left = BUDGET * l->def->case_seconds, knob = one->first, took = 0;
    drape_status status = DRAPE_OK;
    *c = (climb){.error = INFINITY, .ladder = one};
    for (int k = 0; k < RUNGS && !status && GROWTH * took < left && c->error > enough;
         k++, knob *= one->ratio) {
        lab_trace trace = {.ctx = NULL};
        bool good;
        double start = drape_clock_thread_seconds();
        status = run_rung(l, one, knob, left, &trace, &good);
        took = drape_clock_thread_seconds() - start;
        left -= took;
        if (!good) {
            lab_trace_free(&trace);
            break;
        }
        c->error = c->best.frames ? lab_distance(model, end_of(&trace), end_of(&c->best)) : INFINITY;
        c->knob = knob;
        lab_trace_free(&c->best);
        c->best = trace;
    }
    return status;
}

/* ---- Keeping it ---- */

static drape_status keep(lab *l, const climb *c)
{
    size_t bytes = c->best.size * (size_t)c->best.frames * sizeof(double);
    drape_status status = lab_write_text(l, "reference.f64", (const char *)c->best.x, bytes);
    json_t *about = json_pack("{s:s, s:s, s:f, s:f, s:I, s:I, s:s}", "method", c->ladder->method, "knob",
                              c->ladder->knob, "value", c->knob, "error_m", c->error, "frames",
                              (json_int_t)c->best.frames, "size", (json_int_t)c->best.size, "format", ENDIAN);
    char *text = about ? json_dumps(about, JSON_INDENT(1)) : NULL;
    if (!status)
        status = text ? lab_write_text(l, "reference.json", text, strlen(text))
                      : drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for the reference");
    free(text);
    json_decref(about);
    return status;
}

/* Both files are there and fit each other: an earlier run's. */
static bool read_back(lab *l)
{
    char *text = NULL, *data = NULL;
    size_t length = 0, bytes = 0;
    bool read = !lab_read_text(l->ctx, l->folder, "reference.json", &text, &length) &&
                !lab_read_text(l->ctx, l->folder, "reference.f64", &data, &bytes);
    json_t *about = read ? json_loadb(text, length, 0, NULL) : NULL;
    int64_t frames = json_integer_value(json_object_get(about, "frames"));
    size_t size = (size_t)json_integer_value(json_object_get(about, "size"));
    bool fits = about && frames > 0 && bytes == size * (size_t)frames * sizeof(double) &&
                !lab_trace_create(l->ctx, size, frames, &l->reference);
    if (fits) {
        memcpy(l->reference.x, data, bytes);
        l->reference.frames = frames;
        l->reference_error = lab_number(about, "error_m");
    }
    free(text);
    free(data);
    json_decref(about);
    return fits;
}

static drape_status climb_all(lab *l, const drape_model *model, climb *best)
{
    drape_status status = DRAPE_OK;
    double enough = GOOD_ENOUGH * model->length;
    *best = (climb){.error = INFINITY};
    for (size_t i = 0; !status && i < sizeof ladders / sizeof *ladders && !(best->error < enough); i++) {
        climb c;
        status = climb_ladder(l, model, &ladders[i], enough, &c);
        if (!status && c.error < best->error) {
            lab_trace_free(&best->best);
            *best = c;
        } else {
            lab_trace_free(&c.best);
        }
    }
    return status;
}

drape_status lab_make_reference(lab *l)
{
    drape_model *model = NULL;
    climb best = {.error = INFINITY};
    if (read_back(l))
        return DRAPE_OK;
    if (l->def->progress)
        l->def->progress(l->def->user, 0, 0, NAN);
    const lab_request request = {.def = l->def};
    drape_status status = lab_load(l->ctx, &request, &model);
    if (!status)
        status = climb_all(l, model, &best);
    if (!status && !best.best.frames)
        status = drape_fail(l->ctx, DRAPE_E_SOLVER,
                            "no reference: neither ida nor trbdf2 ends twice within %g s; give more by "
                            "--case-seconds, or a shorter duration",
                            BUDGET * l->def->case_seconds);
    if (!status)
        status = keep(l, &best);
    if (!status) {
        l->reference = best.best;
        l->reference_error = best.error;
    } else {
        lab_trace_free(&best.best);
    }
    drape_model_destroy(&model);
    return status;
}
