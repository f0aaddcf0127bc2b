/* realtime.h: `drape run --realtime`: frames within a budget of wall clock, and how long they took. */
#ifndef DRAPE_CLI_REALTIME_H
#define DRAPE_CLI_REALTIME_H

#include "cli/cli.h"
#include "io/summary.h"

typedef struct cli_realtime {
    const cli_command *command;
    drape_setting iterations; /* that were chosen */
    bool iterations_given;    /* by the scene or the command line */
    char chosen[400]; /* threads, method and iterations: what was chosen, and why, and what was given */
    double *seconds;  /* (count) wall clock of each frame, in the command's arena */
    size_t count, capacity;
    drape_summary_realtime result;
    bool estimates; /* the integrator estimates its error */
} cli_realtime;

/* A cli_choose, user: a cli_realtime with its command. Unless the scene or the command line names a method,
 * chooses newton_k, with as many iterations as a few trial steps show to fit into half of a frame, and as
 * many threads as the machine has processors and the mesh thousands of nodes for, unless they are given. The
 * method is set in the scene, too, so that its copy runs again alike. */
cli_choose cli_realtime_choose;

/* Advances in frames of 1 / frame_rate up to the scene's duration, each with that time as its budget, without
 * sleeping. Late frames are not failures. The status is that of the advance. */
drape_status cli_realtime_run(cli_realtime *realtime, const cli_scene *scene);
void cli_realtime_print(const cli_realtime *realtime); /* on stdout */

#endif
