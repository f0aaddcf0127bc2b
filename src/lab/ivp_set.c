/* ivp_set.c: the scenes of the test set and their files; see ivp.h. */
#include "base/hash.h"
#include "lab/ivp.h"
#include "lab/lab.h"
#include "lab/text.h"
#include "model/model.h"
#include "sim/sim.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define MOST_TIMES   1000
#define STABLE_SHARE 0.25 /* of the stability limit at the start, of an explicit method's step */

/* ---- Scenes ---- */

static drape_status make_times(lab_ivp *s)
{
    const double duration = drape_model_duration(s->model), rate = drape_model_frame_rate(s->model);
    const double count = round(duration * rate);
    if (!(fabs(duration * rate - count) < 1e-9 * count) || count < 2 || count > MOST_TIMES)
        return drape_fail(s->arena->ctx, DRAPE_E_ARGUMENT,
                          "%.300s: duration %g s times frame_rate %g/s must be a whole number, 2 to %d: the "
                          "frames are the times of the reference",
                          s->path, duration, rate, MOST_TIMES);
    s->time_count = (size_t)count;
    s->interval = duration / count;
    s->times = drape_arena_take(s->arena, s->time_count, sizeof *s->times);
    for (size_t i = 0; s->times && i < s->time_count; i++)
        s->times[i] = i + 1 == s->time_count ? duration : (double)(i + 1) / rate;
    return s->times ? DRAPE_OK : DRAPE_E_MEMORY;
}

drape_status lab_ivp_open(drape_arena *arena, const char *path, lab_ivp *s)
{
    char *name;
    *s = (lab_ivp){.arena = arena, .path = drape_arena_text(arena, path)};
    const char *slash = strrchr(path, '/');
    s->stem = name = drape_arena_text(arena, slash ? slash + 1 : path);
    if (!s->path || !name)
        return DRAPE_E_MEMORY;
    name[strrchr(name, '.') ? (size_t)(strrchr(name, '.') - name) : strlen(name)] = 0;
    /* The name as it is shown and stored: printable, and in UTF-8. */
    char *copy = drape_arena_text(arena, name);
    if (copy)
        drape_make_printable(copy);
    json_t *text = copy ? drape_json_text(copy) : NULL;
    s->name = text ? drape_arena_text(arena, json_string_value(text)) : NULL;
    json_decref(text);
    if (!s->name)
        return DRAPE_E_MEMORY;
    drape_status status = drape_model_load(arena->ctx, path, &s->model);
    if (!status)
        status = lab_hash_scene(arena->ctx, path, s->model, s->hash);
    if (status)
        return status;
    s->size = s->model->length;
    for (int32_t i = 0; i < s->model->node_count; i++)
        s->node_mass += s->model->mass[i];
    s->node_mass /= s->model->node_count;
    s->contact = s->model->collider_count > 0 || s->model->contact.self;
    for (int32_t i = 0; i < s->model->event_count; i++)
        if (s->model->events[i].action != DRAPE_ACTION_RECORD)
            return drape_fail(
                arena->ctx, DRAPE_E_ARGUMENT,
                "%.300s: /events/%d/action: must be \"record\": a reference is of a motion that "
                "nothing ends or changes",
                path, (int)i);
    return make_times(s);
}

void lab_ivp_close(lab_ivp *s)
{
    drape_model_destroy(&s->model);
}

bool lab_ivp_admits(const lab_ivp *s, const drape_integrator_ops *integrator)
{
    return !integrator->steady_state && !(integrator->projects_contact && s->contact);
}

/*
 * A residual r of a node of mass m that has the same sign in all steps displaces it by r/m T^2/2 until the
 * end: r = c m L/T^2 (h/T)^p displaces by a share c/2 (h/T)^p of the size L, and c = 0.01 makes that small
 * beside an error of order p. In practice residuals have changing signs, and do less.
 */
