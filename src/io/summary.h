/* summary.h: the results of a run, as a JSON file. */
#ifndef DRAPE_IO_SUMMARY_H
#define DRAPE_IO_SUMMARY_H

#include "io/folder.h"

#include <jansson.h>

#define DRAPE_SUMMARY_NAME  "summary.json"  /* in the folder of a run */
#define DRAPE_ACCURACY_NAME "accuracy.json" /* there: of `drape accuracy`, for the report */

/* Frames with a budget: how long they took, and how many ended at each level. */
typedef struct drape_summary_realtime {
    int64_t frames, missed, full, fewer, larger;
    int64_t inaccurate; /* frames with a step whose estimated error was above its bound */
    int64_t crossings;  /* the largest number of edges through triangles of the cloth after a frame */
    int64_t still;      /* frames without a new state: they took no time, and show the state before */
    double budget, p50, p95, p99, worst; /* [s] wall time per frame */
    double debt, dropped; /* [s] simulated time still owed after the last frame; dropped in total */
} drape_summary_realtime;

/* The results that the sim itself does not know. All members may be 0. */
typedef struct drape_summary_def {
    drape_status status;                    /* the status with which the run ended */
    const char *message;                    /* NULL: none */
    int64_t frames;                         /* number written */
    double wall_total;                      /* [s] of the whole run */
    double wall_output;                     /* [s] part of it spent in output */
    const drape_summary_realtime *realtime; /* NULL: there was no budget */
    const drape_accuracy *accuracy;         /* NULL: none was asked */
} drape_summary_def;

/* An estimate of the error of a run: all but `accuracy.runs`, `asked`, `seconds` and `method`. */
json_t *drape_summary_accuracy(const drape_model *model, const drape_accuracy *accuracy);

/* Writes the file of this name in a folder, or with folder NULL the file at a path that the user named,
 * completely or not at all. Numbers that are not finite become null. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_summary_write(drape_context *ctx, drape_sim *sim, const drape_summary_def *def,
                                 drape_folder *folder, const char *name);

#endif
