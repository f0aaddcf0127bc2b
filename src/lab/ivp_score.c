/* ivp_score.c: scenes of the test set for other programs: what they need, and how far their motion is from
 * the reference; see ivp.h. */
#include "io/export.h"
#include "io/npy.h"
#include "lab/ivp.h"
#include "lab/lab.h"
#include "lab/text.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

/* ---- Score ---- */

/* Frames of another program; the start may come before them. */
static drape_status read_frames(const lab_ivp *s, const char *path, const double **x)
{
    char *bytes;
    size_t size, data = 0;
    int64_t frames = 0;
    int32_t nodes = 0;
    const int32_t count = drape_model_node_count(s->model);
    const int64_t times = (int64_t)s->time_count;
    drape_status status = lab_read_text(s->arena, NULL, path, &bytes, &size);
    if (status)
        return status;
    if (!drape_npy_read_header(bytes, size, &frames, &nodes, &data))
        return drape_fail(s->arena->ctx, DRAPE_E_PARSE,
                          "%.400s: not an array of float64, times x nodes x 3, C order (numpy.save)", path);
    if (nodes != count || (frames != times && frames != times + 1))
        return drape_fail(s->arena->ctx, DRAPE_E_PARSE,
                          "%.300s: its shape is (%" PRId64 ", %" PRId32 ", 3); it must be (%" PRId64
                          ", %" PRId32 ", 3), a frame every %.9g s, or one more with the start",
                          path, frames, nodes, times, count, s->interval);
    const size_t frame = 24 * (size_t)nodes;
    if (size != data + frame * (size_t)frames)
        return drape_fail(s->arena->ctx, DRAPE_E_PARSE, "%.400s: its data are not as long as its header says",
                          path);
    double *copy = drape_arena_take(s->arena, s->time_count, frame);
    if (!copy)
        return DRAPE_E_MEMORY;
    memcpy(copy, bytes + data + frame * (size_t)(frames - times), frame * s->time_count);
    drape_arena_release(s->arena, bytes);
    *x = copy;
    for (size_t i = 0; i < s->reference.size * s->time_count; i++)
        if (!isfinite(copy[i]))
            return drape_fail(s->arena->ctx, DRAPE_E_PARSE, "%.400s: a position is not a finite number",
                              path);
    return DRAPE_OK;
}

drape_status lab_ivp_score(const lab_ivp *s, const char *path, FILE *out)
{
    const double *x = NULL;
    double worst = 0, digits = INFINITY, error = 0;
    drape_status status = read_frames(s, path, &x);
    if (status)
        return status;
    fprintf(out, "time_s,error,error_largest\n");
    for (size_t i = 0; i < s->time_count; i++) {
        const double *a = x + s->reference.size * i, *b = s->reference.x + s->reference.size * i;
        double far = 0;
        error = lab_distance(s->model, a, b) / s->size;
        digits = lab_correct_digits(s->model, a, b);
        worst = fmax(worst, error);
        for (size_t k = 0; k < s->reference.size; k += 3)
            far = fmax(far, hypot(hypot(a[k] - b[k], a[k + 1] - b[k + 1]), a[k + 2] - b[k + 2]));
        fprintf(out, "%.9g,%.6g,%.6g\n", s->times[i], error, far / s->size);
    }
    fprintf(out, "error_end %.6g\nerror_max %.6g\nmescd %.4g\nreference_error %.2g\n", error, worst, digits,
            s->error);
    if (worst < s->error)
        fprintf(out, "The error cannot be distinguished from that of the reference.\n");
    return DRAPE_OK;
}

/* ---- Export ---- */

static bool writes(const void *user, const char *name)
{
    static const char *const names[] = {"start.obj",  "nodes.csv",     "pins.csv",      "times.csv",
                                        "scene.json", "reference.npy", "reference.json"};
    (void)user;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strcmp(names[i], name) == 0)
            return true;
    return false;
}

