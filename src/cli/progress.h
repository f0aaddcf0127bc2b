/* progress.h: a line on the terminal that says how far a run is. Nothing where stderr is no terminal. */
#ifndef DRAPE_CLI_PROGRESS_H
#define DRAPE_CLI_PROGRESS_H

#include <stdbool.h>
#include <stdint.h>

typedef struct cli_progress {
    bool on;
    double from, end;    /* [s] simulated: where the run goes on, and to */
    double start, shown; /* [s] of the clock: begin of the run, last time that the line was drawn */
    int width;           /* columns that the line may take */
} cli_progress;

void cli_progress_begin(cli_progress *progress, double from, double end); /* end 0: of cases, not of a time */
void cli_progress_show(cli_progress *progress, double time,
                       int64_t rejected); /* at most ten times a second */
/* Cases of a sweep; total 0: what they are compared with is made. */
void cli_progress_count(cli_progress *progress, int64_t done, int64_t total, double seconds_left);
/* Takes the line away, until it is shown again: for output on the same terminal; for good. */
void cli_progress_hide(cli_progress *progress);
void cli_progress_clear(cli_progress *progress);

#endif
