/* schedule.c: see schedule.h. */
#include "sim/schedule.h"

#include <float.h>
#include <math.h>

#define JOIN 1e-9 /* of dt: a shorter remainder joins the interval before */

void drape_schedule_init(drape_schedule *s, double dt, double start)
{
    *s = (drape_schedule){.dt = dt, .start = start, .now = start, .limit = INFINITY};
}

void drape_schedule_aim(drape_schedule *s, double now, double end)
{
    if (s->part > 0) {
        s->start = now;
        s->count = 0;
        s->part = 0;
    }
    s->end = end;
}

static double interval_time(const drape_schedule *s, int64_t k)
{
    return s->start + (double)k * s->dt;
}

/* The interval after count: a whole one, one that the end cuts, or one that takes a tiny remainder along. */
static void open_interval(drape_schedule *s)
{
    double t0 = interval_time(s, s->count), t1 = interval_time(s, s->count + 1);
    double beyond = s->end - t1;
    bool at_end = fabs(beyond) <= JOIN * s->dt;
    bool same =
        fabs(beyond) <= 4 * DBL_EPSILON * fabs(t1); /* rounding of k dt against the caller's own sum */
    s->cut = beyond < 0 && !at_end;
    s->interval_start = t0;
    s->interval_end = s->cut || at_end ? s->end : t1;
    s->interval_size = s->cut ? s->end - t0 : at_end && !same ? s->dt + beyond : s->dt;
}

bool drape_schedule_next(drape_schedule *s, double *t1, double *h)
{
    if (s->dt == 0) {
        *t1 = s->end;
        *h = fmin(s->end - s->now, s->limit);
        return s->end > s->now;
    }
    if (s->part == 0) {
        if (!(s->end - interval_time(s, s->count) > JOIN * s->dt))
            return false;
        open_interval(s);
    }
    int64_t parts = (int64_t)1 << s->level;
    double size = s->interval_end - s->interval_start;
    *h = ldexp(s->interval_size, -s->level);
    *t1 = s->part + 1 == parts ? s->interval_end
                               : s->interval_start + ldexp(size * (double)(s->part + 1), -s->level);
    return true;
}

static void close_interval(drape_schedule *s)
{
    s->part = 0;
    s->count++;
    if (s->cut) {
        s->start = s->interval_end;
        s->count = 0;
    }
}

/* A level is left as soon as the parts done make whole parts of the level below. */
void drape_schedule_accept(drape_schedule *s, double t1)
{
    s->now = t1;
    s->limit = INFINITY;
    if (s->dt == 0)
        return;
    s->part++;
    bool whole = s->part == (int64_t)1 << s->level;
    if (s->level > 0 && s->part % 2 == 0) {
        s->level--;
        s->part /= 2;
    }
    if (whole)
        close_interval(s);
}

void drape_schedule_halve(drape_schedule *s, double h)
{
    s->limit = h / 2;
    s->level++;
    s->part *= 2;
}
