/* stopping.c: see stopping.h. */
#include "nonlinear/stopping.h"

#include <math.h>
#include <string.h>

#define SHARE (DRAPE_LOCAL_ERROR_SHARE * DRAPE_LOCAL_ERROR_SHARE)

drape_status drape_stopping_init(drape_arena *arena, drape_step_equation *equation,
                                 const drape_islands *islands, drape_stopping *s)
{
    *s = (drape_stopping){.equation = equation, .islands = islands};
    s->progress = drape_arena_take(arena, equation->dofs / 3 + 1, sizeof *s->progress);
    s->work = drape_arena_take(arena, 2 * (equation->dofs / 3 + 1), sizeof *s->work);
    s->weight = drape_arena_take(arena, equation->dofs / 3, sizeof *s->weight);
    if (drape_arena_status(arena))
        return drape_arena_status(arena);
    memcpy(s->weight, equation->weight, equation->dofs / 3 * sizeof *s->weight);
    return DRAPE_OK;
}

void drape_stopping_end(drape_stopping *s)
{
    memcpy(s->equation->weight, s->weight, s->equation->dofs / 3 * sizeof *s->weight);
}

void drape_stopping_begin(drape_stopping *s)
{
    drape_stopping_end(s);
    s->ended_by_error = false;
    for (int32_t k = 0; k < s->islands->count; k++)
        s->progress[k] = (drape_progress){.gain = NAN};
}

/* Takes the weight from the nodes of islands that are done. Returns whether all are. */
static bool leave_done(drape_stopping *s)
{
    bool all = true;
    for (size_t i = 0; i < s->equation->dofs / 3; i++) {
        const bool done = s->progress[s->islands->of[i]].done;
        if (done)
            s->equation->weight[i] = 0;
        all &= done;
    }
    return all;
}

bool drape_stopping_test_residual(drape_stopping *s, double bound)
{
    const drape_step_equation *e = s->equation;
    for (int32_t k = 0; k < s->islands->count; k++)
        s->progress[k].largest = 0;
    for (size_t i = 0; i < e->dofs; i++) {
        double *largest = &s->progress[s->islands->of[i / 3]].largest;
        *largest = fmax(*largest, s->weight[i / 3] * fabs(e->f[i]));
    }
    s->progress[0].largest = drape_ranks_largest(e->ranks, s->progress[0].largest);
    for (int32_t k = 0; k < s->islands->count; k++)
        s->progress[k].done |= s->progress[k].largest <= bound;
    return leave_done(s);
}

/* Sets the local error at d + p of each island that is not done. */
static void measure(drape_stopping *s, const double *d, const double *p)
{
    const drape_step_equation *e = s->equation;
    memset(s->work, 0, 2 * (size_t)s->islands->count * sizeof *s->work);
    for (size_t i = 0; i < e->dofs; i++)
        drape_step_equation_add_own_error(e, i, d[i] + p[i], s->work + 2 * (size_t)s->islands->of[i / 3]);
    for (int i = 0; i < 2; i++)
        s->work[i] = drape_ranks_sum(e->ranks, s->work[i]);
    for (int32_t k = 0; k < s->islands->count; k++)
        if (!s->progress[k].done)
            s->progress[k].own = fmin(s->work[2 * k], s->work[2 * k + 1]);
}

void drape_stopping_test_error(drape_stopping *s, const drape_length *lengths, const double *d,
                               const double *p, bool exact, double fraction)
{
    measure(s, d, p);
    for (int32_t k = 0; k < s->islands->count; k++) {
        drape_progress *q = &s->progress[k];
        const drape_length *l = &lengths[k];
        const double bound = SHARE * q->own;
        const bool before = q->small;
        if (q->done)
            continue;
        const bool descends = l->start < 0 && l->found && l->end <= -l->start;
        q->gain = fmax(-l->start, 0) / fraction;
        q->small = fraction == 1 && l->length >= 1 && descends && q->gain <= bound &&
                   -l->length * (l->start + l->end) / 2 <= bound;
        if (s->by_error && !s->strict && q->small && (exact || before))
            q->done = s->ended_by_error = true;
    }
    leave_done(s);
}

void drape_stopping_estimate(drape_stopping *s, const double *d, const double *p)
{
    const drape_step_equation *e = s->equation;
    double *work = s->work;
    measure(s, d, p);
    memset(work, 0, (size_t)s->islands->count * sizeof *work);
    for (size_t i = 0; i < e->dofs; i++)
        work[s->islands->of[i / 3]] -= e->f[i] * p[i];
    work[0] = drape_ranks_sum(e->ranks, work[0]);
    for (int32_t k = 0; k < s->islands->count; k++)
        if (!s->progress[k].done)
            s->progress[k].gain = fmax(work[k], 0);
}

static bool is_small(const drape_progress *q)
{
    return q->done || q->gain <= SHARE * q->own;
}

bool drape_stopping_is_small(const drape_stopping *s)
{
    bool small = true;
    for (int32_t k = 0; k < s->islands->count; k++)
        small &= is_small(&s->progress[k]);
    return small;
}

bool drape_stopping_keep_small(const drape_stopping *s, double *p)
{
    bool any = false;
    for (int32_t k = 0; k < s->islands->count; k++)
        any |= !s->progress[k].done && is_small(&s->progress[k]);
    for (size_t i = 0; i < s->equation->dofs; i++)
        p[i] = is_small(&s->progress[s->islands->of[i / 3]]) ? p[i] : 0;
    return any;
}

void drape_stopping_finish_small(drape_stopping *s)
{
    for (int32_t k = 0; k < s->islands->count; k++)
        if (!s->progress[k].done && is_small(&s->progress[k]))
            s->progress[k].done = s->ended_by_error = true;
    leave_done(s);
}

bool drape_stopping_left(const drape_stopping *s, double *left)
{
    bool corrected = false;
    *left = 0;
    for (int32_t k = 0; k < s->islands->count; k++)
        if (!isnan(s->progress[k].gain)) {
            *left += s->progress[k].gain;
            corrected = true;
        }
    return corrected;
}
