/* run.c: see run.h. */
#include "lab/run.h"

#include "base/clock.h"
#include "sim/sim.h"

#include <math.h>
#include <stdlib.h>

#define SHORT 1.0 /* [s] CPU: what takes longer is not repeated; noise is a small share of it */

/* What is watched while a case runs. */
typedef struct watcher {
    const lab_request *request;
    const drape_model *model;
    double start;        /* CPU [s] */
    double kinetic;      /* [J] the largest so far */
    double squares, far; /* [m2], [m] of frames that were compared: sum, largest */
    int64_t compared;
    bool late, given_up;
} watcher;

/* One run. */
typedef struct outcome {
    drape_status status;
    char message[DRAPE_MESSAGE_SIZE];
    double cpu, wall; /* [s] of the steps */
    double t, error, squares, far, kinetic, limit;
    int64_t compared;
    bool late;
    drape_statistics work;
    drape_energy energy;
} outcome;

json_t *lab_real(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

static drape_status apply(drape_context *ctx, drape_scene *scene, const lab_request *request)
{
    drape_status status = DRAPE_OK;
    const char *pointer;
    json_t *value;
    const drape_lab_def *def = request->def;
    for (size_t i = 0; !status && i < def->setting_count; i++)
        status = drape_scene_set(scene, def->settings[i].pointer, def->settings[i].value);
    json_object_foreach((json_t *)(uintptr_t)request->settings, pointer, value)
    {
        char *text = status ? NULL : json_dumps(value, JSON_ENCODE_ANY | JSON_REAL_PRECISION(17));
        if (!status)
            status =
                text ? drape_scene_set(scene, pointer, text) : drape_fail(ctx, DRAPE_E_MEMORY, "no memory");
        free(text);
    }
    return status;
}

drape_status lab_load_scene(drape_context *ctx, const lab_request *request, drape_scene **scene)
{
    drape_status status = drape_scene_load(ctx, request->def->scene, scene);
    return status ? status : apply(ctx, *scene, request);
}

drape_status lab_load(drape_context *ctx, const lab_request *request, drape_model **model)
{
    drape_scene *scene = NULL;
    *model = NULL;
    drape_status status = lab_load_scene(ctx, request, &scene);
    if (!status)
        status = drape_scene_compile(scene, model);
    drape_scene_destroy(&scene);
    return status;
}

drape_status lab_try(drape_context *ctx, const drape_lab_def *def, const json_t *settings)
{
    const lab_request request = {.def = def, .settings = settings};
    drape_model *model = NULL;
    drape_status status = lab_load(ctx, &request, &model);
    drape_model_destroy(&model);
    return status;
}

static void compare(watcher *w, const double *x, int64_t frame)
{
    const lab_trace *reference = w->request->reference;
    if (!reference || frame >= reference->frames - 1) /* the last one is the end, not a frame */
        return;
    double d = lab_distance(w->model, x, reference->x + reference->size * (size_t)frame);
    w->squares += d * d;
    w->far = fmax(w->far, d);
    w->compared++;
}

static bool is_given_up(const lab_request *request)
{
    const drape_lab_def *def = request->def;
    return (request->given_up && atomic_load(request->given_up)) || (def->cancel && def->cancel(def->user));
}

static drape_status watch(void *user, const drape_event *event)
{
    watcher *w = user;
    if (event->kind == DRAPE_EVENT_FRAME) {
        compare(w, event->positions, event->frame);
        if (w->request->record)
            lab_trace_add(w->request->record, event->positions);
        return DRAPE_OK;
    }
    w->kinetic = fmax(w->kinetic, drape_sim_energy(event->sim).kinetic);
    w->late = drape_clock_thread_seconds() - w->start > w->request->seconds;
    w->given_up = is_given_up(w->request);
    return w->late || w->given_up ? DRAPE_RETRY_REJECTED : DRAPE_OK;
}

/* The step that an explicit row could take at the start with as many substeps; NaN for others. */
static double explicit_limit(drape_sim *sim)
{
    double dt = drape_chosen_integrator_value(&sim->chosen, "dt", 0);
    drape_stability s = {0};
    if (!sim->chosen.integrator->stability)
        return NAN;
    sim->chosen.integrator->stability(sim->integrator, drape_sim_state(sim), dt, &s);
    return dt * s.limit / s.substep;
}

/* The end of a run, against that of the reference. */
static double end_error(const lab_request *request, const drape_model *model, const double *x)
{
    const lab_trace *reference = request->reference;
    if (!reference || reference->frames == 0)
        return NAN;
    return lab_distance(model, x, reference->x + reference->size * (size_t)(reference->frames - 1));
}

static drape_status run_once(drape_context *ctx, const lab_request *request, const drape_model *model,
                             drape_sim *sim, outcome *out)
{
    watcher w = {.request = request, .model = model};
    drape_status status = drape_sim_observe(sim, watch, &w);
    if (status)
        return status;
    out->limit = explicit_limit(sim);
    w.start = drape_clock_thread_seconds();
    double wall = drape_clock_seconds();
    out->status = drape_sim_advance(sim, drape_model_duration(model));
    out->cpu = drape_clock_thread_seconds() - w.start;
    out->wall = drape_clock_seconds() - wall;
    snprintf(out->message, sizeof out->message, "%s", out->status ? drape_context_message(ctx) : "");
    out->t = drape_sim_time(sim);
    out->error = end_error(request, model, drape_sim_positions(sim));
    out->squares = w.squares;
    out->far = w.far;
    out->compared = w.compared;
    out->kinetic = w.kinetic;
    out->late = w.late;
    out->work = drape_sim_statistics(sim);
    out->energy = drape_sim_energy(sim);
    if (request->record)
        lab_trace_add(request->record, drape_sim_positions(sim));
    return w.given_up ? drape_fail(ctx, DRAPE_E_STOPPED, "interrupted") : DRAPE_OK;
}

/* ---- What is told of it ---- */

static json_t *reasons(const drape_sim *sim)
{
    json_t *object = json_object();
    const char *reason;
    int64_t count;
    for (int i = 0; (reason = drape_sim_reason(sim, i, &count)); i++)
        json_object_set_new(object, reason, json_integer(count));
    return object;
}

static json_t *positions(const lab_request *request, const drape_model *model, const double *x)
{
    json_t *array = json_array();
    double *points = malloc(3 * request->probe->count * sizeof *points);
    if (points)
        lab_probe_take(request->probe, model, x, points);
    for (size_t i = 0; points && i < 3 * request->probe->count; i++)
        json_array_append_new(array, lab_real(points[i]));
    free(points);
    return array;
}

/* What the result says of how it ended: a case that took too long is no failure of the simulation. */
static const char *ending(const outcome *o)
{
    return o->late ? "over_budget" : drape_status_name(o->status);
}

static json_t *describe(const lab_request *request, const drape_model *model, const drape_sim *sim,
                        const outcome *o)
{
    const drape_statistics *s = &o->work;
    const struct {
        const char *key;
        double value;
    } reals[] = {{"time_s", o->t},
                 {"cpu_s", o->cpu},
                 {"wall_s", o->wall},
                 {"error_end_m", o->error},
                 {"error_l2_m", o->compared ? sqrt(o->squares / (double)o->compared) : NAN},
                 {"error_max_m", o->compared ? o->far : NAN},
                 {"energy_numerical_J", o->energy.numerical},
                 {"energy_drift", o->kinetic > 0 ? o->energy.numerical / o->kinetic : NAN},
                 {"strain_min", s->steps_accepted ? s->strain_min : NAN},
                 {"strain_max", s->steps_accepted ? s->strain_max : NAN},
                 {"h_min_s", s->h_min},
                 {"h_max_s", s->h_max},
                 {"explicit_limit_s", o->limit}};
    const struct {
        const char *key;
        int64_t value;
    } counts[] = {{"nodes", drape_model_node_count(model)},
                  {"accepted", s->steps_accepted},
                  {"rejected", s->steps_rejected},
                  {"unconverged", s->steps_unconverged},
                  {"iterations", s->newton_iterations},
                  {"residuals", s->residuals},
                  {"jacobians", s->jacobians},
                  {"factorizations", s->factorizations},
                  {"linear_iterations", s->linear_iterations}};
    json_t *result = json_pack("{s:s, s:s}", "status", ending(o), "message", o->message);
    for (size_t i = 0; i < sizeof reals / sizeof *reals; i++)
        json_object_set_new(result, reals[i].key, lab_real(reals[i].value));
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        json_object_set_new(result, counts[i].key, json_integer(counts[i].value));
    json_object_set_new(result, "reasons", reasons(sim));
    if (request->probe && request->probe->count)
        json_object_set_new(result, "positions", positions(request, model, drape_sim_positions(sim)));
    return result;
}

/* Whether another repeat would tell more. */
static bool repeats(const lab_request *request, const outcome *o, int done)
{
    return done < request->repeats && !o->status && o->cpu < SHORT;
}

static drape_status simulate(drape_context *ctx, const lab_request *request, const drape_model *model,
                             json_t **result)
{
    drape_status status = DRAPE_OK;
    double least = INFINITY;
    bool more = true;
    for (int i = 0; !status && more; i++) {
        drape_sim *sim = NULL;
        outcome o = {.status = DRAPE_OK};
        status = drape_sim_create(ctx, model, NULL, &sim);
        if (!status)
            status = run_once(ctx, request, model, sim, &o);
        o.cpu = least = fmin(least, o.cpu);
        more = !status && repeats(request, &o, i + 1);
        if (!status && !more)
            *result = describe(request, model, sim, &o);
        drape_sim_destroy(&sim);
    }
    if (!status && !*result)
        status = drape_fail(ctx, DRAPE_E_MEMORY, "no memory for a result");
    return status;
}

drape_status lab_run(drape_context *ctx, const lab_request *request, json_t **result)
{
    drape_model *model = NULL;
    *result = NULL;
    drape_status status = lab_load(ctx, request, &model);
    if (!status && request->record) {
        double frames = ceil(drape_model_duration(model) * drape_model_frame_rate(model)) + 2;
        status = lab_trace_create(ctx, 3 * (size_t)drape_model_node_count(model), (int64_t)frames + 1,
                                  request->record);
    }
    if (!status)
        status = simulate(ctx, request, model, result);
    drape_model_destroy(&model);
    return status;
}