static drape_status put_start(const lab_ivp *s, drape_folder *folder, drape_file *file)
{
    drape_status status = drape_export_begin(s->arena->ctx, folder, "start.obj", file);
    if (status)
        return status;
    drape_obj_put_nodes(file, drape_model_rest_positions(s->model), drape_model_node_count(s->model));
    drape_obj_put_triangles(file, drape_model_triangles(s->model), drape_model_triangle_count(s->model));
    return drape_file_finish(file);
}

static drape_status put_nodes(const lab_ivp *s, const double *v, drape_folder *folder, drape_file *file)
{
    const double *masses = drape_model_masses(s->model), *x = drape_model_rest_positions(s->model);
    drape_status status = drape_export_begin(s->arena->ctx, folder, "nodes.csv", file);
    if (status)
        return status;
    drape_file_print(file, "node,mass_kg,pinned,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s\n");
    for (size_t i = 0; i < (size_t)drape_model_node_count(s->model); i++)
        drape_file_print(file, "%zu,%.17g,%d,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n", i, masses[i],
                         drape_model_pinned(s->model)[i], x[3 * i], x[3 * i + 1], x[3 * i + 2], v[3 * i],
                         v[3 * i + 1], v[3 * i + 2]);
    return drape_file_finish(file);
}

/* Where pinned nodes are at the times: as the reference has them. */
static drape_status put_pins(const lab_ivp *s, drape_folder *folder, drape_file *file)
{
    const double *x = drape_model_rest_positions(s->model);
    drape_status status = drape_export_begin(s->arena->ctx, folder, "pins.csv", file);
    if (status)
        return status;
    drape_file_print(file, "time_s,node,x_m,y_m,z_m\n");
    for (size_t k = 0; k <= s->time_count; k++) {
        for (size_t i = 0; i < (size_t)drape_model_node_count(s->model); i++)
            if (drape_model_pinned(s->model)[i])
                drape_file_print(file, "%.17g,%zu,%.17g,%.17g,%.17g\n", k ? s->times[k - 1] : 0, i, x[3 * i],
                                 x[3 * i + 1], x[3 * i + 2]);
        x = s->reference.x + s->reference.size * (k < s->time_count ? k : 0);
    }
    return drape_file_finish(file);
}

static drape_status put_times(const lab_ivp *s, drape_folder *folder, drape_file *file)
{
    drape_status status = drape_export_begin(s->arena->ctx, folder, "times.csv", file);
    if (status)
        return status;
    drape_file_print(file, "time_s\n");
    for (size_t k = 0; k < s->time_count; k++)
        drape_file_print(file, "%.17g\n", s->times[k]);
    return drape_file_finish(file);
}

static drape_status copy(const lab_ivp *s, const char *from, const char *name, drape_folder *folder,
                         drape_file *file)
{
    char *bytes;
    size_t size;
    drape_status status = from ? lab_read_text(s->arena, NULL, from, &bytes, &size) : DRAPE_E_MEMORY;
    if (!status)
        status = drape_export_begin(s->arena->ctx, folder, name, file);
    if (status)
        return status;
    drape_file_put(file, bytes, size);
    return drape_file_finish(file);
}

/* One file after the other; the first failure ends it. */
static drape_status put_all(const lab_ivp *s, const double *v, drape_folder *folder)
{
    drape_status status = DRAPE_OK;
    for (int i = 0; !status && i < 7; i++) {
        drape_file file = {0};
        status = i == 0   ? put_start(s, folder, &file)
                 : i == 1 ? put_nodes(s, v, folder, &file)
                 : i == 2 ? put_pins(s, folder, &file)
                 : i == 3 ? put_times(s, folder, &file)
                 : i == 4 ? copy(s, s->path, "scene.json", folder, &file)
                 : i == 5 ? copy(s, lab_ivp_file(s, "references", "npy"), "reference.npy", folder, &file)
                          : copy(s, lab_ivp_file(s, "references", "json"), "reference.json", folder, &file);
        drape_file_destroy(&file);
    }
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
    if (!status)
        status = put_all(s, drape_sim_velocities(sim), folder);
    if (!status)
        fprintf(out, "export    %s: start.obj, nodes.csv, pins.csv, times.csv, scene.json, reference.npy\n",
                path);
    drape_folder_close(&folder);
    drape_sim_destroy(&sim);
    return status;
}
