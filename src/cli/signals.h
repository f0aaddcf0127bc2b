/* signals.h: Ctrl-C and SIGTERM as a wish to stop, which the step in progress outlives. */
#ifndef DRAPE_CLI_SIGNALS_H
#define DRAPE_CLI_SIGNALS_H

#include <stdbool.h>

/* From here on the first signal is remembered; a second one ends the program at once. */
void cli_catch_signals(void);

bool cli_interrupted(void);

#endif
