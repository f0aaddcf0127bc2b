/* realtime.h: `drape run --realtime`: frames with a budget, and how long they took. */
#ifndef DRAPE_CLI_REALTIME_H
#define DRAPE_CLI_REALTIME_H

#include "cli/cli.h"
#include "io/summary.h"

typedef struct cli_realtime {
    double *seconds; /* (count) wall clock of each frame */
    size_t count, room;
    drape_summary_realtime result;
} cli_realtime;

/* Frames of 1 / frame_rate up to the scene's duration, each with that time as its budget; it does not sleep. Late
 * frames are no failure. The status is that of the advance. cli_realtime_free in any case. */
drape_status cli_realtime_run(cli_realtime *realtime, const cli_scene *scene);
void cli_realtime_print(const cli_realtime *realtime); /* on stdout */
void cli_realtime_free(cli_realtime *realtime);

#endif
