/*
 * export_npy.c: folder/positions.npy: frames x nodes x 3, float64, C order, little endian.
 *
 * The header (npy.h) has the same length for any number of frames, and its count is raised after a frame's
 * data are written: at any moment the file contains what its header says.
 */

#include "io/export.h"
#include "io/npy.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define FILE_NAME "positions.npy"

typedef struct npy_state {
    drape_file file;
    int32_t node_count;
    int64_t frames; /* complete frames in the file */
} npy_state;

static bool npy_names(const char *name)
{
    return strcmp(name, FILE_NAME) == 0;
}

static drape_status npy_open(drape_context *ctx, const drape_export_def *def, void *state)
{
    npy_state *npy = state;
    char header[DRAPE_NPY_HEADER];
    npy->node_count = drape_model_node_count(def->model);
    drape_status status = drape_export_begin(ctx, def->folder, FILE_NAME, &npy->file);
    if (status)
        return status;
    drape_npy_put_header(0, npy->node_count, header);
    drape_file_put(&npy->file, header, sizeof header);
    return drape_file_publish(&npy->file);
}

static drape_status write_count(npy_state *npy, int64_t frames)
{
    char header[DRAPE_NPY_HEADER];
    drape_npy_put_header(frames, npy->node_count, header);
    return drape_file_overwrite(&npy->file, 0, header, sizeof header);
}

static drape_status npy_write(drape_context *ctx, void *state, const drape_frame *frame)
{
    npy_state *npy = state;
    off_t before = npy->file.kept;
    (void)ctx;
    drape_file_put_doubles(&npy->file, frame->positions, 3 * (size_t)npy->node_count);
    drape_status status = drape_file_keep(&npy->file);
    if (status)
        return status;
    status = write_count(npy, npy->frames + 1);
    if (status)
        drape_file_cut(&npy->file, before);
    else
        npy->frames++;
    return status;
}

static void npy_archive(void *state, drape_archive *a)
{
    npy_state *npy = state;
    drape_archive_int64(a, &npy->frames);
    drape_export_archive_file(a, &npy->file);
}

static drape_status npy_resume(drape_context *ctx, const drape_export_def *def, void *state, int64_t frames,
                               drape_archive *a)
{
    npy_state *npy = state;
    npy->node_count = drape_model_node_count(def->model);
    npy_archive(npy, a);
    if (drape_archive_good(a) && npy->frames != frames)
        drape_archive_fail(a, DRAPE_E_PARSE,
                           "the checkpoint has %lld frames and another number in " FILE_NAME,
                           (long long)frames);
    return a->status ? a->status : drape_export_reopen(ctx, def->folder, FILE_NAME, &npy->file);
}

/* First lowers the count: at any moment the file contains at least what its header says. */
static drape_status npy_cut(drape_context *ctx, void *state, int64_t frames)
{
    npy_state *npy = state;
    (void)ctx;
    drape_status status = write_count(npy, frames);
    return status ? status : drape_file_trim(&npy->file);
}

static drape_status npy_sync(void *state)
{
    return drape_file_sync(&((npy_state *)state)->file);
}

static drape_status npy_close(drape_context *ctx, void *state)
{
    npy_state *npy = state;
    (void)ctx;
    drape_status status = drape_file_close(&npy->file);
    drape_file_destroy(&npy->file);
    return status;
}

const drape_exporter_ops drape_exporter_npy = {
    .entry = {.name = "npy",
              .summary = "positions.npy: one array, frames x nodes x 3, float64; valid after every frame",
              .reference = "NPY format version 1.0, numpy.lib.format"},
    .state_size = sizeof(npy_state),
    .y_up = true,
    .open = npy_open,
    .names = npy_names,
    .write = npy_write,
    .archive = npy_archive,
    .resume = npy_resume,
    .cut = npy_cut,
    .sync = npy_sync,
    .close = npy_close,
};
