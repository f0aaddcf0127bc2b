/* signals.c: see signals.h. */
#include "cli/signals.h"

#include "cli/cli.h"

#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>

static volatile sig_atomic_t interrupted; /* set by the handler */
static const int caught[] = {SIGINT, SIGTERM, SIGHUP};

static _Atomic(drape_sim *) cancelled;
_Static_assert(ATOMIC_POINTER_LOCK_FREE == 2, "a signal handler reads it");

static void on_signal(int signal)
{
    (void)signal;
    interrupted = 1;
    drape_sim_cancel(atomic_load(&cancelled));
}

void cli_signals_cancel(drape_sim *sim)
{
    atomic_store(&cancelled, sim);
    if (interrupted)
        drape_sim_cancel(sim);
}

/* Also catches signals that were ignored: shells start background jobs of scripts so, and a signal sent to
 * such a job is intended. */
void cli_catch_signals(void)
{
    const struct sigaction action = {.sa_handler = on_signal, .sa_flags = (int)SA_RESETHAND | SA_RESTART};
    for (size_t i = 0; i < sizeof caught / sizeof *caught; i++)
        sigaction(caught[i], &action, NULL);
}

/* A handler that the first signal has reset is not installed again. */
void cli_signals_end_waits(bool end)
{
    struct sigaction action;
    for (size_t i = 0; i < sizeof caught / sizeof *caught; i++) {
        if (sigaction(caught[i], NULL, &action) || action.sa_handler != on_signal)
            continue;
        action.sa_flags = end ? action.sa_flags & ~SA_RESTART : action.sa_flags | SA_RESTART;
        sigaction(caught[i], &action, NULL);
    }
}

bool cli_interrupted(void)
{
    return interrupted != 0;
}

int cli_report_interrupted(const char *verb)
{
    fflush(stdout);
    fprintf(stderr, "drape %s: interrupted\n", verb);
    return CLI_INTERRUPTED;
}
