/*
 * export_npy.c: folder/positions.npy: frames x nodes x 3, float64, C order, little endian, of the simulated
 * mesh; with a render mesh also folder/render_positions.npy: frames x vertices x 3 of what frames show.
 *
 * The header (npy.h) has the same length for any number of frames, and its count is raised after a frame's
 * data are written: at any moment the file contains what its header says.
 */

#include "io/export.h"
#include "io/npy.h"
#include "model/model.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define FILE_NAME   "positions.npy"
#define RENDER_NAME "render_positions.npy"

typedef struct npy_array {
    const char *name;
    int32_t count; /* points in a frame */
    drape_file file;
} npy_array;

typedef struct npy_state {
    npy_array array[2]; /* (arrays) of the nodes, of the vertices of the surface */
    int arrays;
    int64_t frames; /* complete frames in the files */
} npy_state;

static bool npy_names(const char *name)
{
    return strcmp(name, FILE_NAME) == 0 || strcmp(name, RENDER_NAME) == 0;
}

static void list_arrays(const drape_export_def *def, npy_state *npy)
{
    const drape_render_surface *surface = &def->model->surface;
    npy->arrays = surface->bound ? 2 : 1;
    npy->array[0] = (npy_array){.name = FILE_NAME, .count = drape_model_node_count(def->model)};
    npy->array[1] = (npy_array){.name = RENDER_NAME, .count = surface->node_count};
}

static drape_status npy_open(drape_context *ctx, const drape_export_def *def, void *state)
{
    npy_state *npy = state;
    drape_status status = DRAPE_OK;
    list_arrays(def, npy);
    for (int i = 0; i < npy->arrays && !status; i++) {
        npy_array *a = &npy->array[i];
        char header[DRAPE_NPY_HEADER];
        status = drape_export_begin(ctx, def->folder, a->name, &a->file);
        if (status)
            break;
        drape_npy_put_header(0, a->count, header);
        drape_file_put(&a->file, header, sizeof header);
        status = drape_file_publish(&a->file);
    }
    return status;
}

static drape_status write_count(npy_array *a, int64_t frames)
{
    char header[DRAPE_NPY_HEADER];
    drape_npy_put_header(frames, a->count, header);
    return drape_file_overwrite(&a->file, 0, header, sizeof header);
}

/* Ends a frame, whose points were put. */
static drape_status end_frame(npy_array *a, int64_t frames)
{
    const off_t before = a->file.kept;
    drape_status status = drape_file_keep(&a->file);
    if (status)
        return status;
    status = write_count(a, frames);
    if (status)
        drape_file_cut(&a->file, before);
    return status;
}

static drape_status write_array(npy_array *a, const double *x, int64_t frames)
{
    drape_file_put_doubles(&a->file, x, 3 * (size_t)a->count);
    return end_frame(a, frames);
}

/* The nodes come last, as their number of frames is what readers of the run go by: if they fail, the other
 * array has a frame more, which the next run or resume removes. */
static drape_status npy_write(drape_context *ctx, void *state, const drape_frame *frame)
{
    npy_state *npy = state;
    (void)ctx;
    drape_status status = DRAPE_OK;
    for (int i = npy->arrays - 1; i >= 0 && !status; i--)
        status = write_array(&npy->array[i], i ? frame->positions : frame->nodes, npy->frames + 1);
    if (!status)
        npy->frames++;
    return status;
}

static drape_file *npy_shared(void *state)
{
    return &((npy_state *)state)->array[0].file;
}

static drape_status npy_settle(void *state, int error, uint64_t sum)
{
    npy_state *npy = state;
    npy_array *a = &npy->array[0];
    drape_file_put_written(&a->file, 3 * sizeof(double) * (uint64_t)a->count, sum, error);
    drape_status status = end_frame(a, npy->frames + 1);
    if (!status)
        npy->frames++;
    return status;
}

static void npy_archive(void *state, drape_archive *a)
{
    npy_state *npy = state;
    drape_archive_int64(a, &npy->frames);
    for (int i = 0; i < npy->arrays; i++)
        drape_export_archive_file(a, &npy->array[i].file);
}

static drape_status npy_resume(drape_context *ctx, const drape_export_def *def, void *state, int64_t frames,
                               drape_archive *a)
{
    npy_state *npy = state;
    list_arrays(def, npy);
    npy_archive(npy, a);
    if (drape_archive_good(a) && npy->frames != frames)
        drape_archive_fail(a, DRAPE_E_PARSE,
                           "the checkpoint has %lld frames and another number in " FILE_NAME,
                           (long long)frames);
    drape_status status = a->status;
    for (int i = 0; i < npy->arrays && !status; i++)
        status = drape_export_reopen(ctx, def->folder, npy->array[i].name, &npy->array[i].file);
    return status;
}

/* First lowers the count: at any moment the file contains at least what its header says. */
static drape_status npy_cut(drape_context *ctx, void *state, int64_t frames)
{
    npy_state *npy = state;
    drape_status status = DRAPE_OK;
    (void)ctx;
    for (int i = 0; i < npy->arrays && !status; i++) {
        status = write_count(&npy->array[i], frames);
        if (!status)
            status = drape_file_trim(&npy->array[i].file);
    }
    return status;
}

static drape_status npy_sync(void *state)
{
    npy_state *npy = state;
    drape_status status = DRAPE_OK;
    for (int i = 0; i < npy->arrays && !status; i++)
        status = drape_file_sync(&npy->array[i].file);
    return status;
}

static drape_status npy_close(drape_context *ctx, void *state)
{
    npy_state *npy = state;
    drape_status status = DRAPE_OK;
    (void)ctx;
    for (int i = 0; i < npy->arrays; i++) {
        const drape_status closing = drape_file_close(&npy->array[i].file);
        drape_file_destroy(&npy->array[i].file);
        status = status ? status : closing;
    }
    return status;
}

const drape_exporter_ops drape_exporter_npy = {
    .entry = {.name = "npy",
              .summary =
                  "positions.npy: one array, frames x nodes x 3, float64; valid after every frame; with a "
                  "render mesh also render_positions.npy",
              .reference = "NPY format version 1.0, numpy.lib.format"},
    .state_size = sizeof(npy_state),
    .y_up = true,
    .open = npy_open,
    .names = npy_names,
    .write = npy_write,
    .shared = npy_shared,
    .settle = npy_settle,
    .archive = npy_archive,
    .resume = npy_resume,
    .cut = npy_cut,
    .sync = npy_sync,
    .close = npy_close,
};
