/* line_search.c: see line_search.h. */
#include "nonlinear/line_search.h"

#include <math.h>
#include <string.h>

#define WORK_FRACTION 0.5 /* of the work at the start, which the residual may do at the end */

drape_status drape_line_search_init(drape_arena *arena, drape_step_equation *equation,
                                    const drape_islands *islands, drape_line_search *s)
{
    s->equation = equation;
    s->islands = islands;
    s->evaluated = false;
    s->lengths = drape_arena_take(arena, equation->dofs / 3 + 1, sizeof *s->lengths);
    s->trial = drape_arena_take(arena, equation->dofs, sizeof *s->trial);
    return drape_arena_status(arena);
}

/* Sets the `end` of each island to its F . p. */
static void measure(drape_line_search *s, const double *p)
{
    const drape_step_equation *e = s->equation;
    for (int32_t k = 0; k < s->islands->count; k++)
        s->lengths[k].end = 0;
    for (size_t i = 0; i < e->dofs; i++)
        s->lengths[s->islands->of[i / 3]].end += e->f[i] * p[i];
    s->lengths[0].end = drape_ranks_sum(e->ranks, s->lengths[0].end);
}

static double length_at(const drape_line_search *s, size_t i)
{
    return s->lengths[s->islands->of[i / 3]].length;
}

drape_length drape_length_begin(double start)
{
    return (drape_length){.length = 1, .start = start, .high = INFINITY, .found = !(start < 0)};
}

void drape_length_judge(drape_length *l, bool lengthens)
{
    const double a = l->length;
    l->found = l->found || fabs(l->end) <= -WORK_FRACTION * l->start || (l->end < 0 && a == 1 && !lengthens);
    if (l->found)
        return;
    if (l->end < 0)
        l->low = a;
    else
        l->high = a;
    l->length = isinf(l->high) ? 2 * a : (l->low + l->high) / 2;
}

/* The same for every island or, with contact, for all by the sum of their works; whether all are found. */
static bool judge_all(drape_line_search *s, bool joint, bool lengthens)
{
    bool found = true;
    drape_length all = s->lengths[0];
    for (int32_t k = 1; joint && k < s->islands->count; k++) {
        all.start += s->lengths[k].start;
        all.end += s->lengths[k].end;
    }
    if (joint)
        drape_length_judge(&all, lengthens);
    for (int32_t k = 0; k < s->islands->count; k++) {
        drape_length *l = &s->lengths[k];
        if (joint)
            *l = (drape_length){all.length, l->start, l->end, all.low, all.high, all.found};
        else
            drape_length_judge(l, lengthens);
        found &= l->found;
    }
    return found;
}

/* Whether a length above 1, which all have with contact, leads to none that p was not shortened for. */
static bool stays_feasible(drape_line_search *s, const double *d, const double *p, double longest)
{
    drape_step_equation *e = s->equation;
    const double a = s->lengths[0].length;
    if (!e->has_contact || !(a > 1))
        return true;
    drape_step_equation_move(e, d);
    for (size_t i = 0; i < e->dofs; i++)
        s->trial[i] = a * p[i];
    return a <= longest && drape_step_equation_make_feasible(e, s->trial) == 1;
}

void drape_line_search_along(drape_line_search *s, const double *d, const double *before, double longest,
                             double *p)
{
    const int32_t count = s->islands->count;
    const bool joint = s->equation->has_contact;
    double start = 0;
    measure(s, p);
    for (int32_t k = 0; k < count; k++)
        start += s->lengths[k].end;
    for (int32_t k = 0; k < count; k++) {
        const double own = s->lengths[k].end;
        s->lengths[k] = drape_length_begin(joint ? start : own);
        s->lengths[k].start = own;
    }
    bool found = false;
    for (int trial = 0; trial < DRAPE_LENGTH_TRIALS && !found; trial++) {
        s->evaluated = false;
        if (!stays_feasible(s, d, p, longest))
            break;
        /* F at d + (before + a p), rounded as the caller adds them. */
        drape_step_equation *e = s->equation;
        for (size_t i = 0; i < e->dofs; i++)
            s->trial[i] = d[i] + ((before ? before[i] : 0) + length_at(s, i) * p[i]);
        s->evaluated = drape_step_equation_evaluate(e, s->trial);
        if (s->evaluated)
            measure(s, p);
        for (int32_t k = 0; !s->evaluated && k < s->islands->count; k++)
            s->lengths[k].end = INFINITY;
        found = judge_all(s, joint, longest > 1);
    }
    s->shortest = INFINITY;
    s->longest = 0;
    for (int32_t k = 0; k < count; k++) {
        drape_length *l = &s->lengths[k];
        l->length = l->found || !(l->low > 0) ? l->length : l->low;
        s->shortest = fmin(s->shortest, l->length);
        s->longest = fmax(s->longest, l->length);
    }
    s->evaluated &= found;
    for (size_t i = 0; i < s->equation->dofs; i++)
        p[i] *= length_at(s, i);
}

bool drape_line_search_knows(const drape_line_search *s, const double *d)
{
    return s->evaluated && memcmp(d, s->trial, s->equation->dofs * sizeof *d) == 0;
}
