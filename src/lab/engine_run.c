/* engine_run.c: see engine.h. */
#include "lab/engine.h"

#include "base/clock.h"
#include "base/def.h"
#include "base/hash.h"
#include "base/vec3.h"
#include "geometry/deviation.h"
#include "io/scene_copy.h"
#include "model/model.h"
#include "sim/identity.h"
#include "sim/sim.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SHORT 1.0 /* [s] CPU: longer runs are not repeated, since noise is a small share of them */

/* One run: what is measured while it runs, and at its end. */
typedef struct run {
    const lab_request *request;
    const drape_model *model;
    double start;           /* [s] CPU of the thread */
    double cpu, most, wall; /* [s] of the steps; of runs of the same case the least and the most CPU */
    double
        explicit_limit; /* [s] the step that an explicit integrator could take at the start; NaN for others */
    double kinetic;     /* [J] the largest */
    drape_deviation *apart; /* from the reference, at its frames; NULL: there is none, or it is at `times` */
    double far;             /* [m] the largest distance of those at `times` */
    bool over_budget;       /* stopped for its CPU time */
    bool late;              /* stopped at the deadline */
    bool again;             /* a run of the same case is done: this one has no deadline */
    bool cancelled;
    drape_status status;
    char message[DRAPE_MESSAGE_SIZE];
} run;

void drape_lab_def_init(drape_lab_def *def, size_t struct_size)
{
    const drape_lab_def defaults = {.struct_size = struct_size,
                                    .levels = 6,
                                    .strain_limit = 0.2,
                                    .case_seconds = 30,
                                    .repeats = 3,
                                    .jobs = 1,
                                    .shard = 1,
                                    .shards = 1};
    drape_def_fill(def, struct_size, &defaults, sizeof defaults);
}

drape_status lab_load_scene(drape_context *ctx, const lab_request *request, drape_scene **scene)
{
    const drape_lab_def *def = request->def;
    const char *pointer;
    json_t *value;
    drape_status status = drape_scene_load(ctx, request->scene ? request->scene : def->scene, scene);
    for (size_t i = 0; !status && i < def->setting_count; i++)
        status = drape_scene_set(*scene, def->settings[i].pointer, def->settings[i].value);
    json_object_foreach((json_t *)(uintptr_t)request->settings, pointer, value)
    {
        char *text = status ? NULL : json_dumps(value, JSON_ENCODE_ANY | JSON_REAL_PRECISION(17));
        if (!status)
            status =
                text ? drape_scene_set(*scene, pointer, text) : drape_fail(ctx, DRAPE_E_MEMORY, "no memory");
        free(text);
    }
    return status;
}

drape_status lab_load(drape_context *ctx, const lab_request *request, drape_model **model)
{
    drape_scene *scene = NULL;
    drape_model *compiled = NULL;
    drape_status status = lab_load_scene(ctx, request, &scene);
    if (!status)
        status = drape_scene_compile(scene, &compiled);
    drape_scene_destroy(&scene);
    if (model)
        *model = compiled;
    else
        drape_model_destroy(&compiled);
    return status;
}

typedef struct files {
    drape_context *ctx;
    uint64_t hash;
    int count;
} files;

/* Several files at once, as a folder of frames, are hashed as the model has them. */
static drape_status add_file(void *user, const char *path, const char *pointer)
{
    files *f = user;
    char *bytes;
    size_t size;
    (void)pointer;
    drape_status status = drape_file_read(f->ctx, path, DRAPE_MAX_TABLE, &bytes, &size);
    if (!status)
        f->hash = drape_hash_bytes(f->hash, bytes, size);
    drape_free(f->ctx, bytes);
    f->count++;
    return status == DRAPE_E_MEMORY ? status : DRAPE_OK;
}

static drape_status hash_text(drape_context *ctx, const char *path, uint64_t *hash)
{
    char *text;
    size_t size;
    drape_status status = drape_file_read(ctx, path, DRAPE_MAX_TABLE, &text, &size);
    *hash = status ? 0 : drape_hash_bytes(DRAPE_HASH_START, text, size);
    drape_free(ctx, text);
    return status;
}

void lab_digits(uint64_t hash, char digits[17])
{
    snprintf(digits, 17, "%016" PRIx64, hash);
}

drape_status lab_hash_scene(drape_context *ctx, const char *path, const drape_model *model, char digits[17])
{
    files f = {.ctx = ctx};
    drape_status status = hash_text(ctx, path, &f.hash);
    if (!status)
        status = drape_scene_files(ctx, model, path, add_file, &f);
    const uint64_t compiled = f.count ? drape_model_identity(model) : 0;
    lab_digits(drape_hash_bytes(f.hash, &compiled, f.count ? sizeof compiled : 0), digits);
    return status;
}

