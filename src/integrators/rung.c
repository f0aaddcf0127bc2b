/* rung.c: see rung.h. */
#include "integrators/rung.h"

#include "base/finite.h"

#include <math.h>
#include <string.h>

/* ---- Making and freeing ---- */

static bool create_arrays(drape_rung *s)
{
    drape_context *ctx = s->base.ctx;
    s->nodes = 3 * (size_t)s->base.model->node_count;
    s->dofs = 3 * (size_t)s->base.model->free_count;
    s->x = drape_alloc(ctx, s->nodes, sizeof *s->x);
    s->v = drape_alloc(ctx, s->nodes, sizeof *s->v);
    s->g = drape_alloc(ctx, s->nodes, sizeof *s->g);
    s->past[0] = drape_alloc(ctx, s->nodes, sizeof *s->past[0]);
    s->past[1] = drape_alloc(ctx, s->nodes, sizeof *s->past[1]);
    s->f = drape_alloc(ctx, s->dofs, sizeof *s->f);
    s->trial = drape_alloc(ctx, s->dofs, sizeof *s->trial);
    bool contact = drape_system_contact(s->base.system) != NULL;
    if (contact)
        s->ahead = drape_alloc(ctx, s->nodes, sizeof *s->ahead);
    return s->x && s->v && s->g && s->past[0] && s->past[1] && s->f && s->trial && (s->ahead || !contact);
}

drape_status drape_rung_init(drape_context *ctx, drape_system *system, drape_rung *s)
{
    drape_status status = drape_implicit_init_arrays(ctx, system, &s->base);
    drape_rung_restart(s, NULL);
    return status ? status : create_arrays(s) ? DRAPE_OK : DRAPE_E_MEMORY;
}

void drape_rung_free(drape_rung *s)
{
    void *all[] = {s->x, s->v, s->g, s->past[0], s->past[1], s->f, s->trial, s->ahead};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        drape_free(s->base.ctx, all[i]);
    drape_implicit_free(&s->base);
}

void drape_rung_restart(void *state, const drape_state *from)
{
    drape_rung *s = state;
    (void)from;
    s->past_time[0] = s->past_time[1] = s->past_end = NAN;
}

void drape_rung_archive(drape_rung *s, drape_archive *a)
{
    drape_archive_mark(a, "rung");
    drape_archive_double(a, &s->past_end);
    for (int k = 0; k < 2; k++) {
        drape_archive_double(a, &s->past_time[k]);
        drape_archive_doubles(a, s->past[k], s->nodes);
    }
    drape_work_archive(&s->work, a);
}

size_t drape_rung_bytes(const drape_rung *s)
{
    return sizeof *s + drape_implicit_array_bytes(&s->base) +
           ((s->ahead ? 6 : 5) * s->nodes + 2 * s->dofs) * sizeof(double);
}

/* ---- The guess ---- */

/* Keeps the velocities that steps began with. An attempt at the same step again has the same past. */
static void remember(drape_rung *s, const drape_state *in, double end)
{
    if (in->t == s->past_time[0]) {
        s->past_end = end;
        return;
    }
    bool follows = in->t == s->past_end;
    double *oldest = s->past[1];
    s->past[1] = s->past[0];
    s->past_time[1] = follows ? s->past_time[0] : NAN;
    s->past[0] = oldest;
    s->past_time[0] = in->t;
    s->past_end = end;
    memcpy(s->past[0], in->v, s->nodes * sizeof *in->v);
}

static void guess(drape_rung *s, const drape_state *in, double h, double extrapolation)
{
    drape_implicit *b = &s->base;
    double before = in->t - s->past_time[1];
    double share = isnan(before) ? 0 : extrapolation * h * h / before;
    for (size_t i = 0; i < s->dofs; i++) {
        size_t at = drape_implicit_at(b, i);
        b->inertia[i] = h * in->v[at];
        b->d[i] = b->inertia[i] + share * (in->v[at] - s->past[1][at]);
    }
}

/* q' = (q(x1) - q(x0))/h */
static void set_history(drape_implicit *b, const drape_state *in, double h)
{
    drape_implicit_measure(b, in, b->history);
    for (int64_t i = 0; b->history && i < b->model->measure_count; i++)
        b->history[i] /= -h;
}

/* ---- The residual ---- */

