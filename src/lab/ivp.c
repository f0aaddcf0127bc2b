/* ivp.c: the scenes of the test set: their references and horizons, their files, also for other programs:
 * what these need, and how far their motion is from the reference; see ivp.h. */
#include "lab/ivp.h"

#include "base/clock.h"
#include "base/hash.h"
#include "io/export.h"
#include "io/json.h"
#include "io/npy.h"
#include "lab/engine.h"
#include "lab/engine_output.h"
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
    drape_lab_def_init(&s->def, sizeof s->def);
    s->def.scene = s->path;
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
    DRAPE_TRY(drape_model_load(arena->ctx, path, &s->model));
    DRAPE_TRY(lab_hash_scene(arena->ctx, path, s->model, s->hash));
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

/* The smallest tolerance: a residual near rounding. */
static double least_tolerance(const lab_ivp *s)
{
    return 1e-13 * residual_of_size(s);
}

double lab_ivp_tolerance(const lab_ivp *s, int order, double dt)
{
    const double h = dt / s->times[s->time_count - 1];
    return fmax(1e-2 * residual_of_size(s) * pow(h, order), least_tolerance(s));
}

/* ---- Runs ---- */

/* A step of which so many or, of an explicit method, as many times 2^k as keep it below a quarter of its
 * stability limit at the start, make up an interval. */