static const char *path_of(const lab_request *request)
{
    return request->scene ? request->scene : request->def->scene;
}

drape_status lab_identify(drape_context *ctx, const lab_request *request, char digits[17])
{
    drape_model *model = NULL;
    const lab_request plain = {.def = request->def, .scene = request->scene, .settings = request->identified};
    drape_status status = lab_load(ctx, &plain, &model);
    if (!status)
        status = lab_hash_scene(ctx, path_of(request), model, digits);
    drape_model_destroy(&model);
    return status;
}

drape_status lab_check_identity(drape_context *ctx, const lab_request *request)
{
    uint64_t hash;
    char now[17];
    drape_status status = hash_text(ctx, path_of(request), &hash);
    lab_digits(hash, now); /* the identity of a scene without files: there is nothing to compile */
    if (!status && strcmp(now, request->identity) != 0)
        status = lab_identify(ctx, request, now);
    if (!status && strcmp(now, request->identity) != 0)
        status = drape_fail(ctx, DRAPE_E_ARGUMENT,
                            "\"%.400s\", or a file that it names, was changed while the experiment runs; the "
                            "results so far are of what it was before",
                            path_of(request));
    return status;
}

static drape_status watch(void *user, const drape_event *event)
{
    run *r = user;
    const lab_request *request = r->request;
    const drape_lab_def *def = request->def;
    const lab_trace *reference = request->reference;
    if (event->kind == DRAPE_EVENT_FRAME) {
        if (request->times)
            return DRAPE_OK;
        if (r->apart && event->frame < reference->frames - 1) /* the last one is the end, not a frame */
            drape_deviation_add(r->apart, event->time, event->positions,
                                reference->x + reference->size * (size_t)event->frame);
        if (request->record)
            lab_trace_add(request->record, event->positions);
        return DRAPE_OK;
    }
    r->kinetic = fmax(r->kinetic, drape_sim_energy(event->sim).kinetic);
    r->over_budget = drape_clock_thread_seconds() - r->start > request->seconds;
    r->late = !r->again && request->deadline > 0 && drape_clock_seconds() > request->deadline;
    r->cancelled =
        (request->given_up && atomic_load(request->given_up)) || (def->cancel && def->cancel(def->user));
    return r->over_budget || r->late || r->cancelled ? DRAPE_RETRY_REJECTED : DRAPE_OK;
}

static drape_status run_once(drape_context *ctx, drape_sim *sim, run *r)
{
    drape_stability s = {0};
    drape_status status = drape_sim_observe(sim, watch, r);
    if (status)
        return status;
    r->explicit_limit = NAN;
    if (sim->chosen.integrator->stability) {
        const double dt = drape_chosen_integrator_value(&sim->chosen, "dt", 0);
        sim->chosen.integrator->stability(sim->integrator, drape_sim_state(sim), dt, &s);
        r->explicit_limit = dt * s.limit / s.substep; /* with as many substeps */
    }
    r->start = drape_clock_thread_seconds();
    const double wall = drape_clock_seconds();
    const lab_request *request = r->request;
    if (!request->times)
        r->status = drape_sim_advance(sim, drape_model_duration(r->model));
    for (size_t i = 0; request->times && !r->status && i < request->time_count; i++) {
        r->status = drape_sim_advance(sim, request->times[i]); /* a step ends there */
        if (!r->status && request->reference && (int64_t)i < request->reference->frames)
            r->far = fmax(r->far, lab_distance(r->model, drape_sim_positions(sim),
                                               request->reference->x + request->reference->size * i));
        if (!r->status && request->record)
            lab_trace_add(request->record, drape_sim_positions(sim));
    }
    if (r->status == DRAPE_E_STOPPED && drape_sim_stopped_by(sim) >= 0)
        r->status = DRAPE_OK; /* as the scene says */
    r->cpu = drape_clock_thread_seconds() - r->start;
    r->wall = drape_clock_seconds() - wall;
    snprintf(r->message, sizeof r->message, "%s", r->status ? drape_context_message(ctx) : "");
    if (r->over_budget)
        snprintf(r->message, sizeof r->message, "t=%.9g: its budget of %.4g s of CPU time was used up",
                 drape_sim_time(sim), request->seconds);
    if (request->record && !request->times)
        lab_trace_add(request->record, drape_sim_positions(sim));
    if (r->apart && !r->status)
        drape_deviation_add(r->apart, drape_sim_time(sim), drape_sim_positions(sim),
                            lab_trace_end(request->reference));
    return r->cancelled ? drape_fail(ctx, DRAPE_E_STOPPED, "interrupted") : DRAPE_OK;
}

