/* run.c: see run.h. */
#include "render/run.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MAGIC 10 /* bytes: magic, version, length of the header */

static drape_status not_ours(const drape_run *run, const char *what)
{
    return drape_fail(run->ctx, DRAPE_E_FILE,
                      "%s: %s; it is float64, frames x nodes x 3, C order, as drape run writes it", run->path,
                      what);
}

/* The shape in the dict of an NPY header. */
static drape_status read_header(drape_run *run, const drape_model *model)
{
    unsigned char magic[MAGIC];
    char *dict = NULL, text[120];
    unsigned long frames = 0, nodes = 0;
    if (fread(magic, 1, MAGIC, run->file) != MAGIC || memcmp(magic, "\x93NUMPY\x01", 7) != 0)
        return not_ours(run, "no NPY file of version 1");
    size_t length = magic[8] + 256u * magic[9];
    if (!(dict = drape_alloc(run->ctx, length + 1, 1)))
        return DRAPE_E_MEMORY;
    bool whole = fread(dict, 1, length, run->file) == length;
    const char *shape = strstr(dict, "'shape': (");
    bool good = whole && strstr(dict, "'<f8'") && strstr(dict, "'fortran_order': False") && shape &&
                sscanf(shape, "'shape': (%lu, %lu, 3)", &frames, &nodes) == 2;
    drape_free(run->ctx, dict);
    if (!good)
        return not_ours(run, "of another type or shape");
    if (nodes != (unsigned long)model->node_count) {
        snprintf(text, sizeof text, "it has %lu nodes, its scene %d", nodes, (int)model->node_count);
        return not_ours(run, text);
    }
    if (frames == 0)
        return drape_fail(run->ctx, DRAPE_E_FILE, "%s: it has no frames", run->path);
    run->header = MAGIC + length;
    run->nodes = nodes;
    run->frames = frames;
    return DRAPE_OK;
}

/* The second column of energy.csv; where that is not there, as many frames a second as the scene says. */
static drape_status read_times(drape_run *run, const char *folder, double frame_rate)
{
    char line[1024];
    size_t size = strlen(folder) + sizeof "/energy.csv";
    char *path = drape_alloc(run->ctx, size, 1);
    run->times = drape_alloc(run->ctx, run->frames, sizeof *run->times);
    if (!path || !run->times) {
        drape_free(run->ctx, path);
        return DRAPE_E_MEMORY;
    }
    for (size_t i = 0; i < run->frames; i++)
        run->times[i] = (double)i / frame_rate;
    snprintf(path, size, "%s/energy.csv", folder);
    FILE *file = fopen(path, "r");
    locale_t old = drape_locale_enter();
    while (file && fgets(line, sizeof line, file)) {
        unsigned long frame;
        double t;
        if (sscanf(line, "%lu,%lf", &frame, &t) == 2 && frame < run->frames && isfinite(t))
            run->times[frame] = t;
    }
    drape_locale_leave(old);
    if (file)
        fclose(file);
    drape_free(run->ctx, path);
    return DRAPE_OK;
}

drape_status drape_run_open(drape_context *ctx, const char *folder, const drape_model *model, drape_run *run)
{
    size_t size = strlen(folder) + sizeof "/positions.npy";
    *run = (drape_run){.ctx = ctx, .path = drape_alloc(ctx, size, 1)};
    if (!run->path)
        return DRAPE_E_MEMORY;
    snprintf(run->path, size, "%s/positions.npy", folder);
    run->file = fopen(run->path, "rb");
    drape_status status = DRAPE_OK;
    if (!run->file)
        status = drape_fail(ctx, DRAPE_E_FILE,
                            "cannot read \"%s\": %s; drape run --out writes it with --format npy", run->path,
                            strerror(errno));
    if (!status)
        status = read_header(run, model);
    if (!status)
        status = read_times(run, folder, model->frame_rate);
    if (status)
        drape_run_close(run);
    return status;
}

void drape_run_close(drape_run *run)
{
    if (!run->ctx)
        return;
    if (run->file)
        fclose(run->file);
    drape_free(run->ctx, run->path);
    drape_free(run->ctx, run->times);
    *run = (drape_run){.frames = 0};
}

drape_status drape_run_read(drape_run *run, size_t frame, double *x)
{
    size_t count = 3 * run->nodes;
    off_t at = (off_t)run->header + (off_t)(frame * count * sizeof *x);
    if (fseeko(run->file, at, SEEK_SET) != 0 || fread(x, sizeof *x, count, run->file) != count)
        return drape_fail(run->ctx, DRAPE_E_FILE,
                          "%s: frame %zu cannot be read: the file is shorter than it says", run->path, frame);
    return DRAPE_OK;
}
