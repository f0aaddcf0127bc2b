/* realtime.c: see realtime.h. */
#include "cli/realtime.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static drape_status add_time(cli_realtime *r, drape_arena *arena, double seconds)
{
    if (r->count == r->capacity) {
        size_t capacity = r->capacity ? 2 * r->capacity : 256;
        double *more = drape_arena_resize(arena, r->seconds, capacity, sizeof *more);
        if (!more)
            return DRAPE_E_MEMORY;
        r->seconds = more;
        r->capacity = capacity;
    }
    r->seconds[r->count++] = seconds;
    return DRAPE_OK;
}

static void count(drape_summary_realtime *s, const drape_realtime *frame)
{
    bool full = strcmp(frame->level, "full") == 0, fewer = strcmp(frame->level, "fewer iterations") == 0;
    s->frames++;
    s->missed += !frame->kept;
    s->full += full;
    s->fewer += fewer;
    s->larger += !full && !fewer;
    s->inaccurate += !frame->accurate;
    s->still += !(frame->h > 0);
    s->debt = frame->debt;
    s->dropped = frame->dropped_total;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* By the nearest rank; of sorted times. */
static double percentile(const cli_realtime *r, double share)
{
    size_t rank = (size_t)ceil(share * (double)r->count);
    return r->count ? r->seconds[rank > 0 ? rank - 1 : 0] : 0;
}

drape_status cli_realtime_run(cli_realtime *r, const cli_command *command, const cli_scene *scene)
{
    double end = drape_model_duration(scene->model), frame = 1 / drape_model_frame_rate(scene->model);
    drape_status status = DRAPE_OK;
    r->result.budget = frame;
    while (!status && end - drape_sim_time(scene->sim) - r->result.debt > 1e-9 * frame) {
        drape_realtime report;
        double left = end - drape_sim_time(scene->sim) - r->result.debt;
        status = drape_sim_advance_realtime(scene->sim, fmin(frame, left), frame, &report);
        count(&r->result, &report);
        drape_status kept = add_time(r, command->arena, report.seconds);
        status = status ? status : kept;
    }
    if (!status) /* the debt of the last frames, without a deadline */
        status = drape_sim_advance(scene->sim, end);
    if (r->count > 0)
        qsort(r->seconds, r->count, sizeof *r->seconds, compare);
    r->result.p50 = percentile(r, 0.5);
    r->result.p95 = percentile(r, 0.95);
    r->result.p99 = percentile(r, 0.99);
    r->result.worst = percentile(r, 1);
    return status;
}

void cli_realtime_print(const cli_realtime *r)
{
    const drape_summary_realtime *s = &r->result;
    printf("realtime  %lld frames of %.4g ms: p50 %.4g, p95 %.4g, p99 %.4g, worst %.4g ms; %lld missed\n",
           (long long)s->frames, 1e3 * s->budget, 1e3 * s->p50, 1e3 * s->p95, 1e3 * s->p99, 1e3 * s->worst,
           (long long)s->missed);
    printf("levels    full %lld, fewer iterations %lld, larger steps %lld; %lld without a new state; "
           "%.4g s behind after the last frame, then caught up, %.4g s dropped\n",
           (long long)s->full, (long long)s->fewer, (long long)s->larger, (long long)s->still, s->debt,
           s->dropped);
    printf("accuracy  %lld frames with a step above the bound on its estimated error\n",
           (long long)s->inaccurate);
}
