/* signals.c: how a signal ends the program. */
#include "cli/cli.h"

#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <sys/time.h>

#define PERIOD 10000 /* [us]; each of several prints may wait once */
#define GRACE  50    /* periods in which a step may complete before it is cancelled */

static volatile sig_atomic_t interrupted; /* set by the handler */
static volatile sig_atomic_t periods;     /* since then */
static const int caught[] = {SIGINT, SIGTERM, SIGHUP};

static _Atomic(drape_sim *) cancelled;
_Static_assert(ATOMIC_POINTER_LOCK_FREE == 2, "a signal handler reads it");

/* A call that waits ends with EINTR; a write that went on after a part of its bytes waits again, so the timer
 * keeps interrupting until the program ends. */
static void on_signal(int signal)
{
    const struct itimerval again = {.it_interval = {.tv_usec = PERIOD}, .it_value = {.tv_usec = PERIOD}};
    const struct sigaction end = {.sa_handler = SIG_DFL};
    (void)signal;
    interrupted = 1;
    for (size_t i = 0; i < sizeof caught / sizeof *caught; i++)
        sigaction(caught[i], &end, NULL);
    setitimer(ITIMER_REAL, &again, NULL);
}

static void on_timer(int signal)
{
    (void)signal;
    if (periods < GRACE)
        periods = periods + 1;
    else
        drape_sim_cancel(atomic_load(&cancelled));
}

void cli_signals_cancel(drape_sim *sim)
{
    atomic_store(&cancelled, sim);
}

/* Also catches signals that were ignored: shells start background jobs of scripts so, and a signal sent to
 * such a job is intended. */
void cli_catch_signals(void)
{
    const struct sigaction action = {.sa_handler = on_signal}, timer = {.sa_handler = on_timer};
    sigaction(SIGALRM, &timer, NULL);
    for (size_t i = 0; i < sizeof caught / sizeof *caught; i++)
        sigaction(caught[i], &action, NULL);
}

bool cli_interrupted(void)
{
    return interrupted != 0;
}

bool cli_interrupted_by(void *unused)
{
    (void)unused;
    return interrupted != 0;
}

int cli_report_interrupted(const char *verb)
{
    fflush(stdout);
    fprintf(stderr, "drape%s%s: interrupted\n", *verb ? " " : "", verb);
    return CLI_INTERRUPTED;
}
