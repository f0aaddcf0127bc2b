/* signals.c: see signals.h. */
#include "cli/signals.h"

#include <signal.h>
#include <stddef.h>

static volatile sig_atomic_t interrupted; /* a handler has no other place to leave a word */

static void remember(int signal)
{
    (void)signal;
    interrupted = 1;
}

/* Also where they were ignored: a shell starts the background jobs of a script so, and a signal that is
 * sent to such a job is meant. */
void cli_catch_signals(void)
{
    const struct sigaction action = {.sa_handler = remember, .sa_flags = (int)SA_RESETHAND | SA_RESTART};
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGHUP, &action, NULL);
}

bool cli_interrupted(void)
{
    return interrupted != 0;
}
