/*
 * static: equilibrium, grad E(x) = 0 with the pins at their final positions. Newton's method stalls far
 * from the solution, so the solution is approached by pseudo-transient continuation (Kelley & Keyes 1998):
 * implicit Euler steps of the gradient flow M x' = -grad E in a pseudo time,
 *     m M d + grad E(x + d) = 0,   x <- x + d,
 * each of them a Newton solve. The weight m falls with the residual, and at least by half in each step, so
 * that the last steps are Newton steps; it stays where a step took many iterations and the residual has
 * hardly fallen. Nobody sees where these steps end, so each is solved to a part of the residual only. One
 * that fails, or ends in a degenerate element, is discarded and retried with a larger m. Damping and
 * velocities have no effect.
 *
 * The signs of D in K = L D L' show whether the equilibrium is stable: it is if none is negative. Of a load
 * without a potential K is not symmetric, and that is not known.
 */
#include "base/reason.h"
#include "integrators/implicit.h"
#include "solvers/inertia.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define MAX_FAILS  40   /* in a row */
#define MIN_FACTOR 0.02 /* of m from one step to the next */
/* the same, used also while the residual does not fall by as much: then the flow is far from its end, or
 * the residual may be rounding */
#define MAX_FACTOR  0.5
#define FAIL_FACTOR 4.0 /* of m after a failure */
/* Of the static residual, that a step may leave in its own equation; and the iterations after which m stays
 * if the static residual has not halved. 29 drawn sheets that have an equilibrium took 11738 iterations
 * with these, and 27286 with steps solved to the tolerance, m that always falls, and ten times m after a
 * failure. */
#define LEFT 0.1
#define MANY 16

enum { PARAM_ON_FAILURE = DRAPE_NEWTON_PARAM_COUNT, PARAM_MAX_STEPS, PARAM_COUNT };

static const drape_param params[PARAM_COUNT] = {
    DRAPE_NEWTON_PARAMS,
    [PARAM_ON_FAILURE] = DRAPE_ON_FAILURE_PARAM,
    [PARAM_MAX_STEPS] = DRAPE_INTEGER("max_pseudo_steps", "1", 1000, 1, 1e9,
                                      "steps of the flow towards equilibrium before the attempt fails"),
};

typedef struct static_state {
    drape_implicit common; /* first */
    drape_arena *arena;
    double *internal;               /* of the terms, at the present step in pseudo time */
    double *best_x, *best_internal; /* nodes; internal variables: the step with the least static residual */
    int max_steps;
    bool lenient; /* on_failure accept */
    double best;  /* [N] that residual */
    bool stability_known;
    int64_t unstable_modes;
} static_state;

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    static_state *s = *state = drape_arena_take(arena, 1, sizeof *s);
    const drape_model *m = drape_system_model(system);
    if (drape_ranks_agree_memory(drape_model_ranks(m), arena->ctx, s))
        return DRAPE_E_MEMORY;
    s->arena = arena;
    s->max_steps = (int)values[PARAM_MAX_STEPS];
    s->lenient = values[PARAM_ON_FAILURE] > 0;
    drape_status status = drape_implicit_init_newton(arena, system, values, &s->common);
    if (!status)
        drape_newton_set_lenient(s->common.newton, s->lenient);
    s->internal = drape_arena_take(arena, (size_t)m->internal_count, sizeof *s->internal);
    s->best_internal = drape_arena_take(arena, (size_t)m->internal_count, sizeof *s->best_internal);
    s->best_x = drape_arena_take(arena, 3 * (size_t)m->node_count, sizeof *s->best_x);
    return status ? status : drape_arena_status(arena);
}

static drape_norm norm_of(const static_state *s)
{
    return (drape_norm)drape_newton_values(s->common.newton)[DRAPE_NEWTON_NORM];
}

