/* signals.h: Ctrl-C, SIGTERM and SIGHUP as a wish to stop, which all stages of a verb look at. */
#ifndef DRAPE_CLI_SIGNALS_H
#define DRAPE_CLI_SIGNALS_H

#include "drape/drape.h"

#include <stdbool.h>

/* From here on the first signal is remembered; a second one ends the program at once. */
void cli_catch_signals(void);

bool cli_interrupted(void);

/* The sim whose step a signal cancels, where that step is all there is to do; NULL: none, and a step in progress is ended. */
void cli_signals_cancel(drape_sim *sim);

/* Whether a signal ends a read or an open that waits, of a scene from a pipe; writes must not be cut by it. */
void cli_signals_end_waits(bool end);

/* One line "drape run: interrupted" on stderr, for what has nothing more to tell. Returns CLI_INTERRUPTED. */
int cli_tell_interrupted(const char *verb);

#endif
