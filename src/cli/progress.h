/* progress.h: a line on the terminal that shows the progress of a run. If stderr is not a terminal, an
 * experiment adds a line every five minutes to it, and others nothing. */
#ifndef DRAPE_CLI_PROGRESS_H
#define DRAPE_CLI_PROGRESS_H

#include "drape/drape.h"

#include <stdbool.h>
#include <stdint.h>

typedef struct cli_progress {
    bool on;             /* stderr is a terminal */
    bool logs;           /* it is not, and lines are added to it; set by the caller */
    double from, end;    /* simulated time at the beginning and the end [s] */
    double start, shown; /* clock at the beginning and at the last update [s] */
    int width;           /* columns of the line */
} cli_progress;

/* Of a run of the sim up to the simulated time `end`; NULL: of a sweep, whose progress is a number of
 * cases. */
void cli_progress_begin(cli_progress *progress, const drape_sim *sim, double end);
/* Shows the simulated time; updates at most ten times a second, as cli_progress_count does. */
void cli_progress_show(cli_progress *progress, const drape_sim *sim);
/* Shows the number of cases; total 0: their reference is being computed. */
void cli_progress_count(cli_progress *progress, int64_t done, int64_t total, double seconds_left);
/* Erases the line until it is shown again, for other output on the terminal; or for good. */
void cli_progress_hide(cli_progress *progress);
void cli_progress_clear(cli_progress *progress);

#endif
