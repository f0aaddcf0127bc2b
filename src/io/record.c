/* record.c: see record.h. */
#include "io/record.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/finite.h"
#include "base/json_read.h"
#include "io/csv.h"
#include "io/npy.h"
#include "io/scene_copy.h"
#include "io/summary.h"

#define SUMMARY_LIMIT (64 << 20) /* [bytes] of a summary */

drape_status drape_record_scene(drape_context *ctx, const char *folder, char **path)
{
    *path = drape_disk_path(ctx, folder, DRAPE_SCENE_COPY);
    if (!*path)
        return DRAPE_E_MEMORY;
    struct stat info;
    if (access(*path, R_OK) == 0 && stat(*path, &info) == 0 && S_ISREG(info.st_mode))
        return DRAPE_OK;
    drape_free(ctx, *path);
    *path = NULL;
    return drape_fail(
        ctx, DRAPE_E_FILE,
        "\"%.500s\" is not the folder of a run: it has no " DRAPE_SCENE_COPY " that can be read", folder);
}

drape_status drape_record_json(const drape_record *run, const char *name, json_t **out)
{
    drape_context *ctx = run->ctx;
    char *path = drape_disk_path(ctx, run->folder, name), *text = NULL;
    size_t size = 0;
    json_error_t error = {0};
    *out = NULL;
    if (!path)
        return DRAPE_E_MEMORY;
    drape_status status = DRAPE_OK;
    const int fd = drape_file_open(ctx, path);
    if (fd >= 0)
        status = drape_file_take(ctx, fd, path, SUMMARY_LIMIT, &text, &size);
    else if (errno != ENOENT) /* a run that was killed has none */
        status = DRAPE_E_FILE;
    if (text)
        *out = drape_json_read(text, size, 0, &error);
    if (text && !*out && json_error_code(&error) == json_error_out_of_memory)
        status = drape_fail_memory(ctx, size);
    drape_free(ctx, text);
    drape_free(ctx, path);
    return status;
}

drape_status drape_record_protect(drape_context *ctx, const char *folder, const char *out)
{
    static const char *const inputs[] = {DRAPE_SCENE_COPY, "positions.npy", DRAPE_ENERGY_NAME,
                                         DRAPE_STEPS_NAME, DRAPE_SUMMARY_NAME};
    drape_status status = DRAPE_OK;
    for (size_t i = 0; i < sizeof inputs / sizeof *inputs && !status; i++) {
        char *path = drape_disk_path(ctx, folder, inputs[i]);
        status = path ? drape_file_check_named(ctx, out, path) : DRAPE_E_MEMORY;
        drape_free(ctx, path);
    }
    return status;
}

/* ---- Frames ---- */

/* An array of frames x nodes x 3, float64, as export_npy.c writes it. */
static drape_status open_positions(drape_record *run, const char *path)
{
    char header[DRAPE_NPY_HEADER];
    int32_t nodes = 0;
    size_t data = 0;
    struct stat info;
    const char *fault = NULL;
    run->positions = drape_file_open(run->ctx, path);
    if (run->positions < 0 && errno == ENOENT)
        drape_fail(run->ctx, DRAPE_E_FILE,
                   "cannot read \"%.500s\": there is no such file; a run writes it with the frame format npy",
                   path);
    if (run->positions < 0)
        return DRAPE_E_FILE;
    const ssize_t size = pread(run->positions, header, sizeof header, 0);
    if (size < 0 || !drape_npy_read_header(header, (size_t)size, &run->frames, &nodes, &data))
        fault = "it is not an array of float64, frames x nodes x 3, C order, as a run writes it";
    else if (nodes != run->nodes)
        return drape_fail(run->ctx, DRAPE_E_PARSE,
                          "\"%.500s\": it has %" PRId32 " nodes, the scene of the folder has %" PRId32, path,
                          nodes, run->nodes);
    run->data = (off_t)data;
    if (!fault && (fstat(run->positions, &info) || run->frames < 1 ||
                   (info.st_size - run->data) / (24 * (off_t)nodes) < run->frames))
        fault = "it has no frame, or less data than its header says";
    return fault ? drape_fail(run->ctx, DRAPE_E_PARSE, "\"%.500s\": %s", path, fault) : DRAPE_OK;
}

drape_status drape_record_read(const drape_record *run, int64_t frame, double *x)
{
    const size_t size = 24 * (size_t)run->nodes;
    const int error = drape_read_at(run->positions, x, size, run->data + (off_t)frame * (off_t)size);
    if (error)
        return drape_file_fail(run->ctx, "read frames of", run->folder, error);
    return drape_all_finite(x, size / 8)
               ? DRAPE_OK
               : drape_fail(run->ctx, DRAPE_E_PARSE,
                            "\"%.500s/positions.npy\": frame %" PRId64 " has a position that is not finite",
                            run->folder, frame);
}