static drape_status find_dt(const lab_ivp *s, const drape_integrator_ops *integrator, int steps, double *dt)
{
    drape_sim *sim = NULL;
    drape_model *model = NULL;
    drape_stability found = {0};
    *dt = s->interval / steps;
    if (!integrator->stability)
        return DRAPE_OK;
    json_t *settings =
        json_pack("{s:s, s:f}", "/integrator/method", integrator->entry.name, "/integrator/dt", *dt);
    drape_status status =
        lab_load(s->arena->ctx, &(lab_request){.def = &s->def, .settings = settings}, &model);
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

/* The largest distance over the times of two motions, relative to the size. */
static double distance_of(const lab_ivp *s, const lab_trace *a, const lab_trace *b)
{
    double largest = 0;
    for (int64_t i = 0; i < a->frames; i++)
        largest =
            fmax(largest, lab_distance(s->model, a->x + a->size * (size_t)i, b->x + b->size * (size_t)i));
    return largest / s->size;
}

/* ---- Files ---- */

/* "DIR/KIND/NAME.ENDING" in the arena; NULL: out of memory. */
static char *file_of(const lab_ivp *s, const char *kind, const char *ending)
{
    const char *slash = strrchr(s->path, '/');
    const size_t folder = slash ? (size_t)(slash - s->path) + 1 : 0;
    const size_t room = folder + strlen(kind) + strlen(s->stem) + strlen(ending) + 3;
    char *path = drape_arena_take(s->arena, room, 1);
    if (path)
        snprintf(path, room, "%.*s%s/%s.%s", (int)folder, s->path, kind, s->stem, ending);
    return path;
}

/* Writes a file, and its folder if there is none. */
static drape_status write_file(const lab_ivp *s, const char *path, const char *head, size_t head_size,
                               const void *data, size_t size)
{
    drape_file file = {0};
    char *folder = drape_arena_text(s->arena, path);
    if (!folder)
        return DRAPE_E_MEMORY;
    *strrchr(folder, '/') = 0;
    drape_status status = drape_folder_make(s->arena->ctx, folder);
    if (!status)
        status = drape_export_begin(s->arena->ctx, NULL, path, &file);
    if (!status) {
        drape_file_put(&file, head, head_size);
        drape_file_put(&file, data, size);
        status = drape_file_finish(&file);
    }
    drape_file_destroy(&file);
    return status;
}

static drape_status write_json(const lab_ivp *s, const char *path, const json_t *object)
{
    char *text = object ? json_dumps(object, JSON_INDENT(1) | JSON_REAL_PRECISION(9)) : NULL;
    drape_status status = text ? write_file(s, path, text, strlen(text), "\n", 1)
                               : drape_fail(s->arena->ctx, DRAPE_E_MEMORY, "no memory for \"%.300s\"", path);
    free(text);
    return status;
}

/* "scene", "scene_hash", "drape" and "date" of a file of the set; NULL: out of memory. */
static json_t *provenance_of(const lab_ivp *s)
{
    char date[32];
    const time_t now = time(NULL);
    struct tm utc;
    strftime(date, sizeof date, "%Y-%m-%d", gmtime_r(&now, &utc));
    return json_pack("{s:s, s:s, s:s, s:s, s:f, s:i}", "scene", s->name, "scene_hash", s->hash, "drape",
                     drape_version(), "date", date, "size_m", s->size, "nodes",
                     drape_model_node_count(s->model));
}

/* The frames (time_count x nodes x 3) in the bytes of an NPY file, which are in the arena, with the start
 * before them or without; frees the bytes. Refuses an array of another kind or shape, and says which would be
 * right. Errors: DRAPE_E_PARSE, DRAPE_E_MEMORY. */
static drape_status take_frames(const lab_ivp *s, const char *path, char *bytes, size_t size, double **x)
{
    drape_context *ctx = s->arena->ctx;
    const int32_t nodes = drape_model_node_count(s->model);
    const int64_t times = (int64_t)s->time_count;
    const size_t numbers = 3 * (size_t)nodes, frame = 8 * numbers;
    char shape[160];
    drape_npy array;
    if (!drape_npy_read(bytes, size, &array))
        return drape_fail(ctx, DRAPE_E_PARSE,
                          "%.400s: not an array as numpy.save writes it: its header cannot be read", path);
    if (strcmp(array.type, "<f8") != 0)
        return drape_fail(ctx, DRAPE_E_PARSE,
                          "%.300s: its numbers are '%s'; they must be float64, '<f8': numpy's astype(float)",
                          path, array.type);
    if (array.fortran)
        return drape_fail(ctx, DRAPE_E_PARSE,
                          "%.300s: it is in Fortran order; it must be in C order: numpy's ascontiguousarray",
                          path);
    drape_npy_shape_text(&array, shape, sizeof shape);
    if (array.dims != 3 || array.shape[2] != 3 || array.shape[1] != nodes ||
        (array.shape[0] != times && array.shape[0] != times + 1))
        return drape_fail(ctx, DRAPE_E_PARSE,
                          "%.300s: its shape is %s; it must be (%" PRId64 ", %" PRId32
                          ", 3), frames x nodes x "
                          "(x, y, z), a frame every %.9g s, or one more with the start",
                          path, shape, times, nodes, s->interval);
    const size_t frames = (size_t)array.shape[0], before = frames - s->time_count;
    if (size != array.data + frame * frames)
        return drape_fail(ctx, DRAPE_E_PARSE,
                          "%.400s: its data are not as long as its header says: %zu bytes instead of %zu",
                          path, size - (size < array.data ? size : array.data), frame * frames);
    double *copy = *x = drape_arena_take(s->arena, s->time_count, frame);
    if (!copy)
        return DRAPE_E_MEMORY;
    memcpy(copy, bytes + array.data + frame * before, frame * s->time_count);
    drape_arena_release(s->arena, bytes);
    for (size_t i = 0; i < numbers * s->time_count; i++)
        if (!(fabs(copy[i]) <= LARGEST))
            return drape_fail(ctx, DRAPE_E_PARSE, "%.400s: frame %zu, at %.9g s, node %zu: %g is %s", path,
                              i / numbers + before, s->times[i / numbers], i % numbers / 3, copy[i],
                              isfinite(copy[i]) ? "too large for a root mean square" : "not a finite number");
    return DRAPE_OK;
}

/* The bytes of the positions must be those that the JSON describes. */
drape_status lab_ivp_read_reference(lab_ivp *s)
{
    drape_context *ctx = s->arena->ctx;
    json_t *about = NULL;
    char *bytes, digits[17];
    size_t size;
    lab_trace *reference = &s->reference;
    const char *path = file_of(s, "references", "json"), *data = file_of(s, "references", "npy");
    drape_status status = path && data ? lab_read_json(s->arena, NULL, path, &about) : DRAPE_E_MEMORY;
    if (!status && strcmp(lab_text(about, "scene_hash"), s->hash) != 0)
        status =
            drape_fail(ctx, DRAPE_E_PARSE,
                       "%.400s: of another version of the scene; `drape ivp reference %.300s` makes it anew",
                       path, s->path);
    s->error = lab_number(about, "error");
    if (!status && !(s->error >= 0))
        status = drape_fail(ctx, DRAPE_E_PARSE, "%.400s: it has no number \"error\"", path);
    if (!status)
        status = lab_read_text(s->arena, NULL, data, &bytes, &size);
    if (!status) {
        lab_digits(drape_hash_bytes(DRAPE_HASH_START, bytes, size), digits);
        status =
            strcmp(digits, lab_text(about, "data_hash")) == 0
                ? take_frames(s, data, bytes, size, &reference->x)
                : drape_fail(ctx, DRAPE_E_PARSE,
                             "%.400s: damaged: its bytes are not those that %.60s.json beside it describes",
                             data, s->name);
    }
    reference->size = 3 * (size_t)drape_model_node_count(s->model);
    reference->frames = reference->room = status ? 0 : (int64_t)s->time_count;
    json_decref(about);
    return status;
}

json_t *lab_ivp_read_horizon(const lab_ivp *s)
{
    json_t *about = NULL;
    const char *path = file_of(s, "horizons", "json");
    if (!path || lab_read_json(s->arena, NULL, path, &about) ||
        strcmp(lab_text(about, "scene_hash"), s->hash) == 0)
        return about;
    json_decref(about);
    return NULL;
}

/* ---- The reference of a scene ----
 *
 * Each family of methods is refined until it changes no more, or its time is used up; of those of fixed steps
 * the results of successive dt are extrapolated to dt = 0 (Richardson 1911; Hairer, Norsett & Wanner 1993,
 * II.9). The reference is that of the family with the smallest change at its last refinement, and its error
 * the distance to the nearest result of another family. */

#define MAX_LEVELS   10
#define ENOUGH       1e-2 /* of the goal: no further refinement */
#define GROWTH       1.7  /* expected cost of a level over that of the one before, at least */
#define SMOOTH_GOAL  1e-8 /* of the size: families agree to this, */
#define CONTACT_GOAL 1e-5 /* or with contact to this */
#define COARSEST     8    /* steps in an interval at the first level of fixed steps */

/* Methods that have nothing in common but the equations: of different names. A method that the build does not
 * have is left out. */
typedef struct family {
    const char *name, *method;
    double rtol, ratio; /* the first and how it falls; methods of fixed steps: 0, and dt is halved */
    const char *also;   /* a parameter of the method that is set; NULL: none */
    int also_value;
    int stride; /* of the exponents of dt in the error: 2 for a symmetric method */
} family;

static const family families[] = {
    {"Radau", "radau", 1e-6, 0.1, NULL, 0, 1},      {"BDF", "ida", 1e-8, 0.1, "max_order", 5, 1},
    {"SDIRK", "dirk", 1e-6, 0.1, "order", 5, 1},    {"SDIRK", "trbdf2", 0, 0.5, NULL, 0, 1},
    {"Verlet", "verlet", 0, 0.5, "substeps", 1, 2},
};
#define FAMILIES ((int)(sizeof families / sizeof *families))

/* What a family reached. */
typedef struct attempt {
    const family *family;
    lab_trace columns[MAX_LEVELS]; /* of the last level: extrapolated so many times */
    lab_trace best;
    int count, column;   /* levels; the column that is best */
    double knob, change; /* of the last level; the change of best at it, relative to the size */
    double spent;        /* [s] CPU */
    char ended_by[160];
} attempt;

/* Row i of the table of Neville and Aitken from row i - 1, which it replaces: column k + 1 removes the error
 * of the exponent order + k stride. Sets which column changed the least, and by how much. */
static drape_status extrapolate(const lab_ivp *s, attempt *a, lab_trace next)
{
    const int order = lab_find_integrator(a->family->method)->order;
    const int last = a->family->rtol > 0 ? 0 : a->count; /* own steps: nothing is extrapolated */
    const size_t size = next.size * (size_t)next.frames;
    a->change = INFINITY;
    for (int k = 0; k <= last; k++) {
        lab_trace before = a->columns[k];
        const double change = before.frames ? distance_of(s, &next, &before) : INFINITY;
        a->columns[k] = next;
        if (change < a->change) {
            a->change = change;
            a->column = k;
        }
        if (k == last || k + 1 == MAX_LEVELS) {
            drape_arena_release(s->arena, before.x);
            break;
        }
        drape_status status = lab_trace_create(s->arena, next.size, next.frames, &next);
        if (status)
            return status;
        next.frames = next.room;
        const double divisor = pow(2, order + k * a->family->stride) - 1;
        for (size_t i = 0; i < size; i++)
            next.x[i] = a->columns[k].x[i] + (a->columns[k].x[i] - before.x[i]) / divisor;
        drape_arena_release(s->arena, before.x);
    }
    a->best = a->columns[a->column];
    return DRAPE_OK;
}

/* The distance to the nearest result of a family of another name. */
static double disagreement(const lab_ivp *s, const attempt *attempts, int count, const attempt *best)
{
    double least = INFINITY;
    for (int i = 0; best && i < count; i++)
        if (attempts[i].count > 1 && strcmp(attempts[i].family->name, best->family->name) != 0)
            least = fmin(least, distance_of(s, &attempts[i].best, &best->best));
    return least;
}

static double goal_of(const lab_ivp *s)
{
    return s->contact ? CONTACT_GOAL : SMOOTH_GOAL;
}

/* Refines the last of the attempts until it changes no more, agrees with an earlier one of another family, or
 * its next level, which is expected to take GROWTH times the last one, would exceed its time. */
static drape_status refine(const lab_ivp *s, double seconds, const attempt *attempts, attempt *a)
{
    const int before = (int)(a - attempts);
    double took = 0;
    const family *f = a->family;
    drape_status status = DRAPE_OK;
    const double start = drape_clock_thread_seconds();
    double knob = f->rtol;
    if (!(knob > 0))
        status = find_dt(s, lab_find_integrator(f->method), COARSEST, &knob);
    a->change = INFINITY;
    for (; !status && !*a->ended_by && a->count < MAX_LEVELS; knob *= f->ratio) {
        json_t *result = NULL;
        lab_trace trace = {0};
        if (a->change < ENOUGH * goal_of(s) ||
            (a->count > 1 && disagreement(s, attempts, before, a) < ENOUGH * goal_of(s)))
            break;
        if (f->rtol > 0 && knob < 0.99e-12)
            break; /* the least that parameters allow */
        if (GROWTH * took > seconds - a->spent) {
            snprintf(a->ended_by, sizeof a->ended_by, "the next level would take too long");
            break;
        }
        const drape_entry *entry = &lab_find_integrator(f->method)->entry;
        char pointer[64];
        json_t *settings = json_pack("{s:s, s:f}", "/integrator/method", f->method,
                                     f->rtol > 0 ? "/integrator/rtol" : "/integrator/dt", knob);
        snprintf(pointer, sizeof pointer, "/integrator/%s", f->also ? f->also : "");
        if (f->also && lab_has_param(entry, f->also))
            json_object_set_new(settings, pointer, json_integer(f->also_value));
        if (lab_has_param(entry, "tolerance"))
            json_object_set_new(settings, "/integrator/tolerance", json_real(least_tolerance(s)));
        const lab_request request = {.def = &s->def,
                                     .settings = settings,
                                     .times = s->times,
                                     .time_count = s->time_count,
                                     .record = &trace,
                                     .arena = s->arena,
                                     .seconds = seconds - a->spent,
                                     .repeats = 1};
        status = settings ? lab_run(s->arena->ctx, &request, &result)
                          : drape_fail(s->arena->ctx, DRAPE_E_MEMORY, "no memory for settings");
        json_decref(settings);
        took = drape_clock_thread_seconds() - start - a->spent;
        a->spent += took;
        if (!status && trace.frames) {
            status = extrapolate(s, a, trace);
            a->knob = knob;
            a->count++;
        } else if (!status)
            snprintf(a->ended_by, sizeof a->ended_by, "%s", lab_text(result, "message"));
        json_decref(result);
    }
    return status;
}

static drape_status store(const lab_ivp *s, const attempt *attempts, int count, const attempt *best,
                          double error)
{
    char header[DRAPE_NPY_HEADER], digits[17];
    const size_t size = best->best.size * (size_t)best->best.frames * sizeof(double);
    const char *data = file_of(s, "references", "npy"), *path = file_of(s, "references", "json");
    if (!data || !path)
        return DRAPE_E_MEMORY;
    drape_npy_put_header(best->best.frames, drape_model_node_count(s->model), header);
    const uint64_t hash = drape_hash_bytes(DRAPE_HASH_START, header, sizeof header);
    lab_digits(drape_hash_bytes(hash, best->best.x, size), digits);
    json_t *about = provenance_of(s);
    about = drape_json_with(about, "times_s", drape_json_numbers(s->times, s->time_count));
    about = drape_json_with(about, "error", json_real(error));
    about = drape_json_with(about, "method", json_string(best->family->method));
    about = drape_json_with(about, "data_hash", json_string(digits));
    json_t *methods = json_array();
    for (int i = 0; i < count; i++) {
        const attempt *a = &attempts[i];
        methods = drape_json_append(
            methods,
            json_pack("{s:s, s:s, s:s, s:f, s:i, s:i, s:o, s:o}", "family", a->family->name, "method",
                      a->family->method, "knob", a->family->rtol > 0 ? "rtol" : "dt_s", "value", a->knob,
                      "levels", a->count, "extrapolated", a->column, "change", drape_json_number(a->change),
                      "distance", drape_json_number(a->count ? distance_of(s, &a->best, &best->best) : NAN)));
    }
    about = drape_json_with(about, "methods", methods);
    drape_status status = write_file(s, data, header, sizeof header, best->best.x, size);
    if (!status)
        status = write_json(s, path, about);
    json_decref(about);
    return status;
}

drape_status lab_ivp_reference(lab_ivp *s, double seconds, bool check, FILE *out)
{
    attempt attempts[FAMILIES];
    int count = 0;
    bool agreed = false;
    drape_status status = DRAPE_OK;
    memset(attempts, 0, sizeof attempts);
    for (int i = 0; !status && i < FAMILIES && !agreed; i++) {
        const drape_integrator_ops *integrator = lab_find_integrator(families[i].method);
        attempt *a = &attempts[count];
        if (!integrator || !lab_ivp_admits(s, integrator))
            continue;
        a->family = &families[i];
        status = refine(s, seconds, attempts, a);
        agreed = !status && a->count > 1 && disagreement(s, attempts, count, a) < ENOUGH * goal_of(s);
        count++;
        if (!status)
            fprintf(out,
                    "%-9s %d levels to %s %.3g, extrapolated %d times: the last changed it by %.2g of the "
                    "size; %.3g s%s%s\n",
                    a->family->method, a->count, a->family->rtol > 0 ? "rtol" : "dt", a->knob, a->column,
                    a->change, a->spent, *a->ended_by ? "; ended by: " : "", a->ended_by);
    }
    if (status)
        return status;
    const attempt *best = NULL;
    for (int i = 0; i < count; i++)
        if (attempts[i].count > 1 && (!best || attempts[i].change < best->change))
            best = &attempts[i];
    const double error = disagreement(s, attempts, count, best), goal = goal_of(s);
    if (!isfinite(error))
        return drape_fail(s->arena->ctx, DRAPE_E_SOLVER,
                          "%.300s: no reference: no two families of methods completed two levels; more CPU "
                          "seconds help",
                          s->path);
    if (!(error <= goal))
        return drape_fail(
            s->arena->ctx, DRAPE_E_SOLVER,
            "%.300s: no reference: its families of methods agree to %.2g of the size; they must to %.0e",
            s->path, error, goal);
    fprintf(out, "reference %s, agrees with another family to %.2g of the size\n", best->family->method,
            error);
    if (!check)
        return store(s, attempts, count, best, error);
    status = lab_ivp_read_reference(s);
    if (status)
        return status;
    const double distance = distance_of(s, &s->reference, &best->best), allowed = s->error + error;
    fprintf(out, "stored    differs by %.2g of the size; its error is %.2g\n", distance, s->error);
    return distance <= allowed
               ? DRAPE_OK
               : drape_fail(s->arena->ctx, DRAPE_E_SOLVER,
                            "%.300s: the stored reference differs by %.2g of the size from the "
                            "one computed now; both errors together are %.2g",
                            s->path, distance, allowed);
}

/* ---- How fast a small perturbation of the start grows ----
 *
 * The method is explicit where it solves the equations of the scene at bearable cost, because its steps are a
 * smooth function of the state: there is no iteration whose remainder would be taken for growth. Else it is
 * trbdf2, solved to rounding. */

#define PERTURBATION 1e-10 /* of the size */
#define LIMIT        1e4   /* growth that ends the horizon */
#define DIRECTIONS   3     /* random perturbations, of which the one that grows most counts */
#define BEYOND       2     /* times the duration that is measured */
#define SAMPLES      60
#define STEPS        32    /* in an interval, of the implicit method */
#define MOST_STEPS   40000 /* of the explicit method */

/* x + an offset of the free nodes, whose root mean square is PERTURBATION. */
static void perturb(const lab_ivp *s, int direction, double *x)
{
    const uint8_t *pinned = drape_model_pinned(s->model);
    const int32_t count = drape_model_node_count(s->model);
    double squares = 0;
    int32_t nodes = 0;
    for (int pass = 0; pass < 2; pass++) {
        uint64_t seed = (uint64_t)direction << 32;
        const double scale = pass ? PERTURBATION * s->size / sqrt(squares / nodes) : 0;
        for (int32_t i = 0; i < count; i++) {
            nodes += !pass && !pinned[i];
            for (size_t k = 0; k < 3; k++) {
                /* SplitMix64 (Steele, Lea, Flood 2014), as a number in [-1, 1). */
                uint64_t z = seed += UINT64_C(0x9e3779b97f4a7c15);
                z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
                z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
                const double d = ldexp((double)((z ^ z >> 31) >> 11), -52) - 1;
                squares += pinned[i] || pass ? 0 : d * d;
                x[3 * (size_t)i + k] += pinned[i] ? 0 : scale * d;
            }
        }
    }
}

/* Growth at each sample, the largest of the directions. Returns how many samples all runs reached. */
static drape_status measure(const lab_ivp *s, const drape_model *model, const double *t, double *growth,
                            size_t *reached)
{
    const size_t size = 3 * (size_t)drape_model_node_count(model);
    double *x = drape_arena_take(s->arena, size, sizeof *x);
    drape_sim *sims[DIRECTIONS + 1] = {NULL};
    drape_status status = x ? DRAPE_OK : DRAPE_E_MEMORY;
    for (int d = 0; !status && d <= DIRECTIONS; d++) { /* the first one is not perturbed */
        status = drape_sim_create(s->arena->ctx, model, NULL, &sims[d]);
        if (status)
            break;
        memcpy(x, drape_sim_positions(sims[d]), size * sizeof *x);
        if (d)
            perturb(s, d, x);
        status = drape_sim_set_state(sims[d], 0, x, drape_sim_velocities(sims[d]));
    }
    bool running = !status;
    for (*reached = 0; running && *reached < SAMPLES; *reached += running) {
        for (int d = 0; running && d <= DIRECTIONS; d++) {
            if (s->def.cancel && s->def.cancel(NULL))
                status = drape_fail(s->arena->ctx, DRAPE_E_STOPPED, "interrupted");
            running = !status && !drape_sim_advance(sims[d], t[*reached]);
            if (running && d)
                growth[*reached] = fmax(growth[*reached], lab_distance(model, drape_sim_positions(sims[0]),
                                                                       drape_sim_positions(sims[d])) /
                                                              (PERTURBATION * s->size));
        }
    }
    for (int d = 0; d <= DIRECTIONS; d++)
        drape_sim_destroy(&sims[d]);
    return status;
}

drape_status lab_ivp_horizon(const lab_ivp *s, bool *within, FILE *out)
{
    double t[SAMPLES], growth[SAMPLES] = {0}, largest = 0, horizon = INFINITY;
    const double duration = drape_model_duration(s->model);
    size_t count = 0;
    drape_model *model = NULL;
    json_t *settings;
    /* The method that measures, with steps that are the same in all runs. */
    const drape_integrator_ops *verlet = lab_find_integrator("verlet");
    double dt = s->interval / STEPS;
    drape_status status = lab_ivp_admits(s, verlet) ? find_dt(s, verlet, STEPS, &dt) : DRAPE_OK;
    const bool is_explicit = lab_ivp_admits(s, verlet) && BEYOND * duration < MOST_STEPS * dt;
    settings = json_pack("{s:s, s:f}", "/integrator/method", is_explicit ? "verlet" : "trbdf2",
                         "/integrator/dt", is_explicit ? dt : s->interval / STEPS);
    if (is_explicit)
        json_object_set_new(settings, "/integrator/substeps", json_integer(1));
    else
        json_object_set_new(settings, "/integrator/tolerance", json_real(least_tolerance(s)));
    for (int i = 0; i < SAMPLES; i++)
        t[i] = BEYOND * duration * (i + 1) / SAMPLES;
    if (!status)
        status = lab_load(s->arena->ctx, &(lab_request){.def = &s->def, .settings = settings}, &model);
    if (!status)
        status = measure(s, model, t, growth, &count);
    for (size_t i = 0; i < count && t[i] <= duration * (1 + 1e-9); i++)
        largest = fmax(largest, growth[i]);
    for (size_t i = count; i-- > 0;)
        if (!(growth[i] < LIMIT)) /* the last time before the growth passes the limit */
            horizon = i ? t[i - 1] : 0;
    *within =
        !status && count > 0 && t[count - 1] >= duration * (1 - 1e-9) && horizon >= duration * (1 - 1e-9);
    if (!status) {
        const char *path = file_of(s, "horizons", "json");
        json_t *about = provenance_of(s);
        about = drape_json_with(about, "settings", json_deep_copy(settings));
        about = drape_json_with(about, "perturbation", json_real(PERTURBATION));
        about = drape_json_with(about, "limit", json_real(LIMIT));
        about = drape_json_with(about, "horizon_s", drape_json_number(horizon)); /* null: beyond t_s */
        about = drape_json_with(about, "t_s", drape_json_numbers(t, count));
        about = drape_json_with(about, "growth", drape_json_numbers(growth, count));
        status = path ? write_json(s, path, about) : DRAPE_E_MEMORY;
        json_decref(about);
    }
    if (!status && isfinite(horizon))
        fprintf(out, "horizon   %.4g s: a perturbation of %.0e of the size grows %.0e-fold\n", horizon,
                PERTURBATION, LIMIT);
    else if (!status)
        fprintf(out,
                "horizon   beyond %.4g s: a perturbation of %.0e of the size grows less than %.0e-fold\n",
                count ? t[count - 1] : 0, PERTURBATION, LIMIT);
    if (!status)
        fprintf(out, "duration  %.4g s: within it, the perturbation grows %.3g-fold\n", duration, largest);
    json_decref(settings);
    drape_model_destroy(&model);
    return status;
}

/* ---- Score ---- */

/* As JSON: {"scene", "scene_hash", "size_m", "times_s": [...], "error": [...], "error_largest": [...],
 * "error_end", "error_max", "mescd", "reference_error", "resolved"} */
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
        /* The error of the frame, relative to the size, and the largest of a node. */
        const double *a = x + s->reference.size * i, *b = s->reference.x + s->reference.size * i;
        far = 0;
        for (size_t k = 0; k < s->reference.size; k += 3)
            far = fmax(far, hypot(hypot(a[k] - b[k], a[k + 1] - b[k + 1]), a[k + 2] - b[k + 2]));
        far /= s->size;
        error = lab_distance(s->model, a, b) / s->size;
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
        copied = file_of(s, "references", which == ABOUT ? "json" : "npy");
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