static void set_point(drape_rung *s, const drape_state *in, double h)
{
    const drape_implicit *b = &s->base;
    s->point = (drape_point){.x = s->x,
                             .v = s->v,
                             .internal = in->internal,
                             .weight = 1 / h,
                             .history = b->history,
                             .t = b->t,
                             .span = {b->span[0], b->span[1]}};
    memcpy(s->x, b->x_base, s->nodes * sizeof *s->x);
    memcpy(s->v, b->v_base, s->nodes * sizeof *s->v);
}

bool drape_rung_evaluate(drape_rung *s, const double *d)
{
    const drape_implicit *b = &s->base;
    double start = drape_system_clock(b->system), w = s->point.weight;
    for (size_t i = 0; i < s->dofs; i++) {
        size_t at = drape_implicit_at(b, i);
        s->x[at] = b->x_base[at] + d[i];
        s->v[at] = w * d[i];
    }
    drape_system_force(b->system, &s->point, s->g);
    for (size_t i = 0; i < s->dofs; i++)
        s->f[i] = w * w * b->model->mass[b->model->node_of_free[i / 3]] * (d[i] - b->inertia[i]) +
                  s->g[drape_implicit_at(b, i)];
    s->work.residuals++;
    s->work.residual_seconds += drape_system_clock(b->system) - start;
    return drape_all_finite(s->f, s->dofs);
}

double drape_rung_dot(const double *a, const double *b, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

double drape_rung_residual(const drape_rung *s)
{
    double max = 0;
    for (size_t i = 0; i < s->dofs; i++)
        max = fabs(s->f[i]) > max ? fabs(s->f[i]) : max;
    return max;
}

bool drape_rung_fell(const drape_rung *s)
{
    return drape_rung_dot(s->f, s->f, s->dofs) < s->first;
}

void drape_rung_stay_free(drape_rung *s, const double *x, double *way)
{
    const drape_implicit *b = &s->base;
    if (!s->ahead)
        return;
    memcpy(s->ahead, x, s->nodes * sizeof *x);
    for (size_t i = 0; i < s->dofs; i++)
        s->ahead[drape_implicit_at(b, i)] += way[i];
    double share = drape_system_step_fraction(b->system, x, s->ahead, s->point.t);
    for (size_t i = 0; share < 1 && i < s->dofs; i++)
        way[i] *= share;
}

/* ---- A step ---- */

drape_status drape_rung_fail(drape_rung *s, drape_status status, const char *reason, drape_step_info *info)
{
    info->reason = reason;
    if (status == DRAPE_RETRY_NONFINITE) { /* an element that collapsed on the way is named before a node */
        drape_status degenerate =
            drape_system_check(s->base.system, s->x, NULL, s->point.internal, &info->reason, &info->worst);
        return degenerate ? degenerate : status;
    }
    return status;
}

drape_status drape_rung_begin(drape_rung *s, const drape_state *in, double end, double h,
                              double extrapolation, drape_step_info *info)
{
    drape_implicit *b = &s->base;
    drape_implicit_base(b, in, end, h);
    remember(s, in, end);
    guess(s, in, h, extrapolation);
    set_history(b, in, h);
    set_point(s, in, h);
    drape_rung_stay_free(s, s->x, b->d);
    if (!drape_rung_evaluate(s, b->d))
        return drape_rung_fail(s, DRAPE_RETRY_NONFINITE, "nonfinite", info);
    s->first = drape_rung_dot(s->f, s->f, s->dofs);
    return DRAPE_OK;
}

drape_status drape_rung_finish(drape_rung *s, drape_status status, const drape_state *in, drape_state *out,
                               double tolerance, drape_step_info *info)
{
    drape_system *system = s->base.system;
    info->residual = drape_rung_residual(s);
    info->tolerance = NAN; /* the residual is told, not promised */
    if (status != DRAPE_RETRY_DEGENERATE)
        info->worst = drape_system_worst_dof(system, s->f, "residual [N]", tolerance);
    if (!status)
        status = drape_system_status(system);
    if (status)
        return status;
    memcpy(out->x, s->x, s->nodes * sizeof *out->x);
    memcpy(out->v, s->v, s->nodes * sizeof *out->v);
    drape_implicit_audit_at(&s->base, &s->point, s->g, in, out, info);
    return DRAPE_OK;
}