/* ---- Tables ---- */

/* Splits a line of CSV (RFC 4180) in place. Returns the number of cells, at most `capacity`. */
static size_t split(char *line, char **cells, size_t capacity)
{
    size_t count = 0;
    char *in = line;
    while (count < capacity) {
        char *out = in;
        cells[count++] = out;
        if (*in == '"')
            for (in++; *in && (*in != '"' || *++in == '"'); in++)
                *out++ = *in;
        else
            while (*in && *in != ',')
                *out++ = *in++;
        bool more = *in == ',';
        in += more;
        *out = 0;
        if (!more)
            break;
    }
    return count;
}

#define MAX_CELLS 64 /* in one line */

/* Takes a line from *rest and removes its end; NULL at the end of the text, and for an incomplete line that a
 * killed run left. */
static char *next_line(char **rest)
{
    char *line = *rest, *end = strchr(line, '\n');
    if (!end)
        return NULL;
    *end = 0;
    *rest = end + 1;
    return line;
}

drape_status drape_record_rows(const drape_record *run, const char *name, const char *const *columns,
                               size_t count, drape_row_reader *reader, void *user, int64_t *rows)
{
    char *path = drape_disk_path(run->ctx, run->folder, name), *text;
    char *cells[MAX_CELLS], *wanted[DRAPE_MOST_COLUMNS], none[] = "";
    size_t size, place[DRAPE_MOST_COLUMNS]; /* of each requested column in a line */
    if (!path)
        return DRAPE_E_MEMORY;
    locale_t old = drape_locale_enter();
    drape_status status = drape_file_read(run->ctx, path, DRAPE_MAX_TABLE, &text, &size);
    char *rest = text, *line = status ? NULL : next_line(&rest);
    const size_t names = line ? split(line, cells, MAX_CELLS) : 0;
    for (size_t i = 0; i < count && !status; i++) {
        for (place[i] = 0; place[i] < names && strcmp(cells[place[i]], columns[i]) != 0; place[i]++)
            continue;
        if (place[i] == names)
            status = drape_fail(run->ctx, DRAPE_E_PARSE, "\"%.500s\": there is no column \"%s\"", path,
                                columns[i]);
    }
    for (*rows = 0; !status && (line = next_line(&rest));) {
        const size_t found = split(line, cells, MAX_CELLS);
        for (size_t i = 0; i < count; i++)
            wanted[i] = place[i] < found ? cells[place[i]] : none;
        reader(user, (*rows)++, wanted);
    }
    drape_locale_leave(old);
    drape_free(run->ctx, text);
    drape_free(run->ctx, path);
    return status;
}

static void take_time(void *user, int64_t row, char *const *cells)
{
    const drape_record *run = user;
    if (row < run->frames)
        run->times[row] = strtod(cells[0], NULL);
}

/* ---- Opening and closing ---- */

drape_status drape_record_open(drape_context *ctx, const char *folder, int32_t nodes, drape_record *run)
{
    static const char *const columns[] = {"t"};
    int64_t rows = 0;
    *run = (drape_record){.ctx = ctx, .positions = -1, .nodes = nodes};
    run->folder = drape_copy_text(ctx, folder);
    if (!run->folder)
        return DRAPE_E_MEMORY;
    for (size_t n = strlen(run->folder); n > 1 && run->folder[n - 1] == '/'; n--)
        run->folder[n - 1] = 0;
    char *path = drape_disk_path(ctx, run->folder, "positions.npy");
    drape_status status = path ? open_positions(run, path) : DRAPE_E_MEMORY;
    drape_free(ctx, path);
    if (status)
        return status;
    /* A killed run may have one frame more than rows, because frames are written first. */
    run->times = drape_alloc(ctx, (size_t)run->frames, sizeof *run->times);
    if (!run->times)
        return DRAPE_E_MEMORY;
    status = drape_record_rows(run, "energy.csv", columns, 1, take_time, run, &rows);
    if (!status && rows < 1)
        return drape_fail(ctx, DRAPE_E_PARSE, "\"%.500s\": energy.csv has no row: the run wrote no frame",
                          run->folder);
    run->frames = rows < run->frames ? rows : run->frames;
    for (int64_t i = 0; i < run->frames && !status; i++)
        if (!isfinite(run->times[i]))
            status = drape_fail(ctx, DRAPE_E_PARSE, "\"%.500s\": energy.csv has no time in row %" PRId64,
                                run->folder, i + 1);
    return status;
}

void drape_record_close(drape_record *run)
{
    if (!run->ctx)
        return;
    if (run->positions >= 0)
        close(run->positions);
    drape_free(run->ctx, run->times);
    drape_free(run->ctx, run->folder);
    *run = (drape_record){.positions = -1};
}
