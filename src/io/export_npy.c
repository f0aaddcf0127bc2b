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

#define FILE_NAME   "positions.npy"
#define RENDER_NAME "render_positions.npy"

typedef struct npy_array {
    const char *name;
    int32_t count; /* points in a frame */
    drape_file file;
} npy_array;

typedef struct npy_state {
    npy_array array[2]; /* (arrays) of the nodes, of the vertices of the surface */
    size_t arrays;
} npy_state;

static drape_status npy_open(const drape_export_def *def, void *state)
{
    npy_state *npy = state;
    const drape_render_surface *surface = &def->model->surface;
    drape_status status = DRAPE_OK;
    npy->array[0] = (npy_array){.name = FILE_NAME, .count = drape_model_node_count(def->model)};
    npy->array[1] = (npy_array){.name = RENDER_NAME, .count = surface->node_count};
    npy->arrays = surface->bound ? 2 : 1;
    for (size_t i = 0; i < npy->arrays && !status; i++) {
        npy_array *a = &npy->array[i];
        char header[DRAPE_NPY_HEADER];
        status = drape_export_open(def, a->name, &a->file);
        if (status || def->resumes)
            continue;
        drape_npy_put_header(0, a->count, header);
        drape_file_put(&a->file, header, sizeof header);
        drape_file_declare(&a->file, 0, sizeof header);
        status = drape_file_publish(&a->file);
    }
    return status;
}

/* Ends a frame, whose points were put. */
static drape_status end_frame(npy_array *a)
{
    char header[DRAPE_NPY_HEADER];
    const int64_t frame_size = 3 * (int64_t)sizeof(double) * a->count;
    drape_npy_put_header((drape_file_end(&a->file) - DRAPE_NPY_HEADER) / frame_size, a->count, header);
    drape_file_overwrite(&a->file, 0, header, sizeof header);
    return drape_file_keep(&a->file);
}

/* The nodes come last, as their number of frames is what readers of the run go by: if they fail, the other
 * array has a frame more, which the next run or resume removes. */
static drape_status npy_write(const drape_export_def *def, void *state, const drape_frame *frame)
{
    npy_state *npy = state;
    (void)def;
    drape_status status = DRAPE_OK;
    for (size_t i = npy->arrays; i-- > 0 && !status;) {
        npy_array *a = &npy->array[i];
        drape_file_put_doubles(&a->file, i ? frame->positions : frame->nodes, 3 * (size_t)a->count);
        status = end_frame(a);
    }
    return status;
}

static drape_file *npy_shared(void *state)
{
    return &((npy_state *)state)->array[0].file;
}

static drape_status npy_settle(void *state, int error, uint64_t sum)
{
    npy_array *a = &((npy_state *)state)->array[0];
    drape_file_put_written(&a->file, 3 * sizeof(double) * (uint64_t)a->count, sum, error);
    return end_frame(a);
}

const drape_exporter_ops drape_exporter_npy = {
    .entry = {.name = "npy",
              .summary =
                  "positions.npy: one array, frames x nodes x 3, float64; valid after every frame; with a "
                  "render mesh also render_positions.npy",
              .reference = "NPY format version 1.0, numpy.lib.format"},
    .state_size = sizeof(npy_state),
    .y_up = true,
    .names = {FILE_NAME, RENDER_NAME},
    .open = npy_open,
    .write = npy_write,
    .shared = npy_shared,
    .settle = npy_settle,
};
