/* test_io.c: the files of the recorder and the summary are read back and compared to the last digit; no
 * failure leaves a file that cannot be read. Runs that are killed are tested by cli/signals. */
#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "../support/suite.h"
#include "drape/drape.h"
#include "io/csv.h"
#include "io/export.h"
#include "io/recorder.h"
#include "io/summary.h"
#include "support/comma.h"
#include "support/folder.h"

/* Two cloths; frames of 1/40 s fall on and between the steps of 1/100 s. */
#define COLUMNS     8
#define ROWS        6
#define NODES       (2 * COLUMNS * ROWS)
#define TRIANGLES   (2 * 2 * (COLUMNS - 1) * (ROWS - 1))
#define FRAME_SIZE  (NODES * 3 * sizeof(double))
#define DT          0.01
#define RATE        40.0
#define HEADER_SIZE 128
#define MAX_SEEN    64

static const char *const cloth_names[2] = {"left", "right, \"large\""};

/* What an observer of the test has received, to compare the files with. */
typedef struct seen {
    int frames, attempts;
    double time[MAX_SEEN], x[MAX_SEEN][NODES * 3];
    drape_attempt attempt[MAX_SEEN];
    drape_energy energy[MAX_SEEN];
} seen;

typedef struct world {
    drape_context *ctx;
    drape_model *model;
    drape_sim *sim;
    char folder[256], out[300];
    seen seen;
} world;

static drape_status watch(void *user, const drape_event *event)
{
    seen *s = user;
    if (event->kind == DRAPE_EVENT_FRAME && s->frames < MAX_SEEN) {
        s->time[s->frames] = event->time;
        memcpy(s->x[s->frames++], event->positions, FRAME_SIZE);
    }
    if (event->kind == DRAPE_EVENT_ATTEMPT && s->attempts < MAX_SEEN) {
        s->energy[s->attempts] = drape_sim_energy(event->sim);
        s->attempt[s->attempts++] = *event->attempt;
    }
    return DRAPE_OK;
}

static void make_model(world *w)
{
    const drape_setting grid[] = {
        {"columns", COLUMNS, NULL}, {"rows", ROWS, NULL}, {"width", 0.3, NULL}, {"height", 0.2, NULL}};
    const drape_setting material[] = {
        {"young_modulus", 1e5, NULL}, {"thickness", 1e-3, NULL}, {"density", 200, NULL}};
    const drape_setting be[] = {{"dt", DT, NULL}};
    const drape_entry_def term = {"stretch.edge", NULL, 0};
    drape_pin_def pin = pin_def();
    pin.corner = "top-left";
    drape_cloth_def cloth[2];
    for (int i = 0; i < 2; i++) {
        drape_cloth_def_init(&cloth[i], sizeof cloth[i]);
        cloth[i].name = cloth_names[i];
        cloth[i].mesh.grid = (drape_entry_def){"square", grid, 4};
        cloth[i].mesh.translate[0] = i / 3.0;
        cloth[i].material = material;
        cloth[i].material_count = 3;
        cloth[i].terms = &term;
        cloth[i].term_count = 1;
        cloth[i].pins = &pin;
        cloth[i].pin_count = 1;
    }
    drape_scene_def scene = scene_def();
    scene.cloths = cloth;
    scene.cloth_count = 2;
    scene.integrator = (drape_entry_def){"be", be, 1};
    scene.frame_rate = RATE;
    assert_ok(w->ctx, drape_model_create(w->ctx, &scene, &w->model));
}

static void set_up(world *w)
{
    const char *tmp = getenv("TMPDIR");
    memset(w, 0, sizeof *w);
    snprintf(w->folder, sizeof w->folder, "%.200s/drape_io_XXXXXX", tmp ? tmp : "/tmp");
    ck_assert_ptr_nonnull(mkdtemp(w->folder));
    snprintf(w->out, sizeof w->out, "%s/a/out", w->folder);
    ck_assert_int_eq(drape_context_create(NULL, &w->ctx), DRAPE_OK);
    make_model(w);
    ck_assert_int_eq(drape_sim_create(w->ctx, w->model, NULL, &w->sim), DRAPE_OK);
    ck_assert_int_eq(drape_sim_observe(w->sim, watch, &w->seen), DRAPE_OK);
}

static void remove_all(const char *path)
{
    struct stat info;
    if (lstat(path, &info))
        return;
    if (S_ISDIR(info.st_mode)) {
        DIR *dir = opendir(path);
        struct dirent *entry;
        while ((entry = readdir(dir))) {
            char name[700];
            snprintf(name, sizeof name, "%.400s/%.255s", path, entry->d_name);
            if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0)
                remove_all(name);
        }
        closedir(dir);
    }
    remove(path);
}

static void tear_down(world *w)
{
    drape_sim_destroy(&w->sim);
    drape_model_destroy(&w->model);
    drape_context_destroy(&w->ctx);
    remove_all(w->folder);
}

#define scoped_world SCOPED(tear_down) world

static drape_status record(world *w, drape_context *ctx, const char *format, drape_recorder **out)
{
    const char *const formats[] = {format};
    const drape_recorder_def def = {.folder = w->out, .formats = formats, .format_count = format ? 1 : 0};
    return drape_recorder_create(ctx, w->sim, &def, out);
}

static drape_folder *open_folder(world *w, const char *path)
{
    drape_folder *folder = NULL;
    ck_assert_int_eq(drape_folder_open(w->ctx, path, false, &folder), DRAPE_OK);
    ck_assert_int_eq(drape_folder_begin(folder, NULL, NULL), DRAPE_OK);
    return folder;
}

/* Runs to t_end with one format; everything must succeed. */
static void run(world *w, const char *format, double t_end)
{
    drape_recorder *recorder;
    drape_status status = record(w, w->ctx, format, &recorder);
    assert_ok(w->ctx, status);
    status = drape_sim_advance(w->sim, t_end);
    assert_ok(w->ctx, status);
    ck_assert_int_eq(drape_recorder_finish(recorder), DRAPE_OK);
    ck_assert(drape_recorder_done(recorder).seconds > 0);
    drape_recorder_destroy(&recorder);
    ck_assert_ptr_null(recorder);
}

static const char *in_folder(const char *folder, const char *name)
{
    static char path[600];
    snprintf(path, sizeof path, "%.300s/%.200s", folder, name);
    return path;
}

static bool exists(const char *folder, const char *name)
{
    struct stat info;
    return lstat(in_folder(folder, name), &info) == 0;
}

static void write_text(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    ck_assert_ptr_nonnull(file);
    fputs(text, file);
    fclose(file);
}

static int count_files(const char *folder, const char *ending)
{
    int count = 0;
    DIR *dir = opendir(folder);
    ck_assert_ptr_nonnull(dir);
    struct dirent *entry;
    while ((entry = readdir(dir))) {
        size_t n = strlen(entry->d_name), m = strlen(ending);
        count += n >= m && strcmp(entry->d_name + n - m, ending) == 0;
    }
    closedir(dir);
    return count;
}