/* ---- The result ---- */

/* How far the run is from the reference: the cloth of which that is the largest share of its diagonal, its
 * largest RMS distance of all frames, and its furthest node. Takes the reference; returns it. */
static json_t *describe_distance(const run *r, json_t *result)
{
    const int32_t c = drape_deviation_worst(r->apart);
    const drape_deviation_cloth *cloth = &r->apart->cloths[c];
    const drape_apart *far = &cloth->largest;
    char name[256];
    snprintf(name, sizeof name, "%s", r->model->cloths[c].name);
    drape_make_printable(name);
    result = drape_json_with(result, "error_cloth", drape_json_text(name));
    result = DRAPE_JSON_COUNTS(result, {"worst_node", far->node});
    return DRAPE_JSON_REALS(
        result, {"error", far->rms / cloth->diagonal}, {"error_m", far->rms}, {"error_t_s", far->rms_time},
        {"worst_m", far->distance}, {"worst_t_s", far->time}, {"worst_x_m", far->place[0][0]},
        {"worst_y_m", far->place[0][1]}, {"worst_z_m", far->place[0][2]}, {"diagonal_m", cloth->diagonal},
        {"reference_error", r->request->reference_error});
}

static json_t *describe(const run *r, drape_sim *sim)
{
    const lab_request *request = r->request;
    const drape_statistics s = drape_sim_statistics(sim);
    const double *x = drape_sim_positions(sim), numerical = drape_sim_energy(sim).numerical;
    const bool compares = request->times && request->reference && request->reference->frames;
    const double accepted = (double)s.steps_accepted, rejected = (double)s.steps_rejected;
    const struct {
        const char *key;
        double value;
        bool counts; /* an integer */
    } numbers[] = {{"time_s", drape_sim_time(sim)},
                   {"cpu_s", r->cpu},
                   {"cpu_most_s", r->most},
                   {"wall_s", r->wall},
                   {"energy_numerical_J", numerical},
                   {"energy_drift", r->kinetic > 0 ? numerical / r->kinetic : NAN},
                   {"strain_min", s.steps_accepted ? s.strain_min : NAN},
                   {"strain_max", s.steps_accepted ? s.strain_max : NAN},
                   {"rejected_share", accepted + rejected > 0 ? rejected / (accepted + rejected) : NAN},
                   {"iterations_per_step", accepted > 0 ? (double)s.newton_iterations / accepted : NAN},
                   {"h_min_s", s.h_min},
                   {"h_max_s", s.h_max},
                   {"explicit_limit_s", r->explicit_limit},
                   {"nodes", (double)drape_model_node_count(r->model), true},
                   {"accepted", (double)s.steps_accepted, true},
                   {"rejected", (double)s.steps_rejected, true},
                   {"unconverged", (double)s.steps_unconverged, true},
                   {"iterations", (double)s.newton_iterations, true},
                   {"residuals", (double)s.residuals, true},
                   {"jacobians", (double)s.jacobians, true},
                   {"factorizations", (double)s.factorizations, true},
                   {"linear_iterations", (double)s.linear_iterations, true}};
    /* A case that took too long is not a failure of the simulation. */
    json_t *result = json_pack("{s:s, s:s}", "status",
                               r->over_budget ? "over_budget" : drape_status_name(r->status), "message",
                               r->message),
           *reasons = json_object();
    const char *reason;
    int64_t count;
    for (int i = 0; (reason = drape_sim_reason(sim, i, &count)); i++)
        json_object_set_new(reasons, reason, json_integer(count));
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        json_object_set_new(result, numbers[i].key,
                            numbers[i].counts ? json_integer((json_int_t)numbers[i].value)
                                              : drape_json_number(numbers[i].value));
    json_object_set_new(result, "reasons", reasons);
    if (r->apart && !r->status)
        result = describe_distance(r, result);
    if (compares) {
        /* Errors relative to the size of the scene, of a run that reached its last time. */
        const double size = r->model->length, *end = lab_trace_end(request->reference);
        const double error_end = r->status ? NAN : lab_distance(r->model, x, end) / size,
                     digits = r->status ? NAN : lab_correct_digits(r->model, x, end);
        json_object_set_new(result, "reference_error_m", drape_json_number(request->reference_error));
        json_object_set_new(result, "size_m", json_real(size));
        json_object_set_new(result, "error_end", drape_json_number(error_end));
        json_object_set_new(result, "error_max", drape_json_number(r->status ? NAN : r->far / size));
        json_object_set_new(result, "mescd", drape_json_number(digits));
    }
    json_t *positions = request->compared ? json_array() : NULL;
    for (int32_t c = 0; positions && c < r->model->cloth_count; c++)
        for (size_t i = 0; i < 3 * (size_t)request->compared[c]; i++)
            json_array_append_new(positions,
                                  drape_json_number(x[3 * (size_t)r->model->cloths[c].first_node + i]));
    if (positions)
        json_object_set_new(result, "positions", positions);
    return result;
}

