/* summary.h: what a run came to, as a JSON file. */
#ifndef DRAPE_IO_SUMMARY_H
#define DRAPE_IO_SUMMARY_H

#include "base/context.h"

/* Frames with a budget: how long they took, and on which rung they ended. */
typedef struct drape_summary_realtime {
    int64_t frames, missed, full, fewer, larger;
    int64_t still; /* frames without a new state: they took no time, and show the one before */
    double budget, p50, p95, p99, worst; /* [s] wall clock a frame */
    double debt, dropped; /* [s] simulated time owed at the end of the last frame, dropped in all */
} drape_summary_realtime;

/* What the sim itself does not know. All 0 is a good start. */
typedef struct drape_summary_def {
    drape_status status;                    /* with which the run ended */
    const char *message;                    /* NULL: none */
    int64_t frames;                         /* written */
    double wall_total;                      /* [s] of the whole run */
    double wall_output;                     /* [s] of it in output */
    const drape_summary_realtime *realtime; /* NULL: there was no budget */
} drape_summary_def;

/* Writes path, whole or not at all (a link, a device or a pipe is written through). Numbers that are not
 * finite become null. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_summary_write(drape_context *ctx, drape_sim *sim, const drape_summary_def *def,
                                 const char *path);

#endif