/* Checks the header to the byte. Returns the number of frames in it, whose data must be there. *data is to be
 * freed. */
static int64_t read_npy(const char *folder, char **data)
{
    size_t size;
    int64_t frames = -1;
    char expected[HEADER_SIZE + 1], dict[HEADER_SIZE];
    *data = file_read(in_folder(folder, "positions.npy"), &size);
    ck_assert_uint_ge(size, HEADER_SIZE);
    ck_assert_int_eq(memcmp(*data, "\x93NUMPY\x01\x00\x76\x00", 10), 0);
    ck_assert_int_eq(
        sscanf(*data + 10, "{'descr': '<f8', 'fortran_order': False, 'shape': (%" SCNd64 ",", &frames), 1);
    snprintf(dict, sizeof dict, "{'descr': '<f8', 'fortran_order': False, 'shape': (%" PRId64 ", %d, 3), }",
             frames, NODES);
    snprintf(expected, sizeof expected, "%-117s\n", dict);
    ck_assert_int_eq(memcmp(*data + 10, expected, HEADER_SIZE - 10), 0);
    ck_assert_uint_ge(size, HEADER_SIZE + (size_t)frames * FRAME_SIZE);
    return frames;
}

static size_t file_size(const char *folder, const char *name)
{
    struct stat info;
    ck_assert_int_eq(stat(in_folder(folder, name), &info), 0);
    return (size_t)info.st_size;
}

/* ---- Frames */

TEST(npy_is_exact)
{
    scoped_world w;
    char *data;
    set_up(&w);
    run(&w, "npy", 0.11);
    ck_assert_int_eq(w.seen.frames, 5); /* 0, 1/40 ... 4/40 */
    int64_t frames = read_npy(w.out, &data);
    ck_assert_int_eq(frames, 6); /* and 0.11 */
    ck_assert_uint_eq(file_size(w.out, "positions.npy"), HEADER_SIZE + 6 * FRAME_SIZE);
    for (int k = 0; k < 5; k++) {
        ck_assert_double_eq_tol(w.seen.time[k], k / RATE, 1e-15);
        ck_assert_int_eq(memcmp(data + HEADER_SIZE + k * FRAME_SIZE, w.seen.x[k], FRAME_SIZE), 0);
    }
    ck_assert_int_eq(memcmp(data + HEADER_SIZE + 5 * FRAME_SIZE, drape_sim_positions(w.sim), FRAME_SIZE), 0);
    ck_assert_int_eq(memcmp(data + HEADER_SIZE, drape_model_rest_positions(w.model), FRAME_SIZE), 0);
    ck_assert_int_ne(memcmp(w.seen.x[0], w.seen.x[1], FRAME_SIZE), 0);
    ck_assert_int_eq(count_files(w.out, ".part"), 0);
    free(data);
}

TEST(the_last_frame_comes_once)
{
    scoped_world w;
    char *data;
    drape_recorder *recorder;
    set_up(&w);
    run(&w, "npy", 0.1); /* ends on a frame */
    ck_assert_int_eq(read_npy(w.out, &data), 5);
    free(data);
    tear_down(&w);

    set_up(&w); /* never advanced: the start is the end */
    run(&w, "npy", 0);
    ck_assert_int_eq(read_npy(w.out, &data), 1);
    free(data);
    tear_down(&w);

    set_up(&w); /* several advances; what comes after finish is not recorded */
    ck_assert_int_eq(record(&w, w.ctx, "npy", &recorder), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(w.sim, 0.03), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(w.sim, 0.06), DRAPE_OK);
    ck_assert_int_eq(drape_recorder_finish(recorder), DRAPE_OK);
    ck_assert_int_eq(drape_recorder_finish(recorder), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(w.sim, 0.09), DRAPE_OK);
    ck_assert_int_eq(read_npy(w.out, &data), 4);
    free(data);
    drape_recorder_destroy(&recorder);
    drape_recorder_destroy(&recorder);
    drape_recorder_destroy(NULL);
}

/* Compares the names, positions and triangles of an OBJ file, the positions with x. */
static void check_obj(const world *w, const char *name, const double *x)
{
    char line[256];
    int cloths = 0, nodes = 0, triangles = 0;
    const int32_t *expected = drape_model_triangles(w->model);
    FILE *file = fopen(in_folder(w->out, name), "r");
    ck_assert_ptr_nonnull(file);
    while (fgets(line, sizeof line, file)) {
        double v[3];
        int f[3];
        if (strncmp(line, "o ", 2) == 0) {
            line[strcspn(line, "\n")] = 0;
            ck_assert_str_eq(line + 2, cloth_names[cloths++]);
            ck_assert_int_eq(nodes, drape_model_cloth(w->model, cloths - 1).first_node);
        } else if (sscanf(line, "v %lf %lf %lf", &v[0], &v[1], &v[2]) == 3)
            ck_assert_int_eq(memcmp(v, x + 3 * (size_t)nodes++, sizeof v), 0);
        else if (sscanf(line, "f %d %d %d", &f[0], &f[1], &f[2]) == 3) {
            for (int i = 0; i < 3; i++)
                ck_assert_int_eq(f[i], expected[3 * triangles + i] + 1);
            triangles++;
        } else
            ck_assert_int_eq(line[0], '#');
    }
    fclose(file);
    ck_assert_int_eq(cloths, 2);
    ck_assert_int_eq(nodes, NODES);
    ck_assert_int_eq(triangles, TRIANGLES);
}

TEST(obj_parses_back)
{
    scoped_world w;
    set_up(&w);
    run(&w, "obj", 0.06);
    ck_assert_int_eq(count_files(w.out, ".obj"), 4);
    check_obj(&w, "frame_000000.obj", w.seen.x[0]);
    check_obj(&w, "frame_000001.obj", w.seen.x[1]);
    check_obj(&w, "frame_000002.obj", w.seen.x[2]);
    check_obj(&w, "frame_000003.obj", drape_sim_positions(w.sim));
    ck_assert_int_eq(count_files(w.out, ".part"), 0);
}

static void check_ply(const world *w, const char *name, const double *x)
{
    size_t size;
    const int32_t *expected = drape_model_triangles(w->model);
    char *data = file_read(in_folder(w->out, name), &size), header[256];
    snprintf(header, sizeof header,
             "element vertex %d\nproperty double x\nproperty double y\nproperty double z\n"
             "element face %d\nproperty list uchar int vertex_indices\nend_header\n",
             NODES, TRIANGLES);
    ck_assert_int_eq(strncmp(data, "ply\nformat binary_little_endian 1.0\ncomment ", 44), 0);
    const char *body = strstr(data, header);
    ck_assert_ptr_nonnull(body);
    body += strlen(header);
    ck_assert_uint_eq(size, (size_t)(body - data) + FRAME_SIZE + TRIANGLES * 13);
    ck_assert_int_eq(memcmp(body, x, FRAME_SIZE), 0); /* tests run on little endian machines */
    body += FRAME_SIZE;
    for (int i = 0; i < TRIANGLES; i++, body += 13) {
        ck_assert_int_eq(body[0], 3);
        ck_assert_int_eq(memcmp(body + 1, expected + 3 * (size_t)i, 12), 0);
    }
    free(data);
}

