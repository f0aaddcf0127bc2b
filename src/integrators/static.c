/*
 * static: equilibrium, grad E(x) = 0 with the pins where they are at the end. Newton on that stalls far
 * away, so it is led there by pseudo-transient continuation (Kelley & Keyes 1998): implicit Euler steps of
 * the gradient flow M x' = -grad E in a pseudo time,
 *     m M d + grad E(x + d) = 0,   x <- x + d,
 * each a Newton solve, with a weight m that falls with the residual and by half at least, so that the last
 * ones are Newton's own. A solve that fails, or that ends in a degenerate element, is forgotten and tried
 * with a larger m. Damping and velocities have no part.
 *
 * Whether the equilibrium is stable is told by the signs of D in K = L D L': it is where none is negative.
 */
#include "integrators/implicit.h"
#include "solvers/inertia.h"

#include <math.h>
#include <string.h>

#define MOST_STEPS 1000 /* of pseudo time */
#define MOST_FAILS 40   /* in a row */
#define LEAST_FALL 0.02 /* m falls by no more than this in one step */
#define FALL       0.5 /* and by at least this: where the residual does not fall yet, the flow has far to go */
#define FAIL_RISE  10.0 /* m rises by this after a failure */

typedef struct static_state {
    drape_implicit common; /* first */
    double *internal;      /* of the terms, along the way */
    bool stability_known;
    int64_t unstable_modes;
} static_state;

static void destroy(void **state)
{
    static_state *s = *state;
    if (!s)
        return;
    drape_context *ctx = s->common.ctx;
    drape_implicit_free(&s->common);
    drape_free(ctx, s->internal);
    drape_free(ctx, s);
    *state = NULL;
}

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    drape_context *ctx = arena->ctx;
    static_state *s = drape_alloc(ctx, 1, sizeof *s);
    *state = s;
    if (!s)
        return DRAPE_E_MEMORY;
    drape_status status = drape_implicit_init(arena, system, values, &s->common);
    const drape_model *m = drape_system_model(system);
    if (!status) {
        s->internal = drape_alloc(ctx, (size_t)m->internal_count, sizeof *s->internal);
        if (!s->internal)
            status = DRAPE_E_MEMORY;
    }
    if (status)
        destroy(state);
    return status;
}

/* The residual of statics: grad E on the free nodes, in the largest component, at the last point of
 * Newton. */
static double static_residual(const static_state *s)
{
    const double *g = drape_newton_force(s->common.newton);
    double max = 0;
    for (size_t i = 0; i < 3 * (size_t)s->common.model->free_count; i++)
        max = fmax(max, fabs(g[drape_implicit_at(&s->common, i)]));
    return max;
}

/* One step of pseudo time from out->x, which moves on success. */
static drape_status pseudo_step(static_state *s, double weight, drape_state *out, drape_step_info *info)
{
    drape_implicit *c = &s->common;
    int before = info->iterations;
    memcpy(c->x_base, out->x, 3 * (size_t)c->model->node_count * sizeof *c->x_base);
    memset(c->inertia, 0, 3 * (size_t)c->model->free_count * sizeof *c->inertia);
    drape_status status = drape_implicit_solve(c, s->internal, NULL, 0, weight, info);
    info->iterations += before;
    if (status)
        return status;
    for (size_t i = 0; i < 3 * (size_t)c->model->free_count; i++)
        c->x_base[drape_implicit_at(c, i)] += c->d[i];
    status = drape_system_check_contact(c->system, c->x_base, c->t, &info->reason, &info->worst);
    if (!status)
        status = drape_system_check(c->system, c->x_base, out->x, s->internal, &info->reason, &info->worst);
    if (status)
        return status;
    memcpy(out->x, c->x_base, 3 * (size_t)c->model->node_count * sizeof *out->x);
    const drape_state from = {.x = out->x, .internal = s->internal};
    drape_state to = {.x = out->x, .internal = s->internal};
    drape_state_commit(c->model, &from, &to);
    return drape_system_begin(c->system, &(drape_state){.t = c->t, .x = out->x, .v = c->v_base});
}

/* After a failure: the residual of statics where the flow has come, not that of the pseudo step that
 * failed. x_base serves as scratch. */