static double residual_of_size(const lab_ivp *s)
{
    const double end = s->times[s->time_count - 1];
    return s->node_mass * s->size / (end * end);
}

double lab_ivp_tolerance(const lab_ivp *s, int order, double dt)
{
    const double h = dt / s->times[s->time_count - 1];
    return fmax(1e-2 * residual_of_size(s) * pow(h, order), lab_ivp_least_tolerance(s));
}

double lab_ivp_least_tolerance(const lab_ivp *s)
{
    return 1e-13 * residual_of_size(s);
}

/* ---- Runs ---- */

drape_status lab_ivp_load(const lab_ivp *s, const json_t *settings, drape_model **model)
{
    drape_lab_def def;
    drape_lab_def_init(&def, sizeof def);
    def.scene = s->path;
    return lab_load(s->arena->ctx, &(lab_request){.def = &def, .settings = settings}, model);
}

drape_status lab_ivp_dt(const lab_ivp *s, const drape_integrator_ops *integrator, int steps, double *dt)
{
    drape_sim *sim = NULL;
    drape_model *model = NULL;
    drape_stability found = {0};
    *dt = s->interval / steps;
    if (!integrator->stability)
        return DRAPE_OK;
    json_t *settings =
        json_pack("{s:s, s:f}", "/integrator/method", integrator->entry.name, "/integrator/dt", *dt);
    drape_status status = lab_ivp_load(s, settings, &model);
    if (!status)
        status = drape_sim_create(s->arena->ctx, model, NULL, &sim);
    if (!status)
        integrator->stability(sim->integrator, drape_sim_state(sim), *dt, &found);
    while (!status && found.limit > 0 && *dt > STABLE_SHARE * found.limit)
        *dt /= 2;
    drape_sim_destroy(&sim);
    drape_model_destroy(&model);
    json_decref(settings);
    return status;
}

drape_status lab_ivp_run(const lab_ivp *s, json_t *settings, double seconds, lab_trace *out, json_t **result)
{
    drape_lab_def def;
    drape_lab_def_init(&def, sizeof def);
    def.scene = s->path;
    def.cancel = s->cancel;
    const lab_request request = {.def = &def,
                                 .settings = settings,
                                 .times = s->times,
                                 .time_count = s->time_count,
                                 .record = out,
                                 .arena = s->arena,
                                 .seconds = seconds,
                                 .repeats = 1};
    *out = (lab_trace){0};
    *result = NULL;
    drape_status status = settings ? lab_run(s->arena->ctx, &request, result)
                                   : drape_fail(s->arena->ctx, DRAPE_E_MEMORY, "no memory for settings");
    json_decref(settings);
    if (status || !lab_is_good(*result)) {
        drape_arena_release(s->arena, out->x);
        *out = (lab_trace){0};
    }
    return status;
}

double lab_ivp_distance(const lab_ivp *s, const lab_trace *a, const lab_trace *b)
{
    double largest = 0;
    for (int64_t i = 0; i < a->frames; i++)
        largest =
            fmax(largest, lab_distance(s->model, a->x + a->size * (size_t)i, b->x + b->size * (size_t)i));
    return largest / s->size;
}

/* ---- Files ---- */

char *lab_ivp_file(const lab_ivp *s, const char *kind, const char *ending)
{
    const char *slash = strrchr(s->path, '/');
    const size_t folder = slash ? (size_t)(slash - s->path) + 1 : 0;
    const size_t room = folder + strlen(kind) + strlen(s->stem) + strlen(ending) + 3;
    char *path = drape_arena_take(s->arena, room, 1);
    if (path)
        snprintf(path, room, "%.*s%s/%s.%s", (int)folder, s->path, kind, s->stem, ending);
    return path;
}