TEST(ply_parses_back)
{
    scoped_world w;
    set_up(&w);
    ck_assert_int_eq(drape_model_node_count(w.model), NODES);
    ck_assert_int_eq(drape_model_triangle_count(w.model), TRIANGLES);
    run(&w, "ply", 0.03);
    ck_assert_int_eq(count_files(w.out, ".ply"), 3);
    check_ply(&w, "frame_000000.ply", w.seen.x[0]);
    check_ply(&w, "frame_000001.ply", w.seen.x[1]);
    check_ply(&w, "frame_000002.ply", drape_sim_positions(w.sim));
}

TEST(every_format_writes_the_same_frames)
{
    scoped_world w;
    const char *formats[32];
    size_t count = 0;
    char *data;
    drape_recorder *recorder;
    set_up(&w);
    for (; drape_exporters[count]; count++) {
        ck_assert(*drape_exporters[count]->entry.summary && *drape_exporters[count]->entry.reference);
        formats[count] = drape_exporters[count]->entry.name;
    }
    formats[count] = formats[0]; /* a format that is named twice counts once */
    const drape_recorder_def def = {.folder = w.out, .formats = formats, .format_count = count + 1};
    ck_assert_int_eq(drape_recorder_create(w.ctx, w.sim, &def, &recorder), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(w.sim, 0.03), DRAPE_OK);
    ck_assert_int_eq(drape_recorder_finish(recorder), DRAPE_OK);
    ck_assert_int_eq(drape_recorder_done(recorder).frames, 3);
    ck_assert_int_eq(read_npy(w.out, &data), 3);
    free(data);
    ck_assert_int_eq(count_files(w.out, ".obj"), 3 + 1); /* one is the mesh of the point cache */
    ck_assert_int_eq(count_files(w.out, ".ply"), 3);
    ck_assert_int_eq(count_files(w.out, ".vtp"), 3);
    ck_assert_int_eq(count_files(w.out, ".npy"), 1);
    ck_assert_int_eq(count_files(w.out, ".part"), 0);
    drape_recorder_destroy(&recorder);
}

/* Everything that an earlier run wrote goes; what is named alike is somebody else's. */
TEST(old_frames_are_removed_and_nothing_else)
{
    static const char *const old[] = {"frame_000001.obj", "frame_000001.ply", "frame_000001.vtp",
                                      "frames.pvd",       "positions.pc2",    "positions.obj",
                                      "positions.glb",    "positions.npy"};
    static const char *const other[] = {"frame_12345.obj",     "frame_000123.obj", "my_frame_000123.obj",
                                        "frame_000123.stl",    "frame_00012x.obj", "frame_000123.obj.bak",
                                        "frame_000123.OBJ.png"};
    scoped_world w;
    drape_recorder *recorder;
    const char *formats[16];
    size_t count = 0;
    set_up(&w);
    for (; drape_exporters[count]; count++)
        formats[count] = drape_exporters[count]->entry.name;
    const drape_recorder_def def = {.folder = w.out, .formats = formats, .format_count = count};
    ck_assert_int_eq(drape_recorder_create(w.ctx, w.sim, &def, &recorder), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(w.sim, 0.1), DRAPE_OK);
    ck_assert_int_eq(drape_recorder_finish(recorder), DRAPE_OK);
    drape_recorder_destroy(&recorder);
    for (size_t i = 0; i < sizeof old / sizeof *old; i++)
        ck_assert_msg(exists(w.out, old[i]), "%s", old[i]);
    for (size_t i = 0; i < sizeof other / sizeof *other; i++)
        write_text(in_folder(w.out, other[i]), "other");
    drape_sim_destroy(&w.sim);
    ck_assert_int_eq(drape_sim_create(w.ctx, w.model, NULL, &w.sim), DRAPE_OK);
    run(&w, "ply", 0);
    ck_assert_uint_gt(file_size(w.out, "frame_000000.ply"), 100);
    for (size_t i = 0; i < sizeof old / sizeof *old; i++)
        ck_assert_msg(!exists(w.out, old[i]), "%s", old[i]);
    for (size_t i = 0; i < sizeof other / sizeof *other; i++)
        ck_assert_msg(exists(w.out, other[i]), "%s", other[i]);
}

/* ---- Step log */

/* Splits a row of CSV as RFC 4180 says, in place; returns the number of fields. *next becomes the following
 * row. */
static int split(char *row, char **field, int room, char **next)
{
    int count = 0;
    char *in = row;
    for (bool more = true; more && count < room; in++) {
        char *out = in;
        field[count++] = out;
        bool quoted = *in == '"';
        in += quoted;
        while (*in && (quoted || (*in != ',' && *in != '\n'))) {
            if (*in == '"' && quoted && *++in != '"') {
                quoted = false;
                continue;
            }
            *out++ = *in++;
        }
        more = *in == ',';
        *out = 0;
    }
    *next = in;
    return count;
}

#define FIELDS 24
static const char columns[] =
    "attempt,t,h,accepted,status,reason,iterations,residual,tolerance,kinetic,elastic,gravity,contact,"
    "dissipated,numerical,worst_what,worst_term,worst_element,worst_nodes,worst_value,worst_limit,error,"
    "left,events\n";

static void check_number(const char *text, double expected)
{
    char *end;
    double value = strtod(text, &end);
    ck_assert_msg(*text && *end == 0, "\"%s\" is not a number", text);
    ck_assert(value == expected || (isnan(value) && isnan(expected)));
}

static void check_worst(char *const *field, const drape_diagnostic *diagnostic)
{
    if (!diagnostic->what || !*diagnostic->what) {
        for (int i = 0; i < 6; i++)
            ck_assert_str_eq(field[i], "");
        return;
    }
    ck_assert_str_eq(field[0], diagnostic->what);
    ck_assert_str_eq(field[1], diagnostic->term ? diagnostic->term : "");
    if (diagnostic->element < 0)
        ck_assert_str_eq(field[2], "");
    else
        check_number(field[2], diagnostic->element);
    char *at = field[3];
    for (int i = 0; i < 4 && diagnostic->node[i] >= 0; i++)
        ck_assert_int_eq(strtol(at, &at, 10), diagnostic->node[i]);
    ck_assert_int_eq(*at, 0);
    check_number(field[4], diagnostic->value);
    check_number(field[5], diagnostic->limit);
}