/* Makes one step in pseudo time from out->x, which changes only on success. tolerance: of its equation. */
static drape_status pseudo_step(static_state *s, double mass_weight, double tolerance, drape_state *out,
                                drape_step_info *info)
{
    drape_implicit *c = &s->common;
    drape_step_equation *e = &c->equation;
    const double last = drape_implicit_tolerance(s);
    /* colliders rest */
    e->point.internal = s->internal;
    e->point.weight = 0;
    e->point.relaxed = true;
    e->point.span[0] = e->point.t;
    e->mass_weight = mass_weight;
    e->x_start = NULL; /* corrections are too large for forces to first order in them */
    memcpy(e->x_base, out->x, e->nodes * sizeof *e->x_base);
    memset(e->v_base, 0, e->nodes * sizeof *e->v_base);
    memset(e->inertia, 0, e->dofs * sizeof *e->inertia);
    drape_newton_set_tolerance(c->newton, tolerance);
    drape_status status = drape_implicit_solve(c, info);
    drape_newton_set_tolerance(c->newton, last);
    if (!status)
        status = drape_system_check_contact(e->system, e->x, e->point.t, &info->reason, &info->diagnostic);
    if (!status)
        status = drape_system_check(e->system, e->x, out->x, s->internal, &info->reason, &info->diagnostic);
    if (status)
        return status;
    memcpy(out->x, e->x, e->nodes * sizeof *out->x);
    const drape_state from = {.x = out->x, .internal = s->internal};
    drape_state to = {.x = out->x, .internal = s->internal};
    drape_state_commit(e->model, &from, &to);
    return drape_system_begin(e->system, &(drape_state){.t = e->point.t, .x = out->x, .v = e->v_base});
}

/* The static residual: the norm of grad E on the free nodes where the equation was evaluated last, which
 * replaces F. */
static double static_residual(const static_state *s)
{
    const drape_step_equation *e = &s->common.equation;
    for (size_t i = 0; i < e->dofs; i++)
        e->f[i] = e->g[drape_step_equation_at(e, i)];
    return drape_step_equation_norm(e, norm_of(s));
}

/* Goes back to the best step and reports its residual. */
static void end_at_best(static_state *s, drape_state *out, double tolerance, drape_step_info *info)
{
    drape_step_equation *e = &s->common.equation;
    if (isfinite(s->best)) {
        memcpy(out->x, s->best_x, e->nodes * sizeof *out->x);
        memcpy(s->internal, s->best_internal, (size_t)e->model->internal_count * sizeof *s->internal);
    }
    const drape_point point = {
        .x = out->x, .v = e->v_base, .internal = s->internal, .relaxed = true, .t = e->point.t};
    drape_system_force(e->system, &point, e->g);
    info->residual = static_residual(s);
    info->diagnostic = drape_step_equation_diagnose(e, tolerance);
}

/* Follows the flow until the static residual is within the tolerance, or is the rounding error of its forces,
 * below which the flow only wanders. */
static drape_status follow(static_state *s, double mass_weight, drape_state *out, drape_step_info *info)
{
    const double tolerance = drape_implicit_tolerance(s);
    double last = NAN;
    int fails = 0;
    s->best = INFINITY;
    for (int k = 0; k < s->max_steps && fails < MAX_FAILS; k++) {
        const int before = info->iterations;
        drape_status status =
            pseudo_step(s, mass_weight, isnan(last) ? tolerance : fmax(tolerance, LEFT * last), out, info);
        if (status < 0)
            return status;
        if (status) {
            mass_weight *= FAIL_FACTOR;
            fails++;
            continue;
        }
        fails = 0;
        info->tolerance = tolerance;
        info->residual = static_residual(s);
        if (info->residual < s->best) {
            const drape_step_equation *e = &s->common.equation;
            s->best = info->residual;
            memcpy(s->best_x, out->x, e->nodes * sizeof *out->x);
            memcpy(s->best_internal, s->internal, (size_t)e->model->internal_count * sizeof *s->internal);
        }
        info->reason = DRAPE_REASON_CONVERGED;
        if (info->residual <= tolerance)
            return DRAPE_OK;
        const bool falls = isnan(last) || info->residual < MAX_FACTOR * last;
        const double rounding =
            falls ? 0 : drape_step_equation_rounding(&s->common.equation, s->common.d, norm_of(s));
        if (info->residual <= rounding && rounding > s->common.equation.max_residual)
            break; /* forces are too inexact here to tell an equilibrium, as of cloth that nothing holds */
        if (info->residual <= rounding) {
            end_at_best(s, out, rounding, info);
            info->reason = DRAPE_REASON_ROUNDING;
            info->tolerance = rounding;
            return DRAPE_OK;
        }
        if (!isnan(last) && (falls || info->iterations - before <= MANY))
            mass_weight *= fmin(MAX_FACTOR, fmax(MIN_FACTOR, info->residual / last));
        last = info->residual;
    }
    if (fails == 0)
        info->reason = DRAPE_REASON_STALLED;
    info->tolerance = tolerance;
    end_at_best(s, out, tolerance, info);
    return info->lenient && isfinite(s->best) ? DRAPE_RETRY_NONLINEAR : DRAPE_E_SOLVER;
}

