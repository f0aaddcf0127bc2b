/* schedule.c: see schedule.h. */
#include "sim/schedule.h"

#include "model/model.h"

#include <float.h>
#include <math.h>

/* of the time: a shorter remainder is rounding error in the host's own sum */
#define ROUNDING (1e3 * DBL_EPSILON)
/* of dt: in a shorter remainder nothing happens, and 1/h^2 would overflow */
#define LEAST (DBL_EPSILON * DBL_EPSILON)

void drape_schedule_init(drape_schedule *s, drape_stepping stepping, double dt, double start)
{
    *s = (drape_schedule){.stepping = stepping, .dt = dt, .start = start, .now = start};
    s->limit = stepping == DRAPE_STEPS_PROPOSED ? dt : INFINITY;
}

void drape_schedule_aim(drape_schedule *s, double end)
{
    if ((s->part > 0 || s->cut) && end != s->end) {
        s->start = s->now;
        s->count = 0;
        s->part = 0;
        s->cut = false;
    }
    s->end = end;
    s->tries = 0;
    s->tries_from = s->now;
}

static double interval_time(const drape_schedule *s, int64_t k)
{
    return s->start + (double)k * s->dt;
}

/* The difference up to which k dt and the caller's own sum to the time t count as the same time. */
static double rounding(double t)
{
    return 4 * DBL_EPSILON * fabs(t);
}

/* Remainders up to this are left out. */
static double least_remainder(const drape_schedule *s)
{
    return fmax(ROUNDING * fabs(s->end), LEAST * s->dt);
}

/* Remainders up to this are joined to the interval before; it exceeds the rounding error that a frame can
 * add. */
static double min_remainder(const drape_schedule *s)
{
    return fmax(DRAPE_SAME * s->dt, 2 * rounding(s->end));
}

/*
 * Opens the interval after `count`: a whole one, one cut by the end, or one extended by a tiny remainder.
 * After the latter two, counting restarts at the end. Otherwise the times of a host that adds up its frames
 * would drift ever further from the counted times, until a remainder is just too large to be joined and
 * becomes a step of 1e-9 dt.
 */
static void open_interval(drape_schedule *s)
{
    double t0 = interval_time(s, s->count), t1 = interval_time(s, s->count + 1);
    double beyond = s->end - t1;
    bool same = fabs(beyond) <= rounding(t1), joined = !same && fabs(beyond) <= min_remainder(s),
         cut = !same && !joined && beyond < 0;
    s->anew = joined || cut;
    s->interval_start = t0;
    s->interval_end = same || s->anew ? s->end : t1;
    s->interval_size = cut ? s->end - t0 : joined ? s->dt + beyond : s->dt;
}

/* The rest of the advance is covered by one step if one suffices, or by two halves if two do, so that no
 * tiny step is left over. */
static bool next_proposed(const drape_schedule *s, double *t1, double *h)
{
    const double end = s->cut ? s->cut_end : s->end;
    double left = end - s->now;
    *h = s->limit >= (1 - DRAPE_SAME) * left ? left : 2 * s->limit > left ? left / 2 : s->limit;
    *t1 = *h == left ? end : s->now + *h;
    return s->end - s->now > least_remainder(s);
}

static bool next_counted(drape_schedule *s, double *t1, double *h)
{
    if (s->part == 0 && !s->cut) {
        double left = s->end - interval_time(s, s->count);
        double least =
            /* before the first step there is none to join */
            s->stepped ? min_remainder(s) : least_remainder(s);
        if (!(left > least))
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

static bool propose(drape_schedule *s, double *t1, double *h)
{
    switch (s->stepping) {
    case DRAPE_STEPS_FREE:
        *t1 = s->cut ? s->cut_end : s->end;
        *h = fmin(*t1 - s->now, s->limit);
        return s->end - s->now > least_remainder(s);
    case DRAPE_STEPS_PROPOSED:
        return next_proposed(s, t1, h);
    case DRAPE_STEPS_COUNTED:
        break;
    }
    return next_counted(s, t1, h);
}

bool drape_schedule_next(drape_schedule *s, double *t1, double *h)
{
    bool more = propose(s, t1, h);
    s->tried = *h;
    return more;
}

void drape_schedule_accept(drape_schedule *s, double t1, double h_next, bool grow)
{
    s->now = t1;
    s->tries++;
    if (t1 - s->tries_from >= (1 - DRAPE_SAME) * s->dt) {
        s->tries = 0;
        s->tries_from = t1;
    }
    s->stepped = true;
    s->limit = s->stepping == DRAPE_STEPS_PROPOSED ? h_next : INFINITY;
    if (s->stepping == DRAPE_STEPS_COUNTED) {
        /* The level is lowered as soon as the finished parts make up whole parts of the lower level. */
        s->part++;
        bool whole = s->part == (int64_t)1 << s->level;
        if (grow && s->level > 0 && s->part % 2 == 0) {
            s->level--;
            s->part /= 2;
        }
        if (whole) {
            s->part = 0;
            s->count++;
            s->cut = false;
            if (s->anew) {
                s->start = s->interval_end;
                s->count = 0;
            }
        }
    } else if (t1 >= s->cut_end)
        s->cut = false;
}

void drape_schedule_cut(drape_schedule *s, double end)
{
    s->tries++;
    s->cut = true;
    s->cut_end = end;
    if (s->stepping != DRAPE_STEPS_COUNTED)
        return;
    s->level = 0;
    s->part = 0;
    s->anew = true;
    s->interval_start = s->now;
    s->interval_end = end;
    s->interval_size = end - s->now;
}

void drape_schedule_repeat(drape_schedule *s)
{
    s->tries++;
}

bool drape_schedule_retry(drape_schedule *s, double h_next)
{
    s->limit = h_next;
    s->tries++;
    if (s->stepping != DRAPE_STEPS_COUNTED)
        return h_next > 0 && h_next < s->tried;
    if (s->level == DRAPE_SCHEDULE_LEVELS)
        return false;
    s->level++;
    s->part *= 2;
    return true;
}