static void check_row(char *const *field, const drape_attempt *a, const drape_energy *e)
{
    const double energies[] = {e->kinetic, e->elastic, e->gravity, e->contact, e->dissipated, e->numerical};
    check_number(field[0], (double)a->index);
    check_number(field[1], a->t);
    check_number(field[2], a->h);
    check_number(field[3], a->accepted);
    ck_assert_str_eq(field[4], drape_status_name(a->status));
    ck_assert_str_eq(field[5], a->reason);
    check_number(field[6], a->iterations);
    check_number(field[7], a->residual);
    check_number(field[8], a->tolerance);
    for (int i = 0; i < 6; i++)
        check_number(field[9 + i], energies[i]);
    check_worst(field + 15, &a->diagnostic);
    check_number(field[21], a->error);
    check_number(field[22], a->left);
    ck_assert_str_eq(field[23], ""); /* this scene has none; cli/cli runs one that has */
}

TEST(steps_has_a_row_for_each_attempt)
{
    scoped_world w;
    size_t size;
    set_up(&w);
    run(&w, NULL, 0.11);
    ck_assert_int_ge(w.seen.attempts, 11);
    char *data = file_read(in_folder(w.out, "steps.csv"), &size), *row = data + strlen(columns);
    ck_assert_int_eq(strncmp(data, columns, strlen(columns)), 0);
    for (int i = 0; i < w.seen.attempts; i++) {
        char *field[FIELDS + 1];
        ck_assert_int_eq(split(row, field, FIELDS + 1, &row), FIELDS);
        check_row(field, &w.seen.attempt[i], &w.seen.energy[i]);
    }
    ck_assert_ptr_eq(row, data + size);
    free(data);
}

TEST(steps_quotes_and_keeps_digits)
{
    const drape_attempt attempt = {
        .index = INT64_C(9007199254740991),
        .t = 2.385 / 7,
        .h = 1e-7 / 3,
        .status = DRAPE_RETRY_DEGENERATE,
        .reason = "edge_collapse",
        .iterations = 50,
        .residual = -NAN,
        .tolerance = INFINITY,
        .error = 1.0 / 7,
        .left = 1e-7 / 7,
        .diagnostic = {"ratio, \"worst\"", "host\nterm", 7, {1, 23, 456, -1}, 0, 5e-324, -1 / 3.0}};
    drape_attempt calm = attempt;
    calm.diagnostic = (drape_diagnostic){"", "", -1, {-1, -1, -1, -1}, -1, 0, 0};
    drape_attempt node = attempt;
    node.diagnostic = (drape_diagnostic){"residual", "", -1, {381, -1, -1, -1}, 0, 1, 2};
    const drape_attempt *const attempts[] = {&attempt, &calm, &node};
    const drape_energy energy = {1 / 3.0, 1e300, -1e-300, 0, 2.5, -0.1};
    scoped_world w;
    size_t size;
    drape_file file;
    set_up(&w);
    drape_folder *folder = open_folder(&w, w.folder);
    ck_assert_int_eq(drape_csv_open(w.ctx, folder, DRAPE_STEPS_NAME, drape_steps_columns, &file), DRAPE_OK);
    for (int i = 0; i < 3; i++)
        ck_assert_int_eq(drape_steps_write(&file, attempts[i], &energy, NULL), DRAPE_OK);
    ck_assert_int_eq(drape_file_close(&file), DRAPE_OK);
    drape_file_destroy(&file);
    drape_folder_close(&folder);
    char *data = file_read(in_folder(w.folder, "steps.csv"), &size), *row = data + strlen(columns);
    ck_assert_ptr_nonnull(strstr(data, ",nan,inf,"));
    ck_assert_ptr_nonnull(strstr(data, ",\"ratio, \"\"worst\"\"\",\"host\nterm\",7,1 23 456,"));
    for (int i = 0; i < 3; i++) {
        char *field[FIELDS + 1];
        ck_assert_int_eq(split(row, field, FIELDS + 1, &row), FIELDS);
        check_row(field, attempts[i], &energy);
    }
    free(data);
}

/* ---- Energies */

#define ENERGY_FIELDS 14
static const char energy_columns[] =
    "frame,t,t_state,kinetic,elastic,gravity,contact,dissipated,numerical,total,work,pins,colliders,host\n";

/* The energies of frame k are those of the first state at or after it, as the attempts reported them.
 * Frames of 1/40 s lie on and between steps of 1/100 s; the first one is before all steps. */
TEST(energies_are_of_the_state_at_or_after_the_frame)
{
    scoped_world w;
    size_t size;
    set_up(&w);
    const drape_energy start = drape_sim_energy(w.sim);
    run(&w, NULL, 0.11);
    char *data = file_read(in_folder(w.out, "energy.csv"), &size), *row = data + strlen(energy_columns);
    ck_assert_int_eq(strncmp(data, energy_columns, strlen(energy_columns)), 0);
    for (int k = 0; k < 6; k++) { /* and 0.11, where the run ends */
        char *field[ENERGY_FIELDS + 1];
        const double t = k < 5 ? k / RATE : 0.11;
        const int step = (int)ceil(t / DT - 1e-9); /* the state after so many steps */
        const drape_energy e = step > 0 ? w.seen.energy[step - 1] : start;
        const double expected[] = {e.kinetic,
                                   e.elastic,
                                   e.gravity,
                                   e.contact,
                                   e.dissipated,
                                   e.numerical,
                                   e.kinetic + e.elastic + e.gravity + e.contact};
        ck_assert_int_eq(split(row, field, ENERGY_FIELDS + 1, &row), ENERGY_FIELDS);
        check_number(field[0], k);
        ck_assert_double_eq_tol(strtod(field[1], NULL), t, 1e-15);
        ck_assert_double_eq_tol(strtod(field[2], NULL), step * DT, 1e-15);
        for (int i = 0; i < 7; i++)
            check_number(field[3 + i], expected[i]);
    }
    ck_assert_ptr_eq(row, data + size);
    free(data);
}

/* ---- Failures */

/* From here on no file may grow beyond size, as on a full disk. Nothing is asserted until free_disk(). */
static void fill_disk(size_t size, struct rlimit *old)
{
    signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, old);
    setrlimit(RLIMIT_FSIZE, &(struct rlimit){(rlim_t)size, old->rlim_max});
}

static void free_disk(const struct rlimit *old)
{
    setrlimit(RLIMIT_FSIZE, old);
}

/* Advances on a disk that takes files of `size` bytes: the sim stops there with a message that names the
 * file, and finish reports it again. */
