/*
 * trbdf2: a trapezoidal step to t0 + gamma h, then the backward differentiation formula of order 2 through
 * both its ends to t0 + h. gamma = 2 - sqrt(2) gives both stages the same matrix. Second order, A- and
 * L-stable, one step: it knows nothing of the past that a kink or a change of h could spoil. Bank et al.
 * 1985; Hosea & Shampine 1996. With w = 2/(gamma h), a1 = 1/(gamma (2 - gamma)), a0 = a1 - 1:
 *     xg = x0 + (v0 + vg)/w,         M w (vg - v0) + g0 + gg = 0
 *     x1 = a1 xg - a0 x0 + v1/w,     M w (v1 - a1 vg + a0 v0) + g1 = 0
 * As Newton problems, d = xg - x0 and p = 2 v0/w - M^-1 g0/w^2; d = v1/w and p = (a1 vg - a0 v0)/w.
 * Rates of measures are grad q . v.
 */
#include "integrators/implicit.h"

#include <string.h>

#define GAMMA 0.58578643762690495 /* 2 - sqrt(2) */
#define A1    1.20710678118654752 /* 1/(gamma (2 - gamma)) = (1 + sqrt(2))/2 */
#define A0    (A1 - 1)

typedef struct trbdf2_state {
    drape_implicit common; /* first */
    double *g0, *xg, *vg;  /* nodes */
} trbdf2_state;

static void destroy(void **state)
{
    trbdf2_state *s = *state;
    if (!s)
        return;
    drape_context *ctx = s->common.ctx;
    drape_free(ctx, s->g0);
    drape_free(ctx, s->xg);
    drape_free(ctx, s->vg);
    drape_implicit_free(&s->common);
    drape_free(ctx, s);
    *state = NULL;
}

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    drape_context *ctx = arena->ctx;
    trbdf2_state *s = drape_alloc(ctx, 1, sizeof *s);
    *state = s;
    if (!s)
        return DRAPE_E_MEMORY;
    drape_status status = drape_implicit_init(arena, system, values, &s->common);
    size_t nodes = 3 * (size_t)s->common.model->node_count;
    s->g0 = drape_alloc(ctx, nodes, sizeof(double));
    s->xg = drape_alloc(ctx, nodes, sizeof(double));
    s->vg = drape_alloc(ctx, nodes, sizeof(double));
    if (!status && (!s->g0 || !s->xg || !s->vg))
        status = DRAPE_E_MEMORY;
    if (status)
        destroy(state);
    return status;
}

/* Newton on the stage that stands in base and inertia, from d. */
static drape_status solve(trbdf2_state *s, const double *internal, double w, drape_step_info *info)
{
    drape_implicit *c = &s->common;
    const drape_newton_problem problem = {.x_base = c->x_base,
                                          .v_base = c->v_base,
                                          .x_start = c->x_start,
                                          .weight = w,
                                          .mass_weight = w * w,
                                          .inertia = c->inertia,
                                          .internal = internal,
                                          .t = c->t,
                                          .span = {c->span[0], c->span[1]}};
    int before = info->iterations;
    drape_status status = drape_newton_solve(c->newton, &problem, c->d, info);
    info->iterations += before;
    return status;
}

static void write_stage(trbdf2_state *s, double w, double *x, double *v)
{
    drape_implicit *c = &s->common;
    size_t nodes = 3 * (size_t)c->model->node_count;
    memcpy(x, c->x_base, nodes * sizeof *x);
    memcpy(v, c->v_base, nodes * sizeof *v);
    for (size_t i = 0; i < 3 * (size_t)c->model->free_count; i++) {
        x[drape_implicit_at(c, i)] += c->d[i];
        v[drape_implicit_at(c, i)] += w * c->d[i];
    }
}

/* Adds the work over a stage, by the midpoint rule with the mean velocity: of dissipative forces, and of the
 * forces that hold moved pins and colliders on their way. Powers at the ends would count what a stiff dashpot has at the
 * jump of a pin's velocity for a good part of the step. Bases and g0 serve as scratch. */
static void add_work(trbdf2_state *s, const double *from, const double *to, double t, double span,
                     const double *internal, drape_step_info *info)
{
    drape_implicit *c = &s->common;
    const drape_point point = {
        .x = c->x_base, .v = c->v_base, .internal = internal, .t = t + span / 2, .span = {t, t + span}};
    for (size_t i = 0; i < 3 * (size_t)c->model->node_count; i++) {
        c->x_base[i] = (from[i] + to[i]) / 2;
        c->v_base[i] = (to[i] - from[i]) / span;
    }
    if (c->motion->moved_count > 0 || c->model->collider_count > 0)
        drape_system_force(c->system, &point, s->g0);
    info->pin_work += drape_implicit_collider_work(c, t, t + span);
    for (int32_t i = 0; i < c->motion->moved_count; i++)
        for (size_t k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)c->motion->moved_node[i] + k;
            info->pin_work += s->g0[at] * (to[at] - from[at]);
        }
    if (!c->dissipated)
        return;
    drape_system_dissipation(c->system, &point, c->dissipated);
    for (size_t i = 0; i < 3 * (size_t)c->model->node_count; i++)
        info->dissipated += c->dissipated[i] * (to[i] - from[i]);
    info->dissipated += drape_implicit_collider_work(c, t, t + span);
}

