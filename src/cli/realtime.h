/* realtime.h: `drape run --realtime`: frames within a budget of wall clock, and how long they took. */
#ifndef DRAPE_CLI_REALTIME_H
#define DRAPE_CLI_REALTIME_H

#include "cli/cli.h"
#include "io/summary.h"

typedef struct cli_realtime {
    double *seconds; /* (count) wall clock of each frame, in the command's arena */
    size_t count, capacity;
    drape_summary_realtime result;
} cli_realtime;

/* Advances in frames of 1 / frame_rate up to the scene's duration, each with that time as its budget, without
 * sleeping. Late frames are not failures. The status is that of the advance. */
drape_status cli_realtime_run(cli_realtime *realtime, const cli_command *command, const cli_scene *scene);
void cli_realtime_print(const cli_realtime *realtime); /* on stdout */

#endif