static void run_on_small_disk(world *w, const char *format, size_t size, const char *name)
{
    char message[2][1024];
    struct rlimit old;
    drape_recorder *recorder;
    ck_assert_int_eq(record(w, w->ctx, format, &recorder), DRAPE_OK);
    fill_disk(size, &old);
    drape_status advance = drape_sim_advance(w->sim, 0.3);
    snprintf(message[0], sizeof message[0], "%s", drape_context_message(w->ctx));
    drape_context_set_message(w->ctx, "something else");
    drape_status finish = drape_recorder_finish(recorder);
    snprintf(message[1], sizeof message[1], "%s", drape_context_message(w->ctx));
    free_disk(&old);
    ck_assert_int_eq(advance, DRAPE_E_FILE);
    ck_assert_int_eq(finish, DRAPE_E_FILE);
    ck_assert(drape_sim_time(w->sim) < 0.3);
    for (int i = 0; i < 2; i++) {
        ck_assert_msg(strstr(message[i], in_folder(w->out, name)) != NULL, "%s", message[i]);
        ck_assert_msg(strstr(message[i], strerror(EFBIG)) != NULL, "%s", message[i]);
        ck_assert_ptr_null(strchr(message[i], '\n'));
    }
    drape_recorder_destroy(&recorder);
    ck_assert_int_eq(count_files(w->out, ".part"), 0);
}

TEST(full_disk_leaves_a_valid_npy)
{
    scoped_world w;
    char *data;
    set_up(&w);
    run_on_small_disk(&w, "npy", HEADER_SIZE + 5 * FRAME_SIZE / 2, "positions.npy");
    ck_assert_int_eq(read_npy(w.out, &data), 2);
    ck_assert_uint_eq(file_size(w.out, "positions.npy"), HEADER_SIZE + 2 * FRAME_SIZE);
    for (int k = 0; k < 2; k++)
        ck_assert_int_eq(memcmp(data + HEADER_SIZE + k * FRAME_SIZE, w.seen.x[k], FRAME_SIZE), 0);
    free(data);
}

TEST(full_disk_leaves_whole_rows)
{
    scoped_world w;
    size_t size;
    set_up(&w);
    run_on_small_disk(&w, NULL, 1000, "steps.csv");
    scoped_memory char *data = file_read(in_folder(w.out, "steps.csv"), &size);
    ck_assert_uint_gt(size, strlen(columns));
    ck_assert_uint_le(size, 1000);
    ck_assert_int_eq(data[size - 1], '\n');
}

