/* realtime_warnings.c: what drape_sim_warning reports of runs with a time budget or with relaxed cloth. */
#include "realtime/relaxed_report.h"

#include <stdio.h>

#define SLOW 0.1 /* dropped time, in the simulated time, from which there is a warning */

/* Where, how long and how deep cloth was relaxed. */
static bool had_no_room(drape_sim *sim, char *text, size_t size)
{
    int32_t places = 0, most = -1;
    for (int32_t c = -1; c < sim->model->collider_count; c++) {
        const drape_relaxed_total *total = drape_sim_relaxed_total(sim, c);
        places += total->most > 0;
        if (total->most > 0 && (places == 1 || total->deepest > drape_sim_relaxed_total(sim, most)->deepest))
            most = c;
    }
    if (places == 0)
        return false;
    const drape_relaxed_total *total = drape_sim_relaxed_total(sim, most);
    double deepest;
    char more[40] = "";
    if (places > 1)
        snprintf(more, sizeof more, ", and at %d other%s", (int)places - 1, places == 2 ? "" : "s");
    snprintf(text, size,
             "cloth had no room at %s%s: up to %d of its nodes relaxed there, for %.3g s between %.4g and "
             "%.4g s, up to "
             "%.3g m deep; %d now",
             drape_sim_relaxed_name(sim, most), more, (int)total->most, total->seconds, total->first,
             total->last, total->deepest, (int)drape_sim_relaxed_now(sim, &deepest));
    return true;
}

/* Held steps (hold.h). */
static bool was_held(drape_sim *sim, char *text, size_t size)
{
    const drape_statistics *s = &sim->statistics;
    if (s->steps_held == 0)
        return false;
    snprintf(text, size,
             "in %lld of %lld steps no size of the step could be made, and the cloth was held where it was, "
             "or went with its pins: the log says when and why",
             (long long)s->steps_held, (long long)s->steps_accepted);
    return true;
}

/* Calls after which edges passed through triangles of the cloth. */
static bool passed_through(drape_sim *sim, char *text, size_t size)
{
    const drape_realtime_memory *m = sim->realtime;
    if (m->crossed == 0)
        return false;
    snprintf(
        text, size,
        "after %lld calls with a time budget edges of the cloth passed through its triangles, up to %lld of "
        "them: pins leave the cloth no room, or it began so",
        (long long)m->crossed, (long long)m->most_crossings);
    return true;
}

/* Advances with a time budget that fall behind: the cloth moves in slow motion. */
static bool drops_time(drape_sim *sim, char *text, size_t size)
{
    const double dropped = sim->realtime->dropped, motion = drape_sim_time(sim);
    if (!(dropped > SLOW * motion))
        return false;
    snprintf(text, size,
             "steps did not fit the time budget: %.3g s of simulated time were dropped, beside %.3g s that "
             "were simulated: a larger budget, fewer nodes, a thicker cloth or slower bodies keep up",
             dropped, motion);
    return true;
}

const drape_warning_check drape_realtime_warnings[] = {{"no_room", had_no_room},
                                                       {"held", was_held},
                                                       {"crossings", passed_through},
                                                       {"time_dropped", drops_time},
                                                       {NULL, NULL}};