drape_status lab_run(drape_context *ctx, const lab_request *request, json_t **result)
{
    drape_model *model = NULL;
    drape_arena arena = drape_arena_of(ctx);
    drape_deviation apart;
    double least = INFINITY, most = 0;
    bool repeat = true;
    const bool compares = !request->times && request->reference && request->reference->frames;
    *result = NULL;
    drape_status status = lab_load(ctx, request, &model);
    if (request->record)
        *request->record = (lab_trace){0};
    if (!status && request->record) {
        const double frames = ceil(drape_model_duration(model) * drape_model_frame_rate(model)) + 3;
        status = lab_trace_create(request->arena, 3 * (size_t)drape_model_node_count(model),
                                  request->times ? (int64_t)request->time_count : (int64_t)frames,
                                  request->record);
    }
    if (!status && compares)
        status = drape_deviation_create(&arena, model, model, &apart);
    for (int i = 1; !status && repeat; i++) {
        drape_sim *sim = NULL;
        run r = {.request = request, .model = model, .apart = compares ? &apart : NULL, .again = i > 1};
        if (compares)
            drape_deviation_restart(&apart);
        status = drape_sim_create(ctx, model, NULL, &sim);
        if (!status)
            status = run_once(ctx, sim, &r);
        r.most = most = fmax(most, r.cpu);
        r.cpu = least = fmin(least, r.cpu);
        repeat = i < request->repeats && !r.status && r.cpu < SHORT;
        repeat = repeat && !r.late;
        if (!status && !repeat && !r.late && !(*result = describe(&r, sim)))
            status = drape_fail(ctx, DRAPE_E_MEMORY, "no memory for a result");
        drape_sim_destroy(&sim);
    }
    drape_arena_free(&arena);
    drape_model_destroy(&model);
    if (request->record && !lab_is_good(*result)) {
        drape_arena_release(request->arena, request->record->x);
        *request->record = (lab_trace){0};
    }
    return status;
}

/* ---- Positions: trace.h ---- */

drape_status lab_trace_create(drape_arena *arena, size_t size, int64_t room, lab_trace *trace)
{
    *trace = (lab_trace){.size = size, .room = room};
    trace->x = drape_arena_take(arena, size * (size_t)room, sizeof *trace->x);
    return trace->x ? DRAPE_OK : DRAPE_E_MEMORY;
}

void lab_trace_add(lab_trace *trace, const double *x)
{
    if (trace->frames < trace->room)
        memcpy(trace->x + trace->size * (size_t)trace->frames++, x, trace->size * sizeof *x);
}

const double *lab_trace_end(const lab_trace *trace)
{
    return trace->x + trace->size * (size_t)(trace->frames - 1);
}

double lab_distance(const drape_model *model, const double *a, const double *b)
{
    const uint8_t *pinned = drape_model_pinned(model);
    double sum = 0;
    int64_t nodes = 0;
    for (int32_t i = 0; i < drape_model_node_count(model); i++) {
        if (pinned[i])
            continue;
        double d[3];
        vec3_sub(a + 3 * (size_t)i, b + 3 * (size_t)i, d);
        sum += vec3_dot(d, d);
        nodes++;
    }
    return nodes ? sqrt(sum / (double)nodes) : 0;
}

double lab_correct_digits(const drape_model *model, const double *x, const double *y)
{
    const double *rest = drape_model_rest_positions(model);
    double largest = 0;
    for (size_t i = 0; i < 3 * (size_t)drape_model_node_count(model); i++)
        largest = fmax(largest, fabs(x[i] - y[i]) / (model->length + fabs(y[i] - rest[i])));
    return largest > 0 ? -log10(largest) : INFINITY;
}
