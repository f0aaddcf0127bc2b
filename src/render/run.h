/* run.h: the frames of a run's folder, as `drape run --out` left it: positions.npy, energy.csv for the times. */
#ifndef DRAPE_RENDER_RUN_H
#define DRAPE_RENDER_RUN_H

#include "model/model.h"

#include <stdio.h>

typedef struct drape_run {
    drape_context *ctx;
    FILE *file;
    char *path;
    size_t nodes, frames, header; /* bytes before the first frame */
    double *times;                /* (frames) [s] */
} drape_run;

/* Errors: DRAPE_E_FILE (no such file, not one of ours, of other nodes than the model's), DRAPE_E_MEMORY. */
drape_status drape_run_open(drape_context *ctx, const char *folder, const drape_model *model, drape_run *run);
void drape_run_close(drape_run *run); /* an empty one is fine */

/* Reads a frame (nodes x 3 [m]). Errors: DRAPE_E_FILE. */
drape_status drape_run_read(drape_run *run, size_t frame, double *x);

#endif
