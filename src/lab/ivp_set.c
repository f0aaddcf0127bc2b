/* ivp_set.c: the scenes of the test set and their files, also for other programs: what these need, and how far their
 * motion is from the reference; see ivp.h. */
#include "base/hash.h"

#include "io/export.h"
#include "io/json.h"
#include "io/npy.h"
#include "lab/ivp.h"
#include "lab/lab.h"
#include "lab/text.h"
#include "model/model.h"
#include "sim/sim.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define MOST_TIMES   1000
#define LARGEST      1e150 /* [m] a coordinate: squares of larger ones overflow */
#define STABLE_SHARE 0.25  /* of the stability limit at the start, of an explicit method's step */

/* ---- Scenes ---- */

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

/* Refuses an array of another kind or shape, and says which would be right. */
static drape_status check_array(const lab_ivp *s, const char *path, const drape_npy *array)
{
    char shape[160];
    const int32_t nodes = drape_model_node_count(s->model);
    const int64_t times = (int64_t)s->time_count;
    drape_npy_shape_text(array, shape, sizeof shape);
    if (strcmp(array->type, "<f8") != 0)
        return drape_fail(s->arena->ctx, DRAPE_E_PARSE,
                          "%.300s: its numbers are '%s'; they must be float64, '<f8': numpy's astype(float)",
                          path, array->type);
    if (array->fortran)
        return drape_fail(s->arena->ctx, DRAPE_E_PARSE,
                          "%.300s: it is in Fortran order; it must be in C order: numpy's ascontiguousarray",
                          path);
    if (array->dims != 3 || array->shape[2] != 3 || array->shape[1] != nodes ||
        (array->shape[0] != times && array->shape[0] != times + 1))
        return drape_fail(s->arena->ctx, DRAPE_E_PARSE,
                          "%.300s: its shape is %s; it must be (%" PRId64 ", %" PRId32
                          ", 3), frames x nodes x "
                          "(x, y, z), a frame every %.9g s, or one more with the start",
                          path, shape, times, nodes, s->interval);
    return DRAPE_OK;
}

/* The frames (time_count x nodes x 3) in the bytes of an NPY file, which are in the arena, with the start
 * before them or without; frees the bytes. Errors: DRAPE_E_PARSE, DRAPE_E_MEMORY. */