static void say_residual(static_state *s, const drape_state *out, double tolerance, drape_step_info *info)
{
    drape_implicit *c = &s->common;
    const drape_point point = {.x = out->x, .v = c->v_base, .internal = s->internal, .t = c->t};
    drape_system_force(c->system, &point, c->x_base);
    for (size_t i = 0; i < 3 * (size_t)c->model->free_count; i++)
        c->d[i] = c->x_base[drape_implicit_at(c, i)];
    info->worst = drape_system_worst_dof(c->system, c->d, "residual [N]", tolerance);
    info->residual = info->worst.value;
}

/* Follows the flow until the residual of statics is within the tolerance. */
static drape_status follow(static_state *s, double weight, double tolerance, drape_state *out,
                           drape_step_info *info)
{
    double last = NAN;
    int fails = 0;
    for (int k = 0; k < MOST_STEPS && fails < MOST_FAILS; k++) {
        drape_status status = pseudo_step(s, weight, out, info);
        if (status < 0)
            return status;
        if (status) {
            weight *= FAIL_RISE;
            fails++;
            continue;
        }
        fails = 0;
        info->residual = static_residual(s);
        if (info->residual <= tolerance)
            return DRAPE_OK;
        if (!isnan(last))
            weight *= fmin(FALL, fmax(LEAST_FALL, info->residual / last));
        last = info->residual;
    }
    if (fails == 0)
        info->reason = "stalled";
    say_residual(s, out, tolerance, info);
    return DRAPE_E_SOLVER;
}

static drape_status judge_stability(static_state *s, const drape_state *out)
{
    const drape_point point = {.x = out->x, .v = s->common.v_base, .internal = s->internal, .t = s->common.t};
    const drape_pattern *pattern;
    const double *values;
    if (s->common.model->free_count == 0)
        return DRAPE_OK;
    drape_status status = drape_newton_matrix(s->common.newton, &point, 0, &pattern, &values);
    return status ? status
                  : drape_inertia(s->common.ctx, pattern, values, &s->unstable_modes, &s->stability_known);
}

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    static_state *s = state;
    size_t nodes = 3 * (size_t)s->common.model->node_count;
    const double *values = drape_newton_values(s->common.newton);
    double dt = values[DRAPE_NEWTON_DT], tolerance = values[DRAPE_NEWTON_TOLERANCE];
    info->h = h;
    drape_implicit_base(&s->common, in, out->t, 1);
    s->common.x_start = NULL;        /* corrections are too large for forces to first order in them */
    s->common.span[0] = s->common.t; /* colliders rest */
    memset(s->common.v_base, 0, nodes * sizeof *s->common.v_base);
    memcpy(out->x, s->common.x_base, nodes * sizeof *out->x);
    memset(out->v, 0, nodes * sizeof *out->v);
    memcpy(s->internal, in->internal, (size_t)s->common.model->internal_count * sizeof *s->internal);
    drape_status status = follow(s, 1 / (dt * dt), tolerance, out, info);
    info->tolerance = tolerance;
    info->usable = false;
    if (status)
        return status;
    memcpy(out->internal, s->internal, (size_t)s->common.model->internal_count * sizeof *s->internal);
    info->committed = true;
    info->reason = "converged";
    return judge_stability(s, out);
}

static drape_work work(const void *state)
{
    const static_state *s = state;
    drape_work work = drape_implicit_work(state);
    work.stability_known = s->stability_known;
    work.unstable_modes = s->unstable_modes;
    return work;
}

static void archive(void *state, drape_archive *a)
{
    static_state *s = state;
    drape_archive_bool(a, &s->stability_known);
    drape_archive_int64(a, &s->unstable_modes);
    drape_implicit_archive(state, a);
}

static size_t bytes(const void *state)
{
    const static_state *s = state;
    return drape_implicit_bytes(state) + (size_t)s->common.model->internal_count * sizeof(double);
}

const drape_integrator_ops drape_integrator_static = {
    .name = "static",
    .summary = "equilibrium by Newton with pseudo-transient continuation; says whether it is stable",
    .reference = "Kelley & Keyes 1998, Convergence analysis of pseudo-transient continuation",
    .order = 0,
    .params = drape_newton_params,
    .param_count = DRAPE_NEWTON_PARAM_COUNT,
    .create = create,
    .own_steps = true,
    .timeless = true,
    .step = step,
    .restart = drape_implicit_restart,
    .work = work,
    .archive = archive,
    .bytes = bytes,
    .destroy = destroy,
};