/* g0, with the mean velocity of pins and colliders in the stage, into which they go. */
static void evaluate_start(trbdf2_state *s, const drape_state *in)
{
    drape_implicit *c = &s->common;
    memcpy(s->vg, c->v_base, 3 * (size_t)c->model->node_count * sizeof *s->vg);
    for (size_t i = 0; i < 3 * (size_t)c->model->free_count; i++)
        s->vg[drape_implicit_at(c, i)] = in->v[drape_implicit_at(c, i)];
    const drape_point point = {
        .x = in->x, .v = s->vg, .internal = in->internal, .t = in->t, .span = {c->span[0], c->span[1]}};
    drape_system_force(c->system, &point, s->g0);
}

/* To xg, vg. The guess is flight without g0, whose stiff part would throw it far off. */
static drape_status trapezoid(trbdf2_state *s, const drape_state *in, double h, double w,
                              drape_step_info *info)
{
    drape_implicit *c = &s->common;
    drape_implicit_base(c, in, in->t + GAMMA * h, GAMMA * h);
    evaluate_start(s, in);
    for (size_t i = 0; i < 3 * (size_t)c->model->free_count; i++) {
        size_t at = drape_implicit_at(c, i);
        double flight = 2 / w * in->v[at];
        c->v_base[at] = -in->v[at];
        c->inertia[i] = flight - s->g0[at] / (c->model->mass[at / 3] * w * w);
        c->d[i] = c->inertial_guess ? flight : 0;
    }
    drape_status status = solve(s, in->internal, w, info);
    if (status && !info->usable)
        return status;
    write_stage(s, w, s->xg, s->vg);
    add_work(s, in->x, s->xg, in->t, GAMMA * h, in->internal, info);
    return status;
}

/* To out. Pins take their velocity by the same formula: that of their track but for a kink inside. The guess
 * of predictor rest is d = 0: x1 from the two before without a velocity. */
static drape_status differentiate(trbdf2_state *s, const drape_state *in, double h, double w,
                                  drape_state *out, drape_step_info *info)
{
    drape_implicit *c = &s->common;
    drape_implicit_base(c, in, out->t, h);
    c->x_start = s->xg;
    for (int32_t i = 0; i < c->motion->moved_count; i++)
        for (size_t k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)c->motion->moved_node[i] + k;
            c->v_base[at] = w * (c->x_base[at] - s->xg[at] - A0 * (s->xg[at] - in->x[at]));
        }
    for (size_t i = 0; i < 3 * (size_t)c->model->free_count; i++) {
        size_t at = drape_implicit_at(c, i);
        c->x_base[at] = A1 * s->xg[at] - A0 * in->x[at];
        c->inertia[i] = (A1 * s->vg[at] - A0 * in->v[at]) / w;
        c->d[i] = c->inertial_guess ? c->inertia[i] : 0;
    }
    drape_status status = solve(s, in->internal, w, info);
    if (status && !info->usable)
        return status;
    write_stage(s, w, out->x, out->v);
    add_work(s, s->xg, out->x, in->t + GAMMA * h, (1 - GAMMA) * h, in->internal, info);
    return status;
}

/* Under on_failure accept an unconverged first stage is told where the second converges. */
static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    trbdf2_state *s = state;
    double w = 2 / (GAMMA * h);
    drape_status first = trapezoid(s, in, h, w, info);
    if (first && !info->usable)
        return first;
    const drape_step_info before = *info;
    drape_status second = differentiate(s, in, h, w, out, info);
    if (!first || second)
        return second;
    info->reason = before.reason;
    info->residual = before.residual;
    info->worst = before.worst;
    return first;
}

static size_t bytes(const void *state)
{
    const trbdf2_state *s = state;
    return drape_implicit_bytes(state) + 9 * (size_t)s->common.model->node_count * sizeof(double);
}

const drape_integrator_ops drape_integrator_trbdf2 = {
    .name = "trbdf2",
    .summary =
        "trapezoid, then backward differentiation, in one step by Newton: fixed step, second order, L-stable",
    .reference = "Bank et al. 1985; Hosea & Shampine 1996",
    .order = 2,
    .params = drape_newton_params,
    .param_count = DRAPE_NEWTON_PARAM_COUNT,
    .create = create,
    .step = step,
    .restart = drape_implicit_restart,
    .residual = drape_implicit_residual,
    .work = drape_implicit_work,
    .archive = drape_implicit_archive,
    .bytes = bytes,
    .destroy = destroy,
};