static drape_status take_frames(const lab_ivp *s, const char *path, char *bytes, size_t size, double **x)
{
    const size_t numbers = 3 * (size_t)drape_model_node_count(s->model), frame = 8 * numbers;
    drape_npy array;
    if (!drape_npy_read(bytes, size, &array))
        return drape_fail(s->arena->ctx, DRAPE_E_PARSE,
                          "%.400s: not an array as numpy.save writes it: its header cannot be read", path);
    drape_status status = check_array(s, path, &array);
    if (status)
        return status;
    const size_t before = (size_t)array.shape[0] - s->time_count;
    if (size != array.data + frame * (size_t)array.shape[0])
        return drape_fail(s->arena->ctx, DRAPE_E_PARSE,
                          "%.400s: its data are not as long as its header says: %zu bytes instead of %zu",
                          path, size - (size < array.data ? size : array.data),
                          frame * (size_t)array.shape[0]);
    double *copy = *x = drape_arena_take(s->arena, s->time_count, frame);
    if (!copy)
        return DRAPE_E_MEMORY;
    memcpy(copy, bytes + array.data + frame * before, frame * s->time_count);
    drape_arena_release(s->arena, bytes);
    for (size_t i = 0; i < numbers * s->time_count; i++)
        if (!(fabs(copy[i]) <= LARGEST))
            return drape_fail(s->arena->ctx, DRAPE_E_PARSE,
                              "%.400s: frame %zu, at %.9g s, node %zu: %g is %s", path, i / numbers + before,
                              s->times[i / numbers], i % numbers / 3, copy[i],
                              isfinite(copy[i]) ? "too large for a root mean square" : "not a finite number");
    return DRAPE_OK;
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
    status = take_frames(s, path, bytes, size, &s->reference.x);
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

/* ---- Score ---- */

/* The error of a frame, relative to the size, and the largest of a node. */
static double frame_error(const lab_ivp *s, const double *x, size_t i, double *largest)
{
    const double *a = x + s->reference.size * i, *b = s->reference.x + s->reference.size * i;
    double far = 0;
    for (size_t k = 0; k < s->reference.size; k += 3)
        far = fmax(far, hypot(hypot(a[k] - b[k], a[k + 1] - b[k + 1]), a[k + 2] - b[k + 2]));
    *largest = far / s->size;
    return lab_distance(s->model, a, b) / s->size;
}

/* As JSON: {"scene", "scene_hash", "size_m", "times_s": [...], "error": [...], "error_largest": [...], "error_end",
 * "error_max", "mescd", "reference_error", "resolved"} */
drape_status lab_ivp_score(const lab_ivp *s, const char *path, bool json, FILE *out)
{
    double *x = NULL, worst = 0, error = 0, far;
    char *bytes;
    size_t size;
    drape_status status = lab_read_text(s->arena, NULL, path, &bytes, &size);
    if (!status)
        status = take_frames(s, path, bytes, size, &x);
    if (status)
        return status;
    json_t *errors = json_array(), *largest = json_array();
    if (!json)
        fprintf(out, "time_s,error,error_largest\n");
    for (size_t i = 0; i < s->time_count; i++) {
        error = frame_error(s, x, i, &far);
        worst = fmax(worst, error);
        errors = drape_json_append(errors, json_real(error));
        largest = drape_json_append(largest, json_real(far));
        if (!json)
            fprintf(out, "%.9g,%.6g,%.6g\n", s->times[i], error, far);
    }
    const double digits = lab_correct_digits(s->model, x + s->reference.size * (s->time_count - 1),
                                             lab_trace_end(&s->reference));
    json_t *all = drape_json_with(json_object(), "scene", drape_json_text(s->name));
    all = drape_json_with(all, "scene_hash", json_string(s->hash));
    all = drape_json_with(all, "size_m", json_real(s->size));
    all = drape_json_with(all, "times_s", drape_json_numbers(s->times, s->time_count));
    all = drape_json_with(all, "error", errors);
    all = drape_json_with(all, "error_largest", largest);
    all = drape_json_with(all, "error_end", json_real(error));
    all = drape_json_with(all, "error_max", json_real(worst));
    all = drape_json_with(all, "mescd",
                          drape_json_number(digits)); /* null: infinitely many, of the reference itself */
    all = drape_json_with(all, "reference_error", json_real(s->error));
    all = drape_json_with(all, "resolved", json_boolean(!(worst < s->error)));
    if (!json) {
        fprintf(out, "error_end %.6g\nerror_max %.6g\nmescd %.4g\nreference_error %.2g\n", error, worst,
                digits, s->error);
        if (worst < s->error)
            fprintf(out, "The error cannot be distinguished from that of the reference.\n");
    } else if (!all || json_dumpf(all, out, JSON_ENSURE_ASCII | JSON_INDENT(2) | JSON_REAL_PRECISION(15)))
        status = drape_fail(s->arena->ctx, DRAPE_E_MEMORY, "the score cannot be printed");
    if (json)
        fputs("\n", out);
    json_decref(all);
    return status;
}

/* ---- Export ---- */

/* The files of the folder. */
enum { START, NODES, PINS, TIMES, SCENE, REFERENCE, ABOUT, EXPORTS };
static const char *const exports[EXPORTS] = {"start.obj",  "nodes.csv",     "pins.csv",      "times.csv",
                                             "scene.json", "reference.npy", "reference.json"};

static bool writes(const void *user, const char *name)
{
    (void)user;
    int i = 0;
    while (i < EXPORTS && strcmp(exports[i], name) != 0)
        i++;
    return i < EXPORTS;
}

/* Puts the contents of a file; v: velocities at the start. */
static drape_status put(const lab_ivp *s, const double *v, int which, drape_file *file)
{
    const double *masses = drape_model_masses(s->model), *x = drape_model_rest_positions(s->model);
    const uint8_t *pinned = drape_model_pinned(s->model);
    const size_t nodes = (size_t)drape_model_node_count(s->model);
    const char *copied = s->path;
    char *bytes;
    size_t size;
    switch (which) {
    case START:
        drape_obj_put_nodes(file, x, (int32_t)nodes);
        drape_obj_put_triangles(file, drape_model_triangles(s->model), drape_model_triangle_count(s->model));
        return DRAPE_OK;
    case NODES:
        drape_file_print(file, "node,mass_kg,pinned,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s\n");
        for (size_t i = 0; i < nodes; i++)
            drape_file_print(file, "%zu,%.17g,%d,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n", i, masses[i],
                             pinned[i], x[3 * i], x[3 * i + 1], x[3 * i + 2], v[3 * i], v[3 * i + 1],
                             v[3 * i + 2]);
        return DRAPE_OK;
    case PINS: /* where pinned nodes are at the times: as the reference has them */
        drape_file_print(file, "time_s,node,x_m,y_m,z_m\n");
        for (size_t k = 0; k <= s->time_count; k++) {
            for (size_t i = 0; i < nodes; i++)
                if (pinned[i])
                    drape_file_print(file, "%.17g,%zu,%.17g,%.17g,%.17g\n", k ? s->times[k - 1] : 0, i,
                                     x[3 * i], x[3 * i + 1], x[3 * i + 2]);
            x = s->reference.x + s->reference.size * (k < s->time_count ? k : 0);
        }
        return DRAPE_OK;
    case TIMES:
        drape_file_print(file, "time_s\n");
        for (size_t k = 0; k < s->time_count; k++)
            drape_file_print(file, "%.17g\n", s->times[k]);
        return DRAPE_OK;
    case REFERENCE:
    case ABOUT:
        copied = lab_ivp_file(s, "references", which == ABOUT ? "json" : "npy");
    }
    drape_status status = copied ? lab_read_text(s->arena, NULL, copied, &bytes, &size) : DRAPE_E_MEMORY;
    if (!status)
        drape_file_put(file, bytes, size);
    return status;
}

drape_status lab_ivp_export(const lab_ivp *s, const char *path, FILE *out)
{
    drape_folder *folder = NULL;
    drape_sim *sim = NULL;
    drape_status status = drape_sim_create(s->arena->ctx, s->model, NULL, &sim);
    if (!status)
        status = drape_folder_open(s->arena->ctx, path, false, &folder);
    if (!status)
        status = drape_folder_protect(folder, s->path);
    if (!status)
        status = drape_folder_check(folder, writes, writes, NULL);
    if (!status)
        status = drape_folder_begin(folder, writes, NULL);
    for (int i = 0; !status && i < EXPORTS; i++) {
        drape_file file = {0};
        status = drape_export_begin(s->arena->ctx, folder, exports[i], &file);
        if (!status)
            status = put(s, drape_sim_velocities(sim), i, &file);
        if (!status)
            status = drape_file_finish(&file);
        drape_file_destroy(&file);
    }
    if (!status) {
        char shown[4096];
        snprintf(shown, sizeof shown, "%s", path);
        drape_make_printable(shown);
        fprintf(out, "export    %s: start.obj, nodes.csv, pins.csv, times.csv, scene.json, reference.npy\n",
                shown);
    }
    drape_folder_close(&folder);
    drape_sim_destroy(&sim);
    return status;
}
