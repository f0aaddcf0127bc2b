/* signals.h: Ctrl-C, SIGTERM and SIGHUP request a stop, which all stages of a verb check for. */
#ifndef DRAPE_CLI_SIGNALS_H
#define DRAPE_CLI_SIGNALS_H

#include "drape/drape.h"

#include <stdbool.h>

/* After this call the first signal is recorded, and from then on no call of the system waits for longer
 * than a hundredth of a second, such as a read of a scene from a pipe or a write to one; a second signal
 * ends the program at once. */
void cli_catch_signals(void);

bool cli_interrupted(void);
bool cli_interrupted_by(void *unused); /* the same as a callback of the library */

/* Sets the sim whose step in progress is cancelled half a second after a signal, unless it completes before.
 * NULL: none. */
void cli_signals_cancel(drape_sim *sim);

/* Prints the line "drape run: interrupted" on stderr. Returns CLI_INTERRUPTED. */
int cli_report_interrupted(const char *verb);

#endif