drape_status lab_ivp_write(const lab_ivp *s, const char *path, const char *head, size_t head_size,
                           const void *data, size_t size)
{
    drape_file file = {0};
    char *folder = drape_arena_text(s->arena, path);
    if (!folder)
        return DRAPE_E_MEMORY;
    *strrchr(folder, '/') = 0;
    drape_status status = drape_folder_make(s->arena->ctx, folder);
    if (!status)
        status = drape_file_create(s->arena->ctx, strlen(path), &file);
    if (!status) {
        drape_file_name(&file, "%s", path);
        status = drape_file_begin(&file);
    }
    if (!status) {
        drape_file_put(&file, head, head_size);
        drape_file_put(&file, data, size);
        status = drape_file_finish(&file);
    }
    drape_file_destroy(&file);
    return status;
}

drape_status lab_ivp_write_json(const lab_ivp *s, const char *path, const json_t *object)
{
    char *text = object ? json_dumps(object, JSON_INDENT(1) | JSON_REAL_PRECISION(9)) : NULL;
    drape_status status = text ? lab_ivp_write(s, path, text, strlen(text), "\n", 1)
                               : drape_fail(s->arena->ctx, DRAPE_E_MEMORY, "no memory for \"%.300s\"", path);
    free(text);
    return status;
}

json_t *lab_ivp_provenance(const lab_ivp *s)
{
    char date[32];
    const time_t now = time(NULL);
    struct tm utc;
    strftime(date, sizeof date, "%Y-%m-%d", gmtime_r(&now, &utc));
    return json_pack("{s:s, s:s, s:s, s:s, s:f, s:i}", "scene", s->name, "scene_hash", s->hash, "drape",
                     drape_version(), "date", date, "size_m", s->size, "nodes",
                     drape_model_node_count(s->model));
}

/* The positions, whose bytes must be those that the JSON describes. */
static drape_status read_positions(lab_ivp *s, const char *path, const json_t *about)
{
    char *bytes, digits[17];
    size_t size;
    drape_status status = lab_read_text(s->arena, NULL, path, &bytes, &size);
    if (status)
        return status;
    lab_digits(drape_hash_bytes(DRAPE_HASH_START, bytes, size), digits);
    if (strcmp(digits, lab_text(about, "data_hash")) != 0)
        return drape_fail(s->arena->ctx, DRAPE_E_PARSE,
                          "%.400s: damaged: its bytes are not those that %.60s.json beside it describes",
                          path, s->name);
    s->reference.frames = s->reference.room = (int64_t)s->time_count;
    s->reference.size = 3 * (size_t)drape_model_node_count(s->model);
    status = lab_ivp_take_frames(s, path, bytes, size, &s->reference.x);
    s->reference.frames = status ? 0 : s->reference.frames;
    return status;
}

drape_status lab_ivp_read_reference(lab_ivp *s)
{
    json_t *about = NULL;
    const char *path = lab_ivp_file(s, "references", "json"), *data = lab_ivp_file(s, "references", "npy");
    drape_status status = path && data ? lab_read_json(s->arena, NULL, path, &about) : DRAPE_E_MEMORY;
    if (!status && strcmp(lab_text(about, "scene_hash"), s->hash) != 0)
        status =
            drape_fail(s->arena->ctx, DRAPE_E_PARSE,
                       "%.400s: of another version of the scene; `drape ivp reference %.300s` makes it anew",
                       path, s->path);
    s->error = lab_number(about, "error");
    if (!status && !(s->error >= 0))
        status = drape_fail(s->arena->ctx, DRAPE_E_PARSE, "%.400s: it has no number \"error\"", path);
    if (!status)
        status = read_positions(s, data, about);
    json_decref(about);
    return status;
}

json_t *lab_ivp_read_horizon(const lab_ivp *s)
{
    json_t *about = NULL;
    const char *path = lab_ivp_file(s, "horizons", "json");
    if (!path || lab_read_json(s->arena, NULL, path, &about) ||
        strcmp(lab_text(about, "scene_hash"), s->hash) == 0)
        return about;
    json_decref(about);
    return NULL;
}