TEST(full_disk_leaves_no_half_frame)
{
    static const struct {
        const char *format, *file;
    } cases[] = {{"obj", "frame_000000.obj"},
                 {"ply", "frame_000000.ply"},
                 {"vtp", "frame_000000.vtp"},
                 {"glb", "positions.glb"},
                 {"pc2", "positions.obj"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scoped_world w;
        set_up(&w);
        run_on_small_disk(&w, cases[i].format, 500, cases[i].file);
        ck_assert_int_eq(count_files(w.out, cases[i].file), 0);
    }
}

static uint32_t word_at(const char *data, size_t at)
{
    const unsigned char *b = (const unsigned char *)data + at;
    return b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
}

/* The samples of the point cache, all of which must be complete. */
static uint32_t check_pc2(const world *w)
{
    size_t size;
    scoped_memory char *data = file_read(in_folder(w->out, "positions.pc2"), &size);
    ck_assert_uint_ge(size, 32);
    ck_assert_int_eq(memcmp(data, "POINTCACHE2\0\1\0\0", 16), 0);
    uint32_t points = word_at(data, 16), samples = word_at(data, 28);
    ck_assert_uint_eq(points, NODES);
    ck_assert_uint_eq(size, 32 + (size_t)samples * NODES * 12);
    for (uint32_t i = 0; i < samples * NODES * 3; i++) {
        float value;
        memcpy(&value, data + 32 + 4 * (size_t)i, 4);
        ck_assert(value == (float)w->seen.x[i / (NODES * 3)][i % (NODES * 3)]);
    }
    return samples;
}

TEST(full_disk_leaves_a_valid_point_cache)
{
    scoped_world w;
    set_up(&w);
    run_on_small_disk(&w, "pc2", 32 + 9 * NODES * 12 / 2 + 3000, "positions.pc2");
    ck_assert_uint_ge(check_pc2(&w), 4);
}

/* The JSON of a binary glTF, whose lengths must fit the file; to be freed by json_decref. */
static json_t *load_glb(const world *w)
{
    size_t size;
    json_error_t error;
    scoped_memory char *data = file_read(in_folder(w->out, "positions.glb"), &size);
    ck_assert_uint_ge(size, 28);
    ck_assert_int_eq(memcmp(data, "glTF\2\0\0", 8), 0);
    ck_assert_uint_eq(word_at(data, 8), size);
    uint32_t text = word_at(data, 12), binary = word_at(data, 20 + text);
    ck_assert_uint_eq(28 + (size_t)text + binary, size);
    json_t *json = json_loadb(data + 20, text, JSON_REJECT_DUPLICATES, &error);
    ck_assert_msg(json != NULL, "%s", error.text);
    json_t *buffer = json_array_get(json_object_get(json, "buffers"), 0);
    ck_assert_int_eq(json_integer_value(json_object_get(buffer, "byteLength")), binary);
    return json;
}

static size_t count_targets(const json_t *json)
{
    json_t *mesh = json_array_get(json_object_get(json, "meshes"), 0);
    json_t *primitive = json_array_get(json_object_get(mesh, "primitives"), 0);
    size_t count = json_array_size(json_object_get(primitive, "targets"));
    ck_assert_uint_eq(json_array_size(json_object_get(mesh, "weights")), count);
    ck_assert_uint_eq(json_array_size(json_object_get(json, "accessors")),
                      3 + 2 * count + 2 * json_array_size(json_object_get(json, "animations")));
    return count;
}

/* 13 frames take 13 x 2 304 bytes; there is room for all but the last ones. */
TEST(full_disk_leaves_a_valid_glb)
{
    scoped_world w;
    set_up(&w);
    run_on_small_disk(&w, "glb", 38000, "positions.glb");
    json_t *json = load_glb(&w);
    size_t targets = count_targets(json);
    ck_assert(targets > 2 && targets < 12);
    json_decref(json);
}

/* Writes frames of the model at rest, on a disk that takes files of `size` bytes, until one fails; returns
 * the number of those that succeeded. */
static int write_frames(world *w, const drape_exporter_ops *ops, size_t size)
{
    static double field[NODES * 3];
    static double strain[TRIANGLES * 2];
    drape_folder *folder = open_folder(w, w->out);
    drape_arena arena = drape_arena_of(w->ctx);
    drape_file whole, *growing = NULL;
    const drape_export_def def = {.ctx = w->ctx,
                                  .arena = &arena,
                                  .model = w->model,
                                  .folder = folder,
                                  .frame_rate = RATE,
                                  .most_frames = 1000,
                                  .whole = &whole,
                                  .growing = &growing};
    struct rlimit old;
    drape_status status = DRAPE_OK;
    int frames = 0;
    char message[1024];
    scoped_memory void *state = calloc(1, ops->state_size);
    ck_assert_int_eq(drape_file_create_in(w->ctx, folder, &whole), DRAPE_OK);
    ck_assert_int_eq(ops->open(&def, state), DRAPE_OK);
    fill_disk(size, &old);
    for (; !status && frames < 1000; frames++) {
        const drape_frame frame = {
            .index = frames,
            .time = frames +
                    1 / 3.0, /* with 17 digits: a line in the collection is longer than one in the manifest */
            .positions = drape_model_rest_positions(w->model),
            .velocities = field,
            .strain = strain,
            .energy_density = field,
            .pinned = drape_model_pinned(w->model)};
        status = ops->write(&def, state, &frame);
    }
    snprintf(message, sizeof message, "%s", drape_context_message(w->ctx));
    drape_file_close(growing);
    drape_file_destroy(growing);
    drape_file_destroy(&whole);
    drape_folder_close(&folder);
    drape_arena_free(&arena);
    free_disk(&old);
    drape_context_set_message(w->ctx, "%s", message);
    ck_assert_int_eq(status, DRAPE_E_FILE);
    return frames - 1;
}

/* Wherever the disk is full, the collection names only whole frames: its list outgrows the limit, which the
 * frames themselves, of about 9 kB, do not. */
TEST(full_disk_leaves_a_valid_collection)
{
    for (size_t room = 12000; room < 12090; room += 5) {
        scoped_world w;
        size_t size;
        const drape_exporter_ops *vtp =
            drape_exporters[drape_registry_find(&drape_exporter_registry, NULL, "vtp")];
        set_up(&w);
        ck_assert_int_eq(mkdir(in_folder(w.folder, "a"), 0777), 0);
        ck_assert_int_eq(mkdir(w.out, 0777), 0);
        int frames = write_frames(&w, vtp, room), named = 0;
        ck_assert_msg(strstr(drape_context_message(w.ctx), "frames.pvd") != NULL, "%s",
                      drape_context_message(w.ctx));
        scoped_memory char *data = file_read(in_folder(w.out, "frames.pvd"), &size);
        ck_assert_uint_le(size, room);
        ck_assert_str_eq(data + size - strlen("</Collection></VTKFile>\n"), "</Collection></VTKFile>\n");
        ck_assert_ptr_eq(strstr(data, "</Collection>"), data + size - strlen("</Collection></VTKFile>\n"));
        for (const char *at = data; (at = strstr(at, "<DataSet ")); at++)
            named++;
        ck_assert_int_eq(named, frames);
        ck_assert_int_gt(frames, 100);
    }
}

static void refuse(world *w, const char *format, drape_status expected, const char *part)
{
    drape_recorder *recorder = (drape_recorder *)w; /* not NULL, so that it shows whether it becomes NULL */
    ck_assert_int_eq(record(w, w->ctx, format, &recorder), expected);
    ck_assert_ptr_null(recorder);
    ck_assert_msg(strstr(drape_context_message(w->ctx), part) != NULL, "\"%s\" does not say \"%s\"",
                  drape_context_message(w->ctx), part);
}

/* Files of so few bytes that the manifest, a table or the frames cannot begin. */
TEST(a_disk_full_from_the_start_is_reported_at_once)
{
    const struct {
        size_t room;
        const char *format, *name;
    } cases[] = {{0, NULL, "/manifest.jsonl"}, {160, NULL, "/steps.csv"}, {100, "npy", "/positions.npy"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scoped_world w;
        struct rlimit old;
        char part[100];
        set_up(&w);
        snprintf(part, sizeof part, "%s\": File too large", cases[i].name);
        fill_disk(cases[i].room, &old);
        refuse(&w, cases[i].format, DRAPE_E_FILE, part);
        free_disk(&old);
        ck_assert(!exists(w.out, cases[i].name + 1));
    }
}

TEST(bad_folders_are_refused)
{
    scoped_world w;
    set_up(&w);
    write_text(in_folder(w.folder, "file"), "");
    snprintf(w.out, sizeof w.out, "%s/file", w.folder);
    refuse(&w, "npy", DRAPE_E_FILE, "/file\": Not a directory");
    snprintf(w.out, sizeof w.out, "%s/file/below", w.folder);
    refuse(&w, "npy", DRAPE_E_FILE, "Not a directory");
    snprintf(w.out, sizeof w.out, "%s", "");
    refuse(&w, "npy", DRAPE_E_ARGUMENT, "folder");
    memset(w.out, 'x', sizeof w.out - 1);
    w.out[sizeof w.out - 1] = 0;
    refuse(&w, "npy", DRAPE_E_FILE, "File name too long");
    snprintf(w.out, sizeof w.out, "%s/closed", w.folder);
    ck_assert_int_eq(mkdir(w.out, 0555), 0);
    if (geteuid() != 0) /* root may write anywhere */
        refuse(&w, "npy", DRAPE_E_FILE, "Permission denied");
    snprintf(w.out, sizeof w.out, "%s", "/proc/drape/out"); /* no folder can be made there */
    refuse(&w, "npy", DRAPE_E_FILE, "cannot make the folder \"/proc/drape");
    snprintf(w.out, sizeof w.out, "%s/", w.folder); /* a slash at the end is allowed */
    run(&w, "npy", 0);
    ck_assert(exists(w.folder, "positions.npy"));
}

TEST(unknown_formats_are_refused_before_anything_is_made)
{
    scoped_world w;
    set_up(&w);
    refuse(&w, "npz", DRAPE_E_ARGUMENT, "did you mean \"npy\"?");
    refuse(&w, "holography", DRAPE_E_ARGUMENT, "there are npy, obj, ply");
    ck_assert(!exists(w.folder, "a"));
}

/* ---- Memory */

/* Counts the blocks in use; fails once `left` calls have succeeded. */
typedef struct meter {
    int left, taken, held;
} meter;

static void *meter_allocate(void *user, size_t size)
{
    meter *m = user;
    if (m->left-- <= 0)
        return NULL;
    m->taken++;
    m->held++;
    return malloc(size);
}

static void meter_release(void *user, void *memory)
{
    ((meter *)user)->held--;
    free(memory);
}

static drape_context *metered_context(meter *m)
{
    drape_context *ctx;
    drape_context_def def = context_def();
    def.allocate = meter_allocate;
    def.release = meter_release;
    def.allocator_user = m;
    m->left = 1;
    ck_assert_int_eq(drape_context_create(&def, &ctx), DRAPE_OK);
    return ctx;
}

TEST(each_allocation_may_fail)
{
    scoped_world w;
    meter m = {0};
    set_up(&w);
    scoped_context *ctx = metered_context(&m);
    drape_recorder *recorder = NULL;
    const char *formats[32];
    size_t count = 0;
    for (; drape_exporters[count]; count++)
        formats[count] = drape_exporters[count]->entry.name;
    const drape_recorder_def def = {.folder = w.out, .formats = formats, .format_count = count};
    drape_status status = DRAPE_E_MEMORY;
    for (int n = 0; status; n++) {
        ck_assert_int_lt(n, 100);
        m.left = n;
        status = drape_recorder_create(ctx, w.sim, &def, &recorder);
        if (status) {
            ck_assert_int_eq(status, DRAPE_E_MEMORY);
            ck_assert_ptr_nonnull(strstr(drape_context_message(ctx), "memory"));
            ck_assert_int_eq(m.held, 1); /* the context */
        }
    }
    /* From here on there is no memory at all; the rest must need none. */
    m.left = 0;
    ck_assert_int_eq(drape_sim_advance(w.sim, 0.11), DRAPE_OK);
    ck_assert_int_eq(drape_recorder_finish(recorder), DRAPE_OK);
    ck_assert_int_eq(drape_recorder_done(recorder).frames, 6);
    const drape_summary_def summary = {.status = DRAPE_OK};
    ck_assert_int_eq(drape_summary_write(ctx, w.sim, &summary, NULL, in_folder(w.out, "summary.json")),
                     DRAPE_E_MEMORY);
    ck_assert(!exists(w.out, "summary.json"));
    drape_recorder_destroy(&recorder);
    ck_assert_int_eq(m.held, 1);
}

/* ---- Summary */

static json_t *load_summary(const char *path)
{
    json_error_t error;
    json_t *json = json_load_file(path, JSON_REJECT_DUPLICATES, &error);
    ck_assert_msg(json != NULL, "%s: %s", path, error.text);
    return json;
}

/* The keys of an object in their order, with a blank after each. */
static void check_keys(const json_t *object, const char *expected)
{
    char keys[512] = "";
    const char *key;
    json_t *value;
    ck_assert(json_is_object(object));
    json_object_foreach((json_t *)object, key, value)
    {
        strcat(strcat(keys, key), " ");
    }
    ck_assert_str_eq(keys, expected);
}

static double real(const json_t *json, const char *group, const char *key)
{
    const json_t *value = json_object_get(group ? json_object_get(json, group) : json, key);
    ck_assert_msg(json_is_number(value), "%s/%s is not a number", group ? group : "", key);
    return json_number_value(value);
}

static void check_values(const json_t *json, world *w)
{
    char hash[17];
    drape_energy energy = drape_sim_energy(w->sim);
    drape_statistics s = drape_sim_statistics(w->sim);
    snprintf(hash, sizeof hash, "%016" PRIx64, drape_sim_hash(w->sim));
    ck_assert_str_eq(json_string_value(json_object_get(json, "hash")), hash);
    ck_assert_str_eq(json_string_value(json_object_get(json, "version")), drape_version());
    ck_assert_double_eq(real(json, NULL, "nodes"), NODES);
    ck_assert_double_eq(real(json, NULL, "dofs"), (double)drape_model_dof_count(w->model));
    ck_assert_double_eq(real(json, NULL, "nnz"), (double)drape_model_nonzero_count(w->model));
    ck_assert_double_eq(real(json, NULL, "time"), drape_sim_time(w->sim));
    ck_assert_double_eq(real(json, "steps", "accepted"), (double)s.steps_accepted);
    ck_assert_double_eq(real(json, "steps", "rejected"), (double)s.steps_rejected);
    ck_assert_double_eq(real(json, "steps", "h_min"), s.h_min);
    ck_assert_double_eq(real(json, "steps", "h_max"), s.h_max);
    ck_assert_double_eq(real(json, "newton", "iterations"), (double)s.newton_iterations);
    ck_assert_double_eq(real(json, "newton", "residuals"), (double)s.residuals);
    ck_assert_double_eq(real(json, "wall_s", "setup"), s.wall_setup);
    ck_assert_double_eq(real(json, "wall_s", "steps"), s.wall_steps);
    ck_assert_double_eq(real(json, "energy", "kinetic"), energy.kinetic);
    ck_assert_double_eq(real(json, "energy", "elastic"), energy.elastic);
    ck_assert_double_eq(real(json, "energy", "gravity"), energy.gravity);
    ck_assert_double_eq(real(json, "energy", "numerical"), energy.numerical);
    ck_assert_double_eq(real(json, "strain", "min"), s.strain_min);
    ck_assert_double_eq(real(json, "strain", "max"), s.strain_max);
}

static void check_reasons(const json_t *reasons, const world *w)
{
    int64_t count;
    size_t i = 0;
    const char *reason;
    for (; (reason = drape_sim_reason(w->sim, (int)i, &count)); i++)
        ck_assert_int_eq(json_integer_value(json_object_get(reasons, reason)), count);
    ck_assert_uint_eq(json_object_size(reasons), i);
}

TEST(summary_is_complete)
{
    scoped_world w;
    set_up(&w);
    run(&w, NULL, 0.11);
    const drape_summary_def def = {DRAPE_E_STEP_TOO_SMALL, "t = 0.1: worst edge \"7\"", 6, 1.25, 0.1};
    const char *path = in_folder(w.out, "summary.json");
    ck_assert_int_eq(drape_summary_write(w.ctx, w.sim, &def, NULL, path), DRAPE_OK);
    json_t *json = load_summary(path);
    check_keys(json,
               "status message version nodes dofs nnz frames time steps newton tolerance error wall_s energy "
               "work strain intersections warnings hash ");
    check_keys(json_object_get(json, "steps"), "accepted rejected unconverged held h_min h_max reasons ");
    check_keys(json_object_get(json, "newton"),
               "iterations jacobians factorizations linear_iterations residuals ");
    check_keys(json_object_get(json, "wall_s"),
               "total setup steps residual jacobian factor solve contact output ");
    check_keys(json_object_get(json, "energy"), "kinetic elastic gravity contact dissipated numerical ");
    check_keys(json_object_get(json, "strain"), "min max ");
    check_keys(json_object_get(json, "error"),
               "bound largest last largest_left last_left steps_above steps_by_local_error "
               "steps_above_local_error ");
    ck_assert_str_eq(json_string_value(json_object_get(json, "status")), "e_step_too_small");
    ck_assert_str_eq(json_string_value(json_object_get(json, "message")), def.message);
    ck_assert_double_eq(real(json, NULL, "frames"), 6);
    ck_assert_double_eq(real(json, "wall_s", "total"), 1.25);
    ck_assert_double_eq(real(json, "wall_s", "output"), 0.1);
    check_values(json, &w);
    check_reasons(json_object_get(json_object_get(json, "steps"), "reasons"), &w);
    ck_assert_int_eq(count_files(w.out, ".part"), 0);
    json_decref(json);
}

TEST(summary_is_always_json)
{
    scoped_world w;
    set_up(&w);
    const drape_summary_def def = {DRAPE_OK, "n\xc3\xa4he \xff.json", 0, NAN, INFINITY};
    const drape_summary_def plain = {DRAPE_OK, NULL, 0, 0, 0};
    const char *path = in_folder(w.folder, "s.json");
    ck_assert_int_eq(drape_summary_write(w.ctx, w.sim, &def, NULL, path), DRAPE_OK);
    json_t *json = load_summary(path);
    ck_assert(json_is_null(json_object_get(json_object_get(json, "wall_s"), "total")));
    ck_assert(json_is_null(json_object_get(json_object_get(json, "wall_s"), "output")));
    ck_assert_str_eq(json_string_value(json_object_get(json, "message")), "n??he ?.json");
    json_decref(json);
    ck_assert_int_eq(drape_summary_write(w.ctx, w.sim, &plain, NULL, path), DRAPE_OK);
    json = load_summary(path);
    ck_assert_str_eq(json_string_value(json_object_get(json, "message")), "");
    ck_assert_str_eq(json_string_value(json_object_get(json, "status")), "ok");
    json_decref(json);
}

TEST(summary_fails_whole)
{
    scoped_world w;
    struct rlimit old;
    size_t size;
    const drape_summary_def def = {DRAPE_OK, NULL, 0, 0, 0};
    set_up(&w);
    const char *path = in_folder(w.folder, "s.json");
    write_text(path, "before");
    fill_disk(100, &old);
    drape_status status = drape_summary_write(w.ctx, w.sim, &def, NULL, path);
    free_disk(&old);
    ck_assert_int_eq(status, DRAPE_E_FILE);
    ck_assert_ptr_nonnull(strstr(drape_context_message(w.ctx), "s.json\": File too large"));
    char *data = file_read(path, &size);
    ck_assert_str_eq(data, "before");
    free(data);
    ck_assert_int_eq(count_files(w.folder, ".part"), 0);
    ck_assert_int_eq(drape_summary_write(w.ctx, w.sim, &def, NULL, in_folder(w.folder, "no/s.json")),
                     DRAPE_E_FILE);
    ck_assert_int_eq(drape_summary_write(w.ctx, w.sim, &def, NULL, w.folder), DRAPE_E_FILE);
    ck_assert_ptr_nonnull(strstr(drape_context_message(w.ctx), "Is a directory"));
    ck_assert_int_eq(symlink("/dev/full", in_folder(w.folder, "full")), 0);
    ck_assert_int_eq(drape_summary_write(w.ctx, w.sim, &def, NULL, in_folder(w.folder, "full")),
                     DRAPE_E_FILE);
    ck_assert_ptr_nonnull(strstr(drape_context_message(w.ctx), "No space left on device"));
    ck_assert(exists(w.folder, "full"));
    ck_assert_int_eq(drape_summary_write(w.ctx, w.sim, &def, NULL, "/dev/null"), DRAPE_OK);
}

/* In a host with a German locale printf writes 0,5: the files must not. */
TEST(numbers_do_not_follow_the_locale)
{
    scoped_world w;
    size_t size;
    const drape_summary_def def = {DRAPE_OK, NULL, 0, 0.5, 0};
    bool comma = comma_begin();
    set_up(&w);
    run(&w, "obj", 0.03);
    ck_assert_int_eq(drape_summary_write(w.ctx, w.sim, &def, NULL, in_folder(w.out, "s.json")), DRAPE_OK);
    ck_assert(comma_is_set() == comma);
    comma_end();
    check_obj(&w, "frame_000001.obj", w.seen.x[1]);
    json_t *json = load_summary(in_folder(w.out, "s.json"));
    ck_assert_double_eq(real(json, "wall_s", "total"), 0.5);
    json_decref(json);
    char *data = file_read(in_folder(w.out, "steps.csv"), &size), *row = data + strlen(columns),
         *field[FIELDS + 1];
    ck_assert_int_eq(split(row, field, FIELDS + 1, &row), FIELDS);
    check_number(field[2], w.seen.attempt[0].h);
    free(data);
}

/* Whether Drape wrote the file of a name: to be refused, or replaced. */
static bool takes(const void *name, const char *file)
{
    return strcmp(name, file) == 0;
}

/* The manifest of a folder is JSON whatever the names in it are: the next process knows them again, and
 * writes them anew. */
TEST(any_name_is_found_again)
{
    char longest[256];
    scoped_world w;
    set_up(&w);
    memset(longest, '\1', 255);
    longest[255] = 0;
    const char *const names[] = {"a.\"b",     "back\\slash",          "line\nend",
                                 "\x1b[0m\t", "\xc3\xa4\xe2\x82\xac", longest};
    enum { NAMES = sizeof names / sizeof *names };
    for (int turn = 0; turn < 3; turn++) {
        drape_folder *folder = NULL;
        ck_assert_int_eq(drape_folder_open(w.ctx, w.out, false, &folder), DRAPE_OK);
        for (int i = 0; i < NAMES && turn > 0; i++)
            ck_assert_msg(drape_folder_check(folder, takes, NULL, names[i]) == DRAPE_OK, "%d: %s", i,
                          drape_context_message(w.ctx));
        ck_assert_int_eq(drape_folder_verify(folder, takes, "none"), DRAPE_OK);
        ck_assert_int_eq(drape_folder_begin(folder, takes, "none"), DRAPE_OK);
        for (int i = 0; i < NAMES && turn == 0; i++) {
            drape_file file;
            ck_assert_int_eq(drape_file_create_in(w.ctx, folder, &file), DRAPE_OK);
            drape_file_name(&file, "%s", names[i]);
            ck_assert_int_eq(drape_file_begin(&file), DRAPE_OK);
            drape_file_put_text(&file, "text");
            ck_assert_int_eq(i % 2 ? drape_file_finish(&file) : drape_file_publish(&file), DRAPE_OK);
            drape_file_destroy(&file); /* one that was published is left growing, as by a kill */
        }
        drape_folder_close(&folder);
    }
}

TEST(names_match_patterns)
{
    static const struct {
        const char *pattern, *name;
        int64_t number; /* -1: the name is not of the pattern */
    } cases[] = {{"frame_######.obj", "frame_000012.obj", 12},
                 {"frame_######.obj", "frame_1234567.obj", 1234567},
                 {"frame_######.obj", "frame_00012.obj", -1},
                 {"frame_######.obj", "frame_000012.obj.bak", -1},
                 {"frame_######.obj", "my_frame_000012.obj", -1},
                 {"frame_######.obj", "frame_", -1},
                 {"collider_#_######.vtp", "collider_3_000004.vtp", 4},
                 {"collider_#.vtp", "collider_3_000004.vtp", -1},
                 {"scene.json", "scene.json", 0},
                 {"scene.json", "scene.jso", -1},
                 {"scene_mesh_*", "scene_mesh_", 0},
                 {"scene_mesh_*", "scene_mesh", -1}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        int64_t number = 0;
        const bool found = drape_folder_matches(cases[i].pattern, cases[i].name, &number);
        ck_assert_msg(found == (cases[i].number >= 0), "%s: %s", cases[i].pattern, cases[i].name);
        ck_assert(!found || number == cases[i].number);
    }
}
