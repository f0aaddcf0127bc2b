/* ivp_score.c: scenes of the test set for other programs: what they need, and how far their motion is from
 * the reference; see ivp.h. */
#include "io/export.h"
#include "io/json.h"
#include "io/npy.h"
#include "lab/ivp.h"
#include "lab/lab.h"
#include "lab/text.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#define LARGEST 1e150 /* [m] a coordinate: squares of larger ones overflow */

/* ---- Score ---- */

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

/* Frames of another program; the start may come before them. */
drape_status lab_ivp_take_frames(const lab_ivp *s, const char *path, char *bytes, size_t size, double **x)
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
        status = lab_ivp_take_frames(s, path, bytes, size, &x);
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

/* Each writes the contents of a file; v: velocities at the start. */

static void put_start(const lab_ivp *s, const double *v, drape_file *file)
{
    (void)v;
    drape_obj_put_nodes(file, drape_model_rest_positions(s->model), drape_model_node_count(s->model));
    drape_obj_put_triangles(file, drape_model_triangles(s->model), drape_model_triangle_count(s->model));
}

static void put_nodes(const lab_ivp *s, const double *v, drape_file *file)
{
    const double *masses = drape_model_masses(s->model), *x = drape_model_rest_positions(s->model);
    drape_file_print(file, "node,mass_kg,pinned,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s\n");
    for (size_t i = 0; i < (size_t)drape_model_node_count(s->model); i++)
        drape_file_print(file, "%zu,%.17g,%d,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n", i, masses[i],
                         drape_model_pinned(s->model)[i], x[3 * i], x[3 * i + 1], x[3 * i + 2], v[3 * i],
                         v[3 * i + 1], v[3 * i + 2]);
}

/* Where pinned nodes are at the times: as the reference has them. */
static void put_pins(const lab_ivp *s, const double *v, drape_file *file)
{
    const double *x = drape_model_rest_positions(s->model);
    (void)v;
    drape_file_print(file, "time_s,node,x_m,y_m,z_m\n");
    for (size_t k = 0; k <= s->time_count; k++) {
        for (size_t i = 0; i < (size_t)drape_model_node_count(s->model); i++)
            if (drape_model_pinned(s->model)[i])
                drape_file_print(file, "%.17g,%zu,%.17g,%.17g,%.17g\n", k ? s->times[k - 1] : 0, i, x[3 * i],
                                 x[3 * i + 1], x[3 * i + 2]);
        x = s->reference.x + s->reference.size * (k < s->time_count ? k : 0);
    }
}

static void put_times(const lab_ivp *s, const double *v, drape_file *file)
{
    (void)v;
    drape_file_print(file, "time_s\n");
    for (size_t k = 0; k < s->time_count; k++)
        drape_file_print(file, "%.17g\n", s->times[k]);
}

static drape_status copy(const lab_ivp *s, const char *from, drape_file *file)
{
    char *bytes;
    size_t size;
    drape_status status = from ? lab_read_text(s->arena, NULL, from, &bytes, &size) : DRAPE_E_MEMORY;
    if (!status)
        drape_file_put(file, bytes, size);
    return status;
}

/* The files of the folder. */
static const struct {
    const char *name;
    void (*put)(const lab_ivp *s, const double *v, drape_file *file);
    const char *reference; /* without put: the copy of the reference with this ending; NULL: of the scene */
} exports[] = {{"start.obj", put_start, NULL},  {"nodes.csv", put_nodes, NULL},
               {"pins.csv", put_pins, NULL},    {"times.csv", put_times, NULL},
               {"scene.json", NULL, NULL},      {"reference.npy", NULL, "npy"},
               {"reference.json", NULL, "json"}};
#define EXPORTS (sizeof exports / sizeof *exports)

static bool writes(const void *user, const char *name)
{
    (void)user;
    for (size_t i = 0; i < EXPORTS; i++)
        if (strcmp(exports[i].name, name) == 0)
            return true;
    return false;
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
    for (size_t i = 0; !status && i < EXPORTS; i++) {
        const char *ending = exports[i].reference;
        drape_file file = {0};
        status = drape_export_begin(s->arena->ctx, folder, exports[i].name, &file);
        if (!status && exports[i].put)
            exports[i].put(s, drape_sim_velocities(sim), &file);
        else if (!status)
            status = copy(s, ending ? lab_ivp_file(s, "references", ending) : s->path, &file);
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