static drape_status judge_stability(static_state *s, const drape_state *out)
{
    const drape_step_equation *e = &s->common.equation;
    const drape_point point = {
        .x = out->x, .v = e->v_base, .internal = s->internal, .relaxed = true, .t = e->point.t};
    const drape_pattern *pattern;
    const double *values;
    if (e->dofs == 0)
        return DRAPE_OK;
    drape_status status = drape_newton_matrix(s->common.newton, &point, 0, &pattern, &values);
    s->stability_known = false;
    if (!status && e->all_dofs > DRAPE_MOST_FACTORED) {
        drape_log(s->arena->ctx, DRAPE_LOG_INFO,
                  "static: whether the equilibrium is stable is not determined above %d unknowns",
                  DRAPE_MOST_FACTORED);
        return DRAPE_OK;
    }
    if (!status && drape_system_is_symmetric(e->system) &&
        drape_pattern_asymmetry(pattern, values) > sqrt(DBL_EPSILON))
        return DRAPE_OK; /* the signs of its pivots say nothing */
    return status ? status
                  : drape_inertia(s->arena->ctx, pattern, values, drape_system_cancel_flag(e->system),
                                  &s->unstable_modes, &s->stability_known);
}

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    static_state *s = state;
    const drape_step_equation *e = &s->common.equation;
    const size_t internal_bytes = (size_t)e->model->internal_count * sizeof *s->internal;
    const double *values = drape_newton_values(s->common.newton);
    const double dt = values[DRAPE_NEWTON_DT];
    info->h = h;
    info->lenient = s->lenient;
    drape_implicit_base(&s->common, in, out->t, 1);
    memcpy(out->x, e->x_base, e->nodes * sizeof *out->x);
    memset(out->v, 0, e->nodes * sizeof *out->v);
    memcpy(s->internal, in->internal, internal_bytes);
    drape_status status = follow(s, 1 / (dt * dt), out, info);
    info->usable = status > 0;
    if (status < 0)
        return status;
    memcpy(out->internal, s->internal, internal_bytes);
    info->committed = true;
    return status ? status : judge_stability(s, out);
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

const drape_integrator_ops drape_integrator_static = {
    .entry = {.name = "static",
              .summary =
                  "equilibrium by Newton with pseudo-transient continuation; reports whether it is stable",
              .reference = "Kelley & Keyes 1998, Convergence analysis of pseudo-transient continuation",
              DRAPE_PARAMS(params)},
    .order = 0,
    .create = create,
    .momenta = true,
    .own_steps = true,
    .steady_state = true,
    .by_ranks = true,
    .step = step,
    .restart = drape_implicit_restart,
    .tolerance = drape_implicit_tolerance,
    .work = work,
    .archive = archive,
    .bytes = drape_implicit_bytes,
    .destroy = drape_implicit_destroy,
};
