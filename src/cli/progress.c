/* progress.c: the line on the terminal. It only uses carriage returns and blanks, no colours or control
 * sequences, so NO_COLOR and dumb terminals need no special case. */
#include "cli/cli.h"

#include "base/clock.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#define PERIOD        0.1 /* shortest time between two updates [s] */
#define LOG_PERIOD    300 /* the same of lines in a log [s] */
#define DEFAULT_WIDTH 80
#define MAX_WIDTH     120
#define BAR           24 /* cells */

/* 59 -> "0:59", 3725 -> "1:02:05" */
static void time_text(double seconds, char *text, size_t size)
{
    if (!(seconds < 1e8)) {
        snprintf(text, size, "-:--");
        return;
    }
    long s = lround(seconds);
    if (s >= 3600)
        snprintf(text, size, "%ld:%02ld:%02ld", s / 3600, s / 60 % 60, s % 60);
    else
        snprintf(text, size, "%ld:%02ld", s / 60, s % 60);
}

static void draw(const cli_progress *p, const char *line)
{
    char padded[MAX_WIDTH + 3];
    snprintf(padded, sizeof padded, "\r%-*.*s\r", p->width, p->width, line);
    fputs(padded, stderr);
}

void cli_progress_begin(cli_progress *p, const drape_sim *sim, double end)
{
    *p = (cli_progress){.on = isatty(STDERR_FILENO),
                        .from = sim ? drape_sim_time(sim) : 0,
                        .end = end,
                        .start = drape_clock_seconds(),
                        .shown = -INFINITY};
    if (!p->on) {
        p->shown = p->start; /* short sweeps leave no line in a log */
        return;
    }
    struct winsize size;
    int columns =
        ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : DEFAULT_WIDTH;
    p->width = columns > MAX_WIDTH ? MAX_WIDTH : columns - 1; /* a terminal may wrap after its last column */
    if (sim)
        cli_progress_show(p, sim);
}

static void fill_bar(double share, char bar[BAR + 1])
{
    int full = (int)(share * BAR);
    memset(bar, '.', BAR);
    memset(bar, '#', (size_t)(full < 0 ? 0 : full > BAR ? BAR : full));
    bar[BAR] = 0;
}

/* Whether a period has passed since the last update; if so, the last update is now. */
static bool is_due(cli_progress *p, double period)
{
    const double now = drape_clock_seconds();
    const bool due = now - p->shown >= period;
    p->shown = due ? now : p->shown;
    return due;
}

void cli_progress_show(cli_progress *p, const drape_sim *sim)
{
    char bar[BAR + 1], eta[24], line[256];
    if (!p->on || !is_due(p, PERIOD))
        return;
    const double time = drape_sim_time(sim), share = time / p->end, wall = p->shown - p->start,
                 made = time - p->from;
    fill_bar(share, bar);
    time_text(made > 0 ? wall * (p->end - time) / made : INFINITY, eta, sizeof eta);
    snprintf(line, sizeof line, "[%s] %3.0f %%  %.4g of %.4g s  %.3gx real time  ETA %s  %lld rejected", bar,
             100 * share, time, p->end, wall > 0 ? made / wall : 0.0, eta,
             (long long)drape_sim_statistics(sim).steps_rejected);
    draw(p, line);
}

void cli_progress_count(cli_progress *p, int64_t done, int64_t total, double seconds_left)
{
    char bar[BAR + 1], eta[24], line[256];
    const double share = total > 0 ? (double)done / (double)total : 0;
    const long long counted = done, all = total;
    fill_bar(share, bar);
    time_text(isnan(seconds_left) ? INFINITY : seconds_left, eta, sizeof eta);
    if (p->logs && is_due(p, LOG_PERIOD)) { /* a sweep of hours must not be silent in a file */
        if (total > 0)
            fprintf(stderr, "%lld of %lld cases, about %s left\n", counted, all, eta);
        else
            fputs("the reference\n", stderr);
    }
    if (!p->on || (total > 0 && !is_due(p, PERIOD)))
        return;
    if (total > 0)
        snprintf(line, sizeof line, "[%s] %3.0f %%  %lld of %lld cases  ETA %s", bar, 100 * share, counted,
                 all, eta);
    else
        snprintf(line, sizeof line, "[%s] the reference", bar);
    draw(p, line);
}

void cli_progress_hide(cli_progress *p)
{
    if (p->on)
        draw(p, "");
    p->shown = -INFINITY;
}

void cli_progress_clear(cli_progress *p)
{
    cli_progress_hide(p);
    p->on = false;
}
