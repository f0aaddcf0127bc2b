/*
 * trbdf2: a trapezoidal step to t0 + gamma h, then a step to t0 + h by the backward differentiation formula
 * of order 2 through both ends of the first. With gamma = 2 - sqrt(2) both stages have the same matrix.
 * Second order, A- and L-stable, one-step: it has no history that a kink or a change of h could spoil. Bank
 * et al. 1985; Hosea & Shampine 1996. With w = 2/(gamma h), a1 = 1/(gamma (2 - gamma)), a0 = a1 - 1:
 *     xg = x0 + (v0 + vg)/w,         M w (vg - v0) + g0 + gg = 0
 *     x1 = a1 xg - a0 x0 + v1/w,     M w (v1 - a1 vg + a0 v0) + g1 = 0
 * As Newton problems: d = xg - x0 and p = 2 v0/w - M^-1 g0/w^2; d = v1/w and p = (a1 vg - a0 v0)/w. Rates
 * of measures are grad q . v; momenta P as M v.
 */
#include "integrators/implicit.h"

#include <math.h>
#include <string.h>

#define GAMMA (2 - sqrt(2))
#define A1    ((1 + sqrt(2)) / 2) /* 1/(gamma (2 - gamma)) */
#define A0    (A1 - 1)

typedef struct trbdf2_state {
    drape_implicit common; /* first */
    double *g0, *xg, *vg;  /* nodes */
    bool hits;             /* something is hit in the stage that was solved last */
    double *p0;            /* nodes: the momenta at the beginning of the step; NULL if no term has any */
} trbdf2_state;

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    trbdf2_state *s = *state = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    drape_status status = drape_implicit_init_newton(arena, system, values, &s->common);
    size_t nodes = s->common.equation.nodes;
    s->g0 = drape_arena_take(arena, nodes, sizeof *s->g0);
    s->xg = drape_arena_take(arena, nodes, sizeof *s->xg);
    s->vg = drape_arena_take(arena, nodes, sizeof *s->vg);
    if (s->common.equation.momentum)
        s->p0 = drape_arena_take(arena, nodes, sizeof *s->p0);
    return status ? status : drape_arena_status(arena);
}

/* Solves for the end x, v of a stage, whose base, inertia, momenta and guess must be set. */
static drape_status solve_stage(trbdf2_state *s, const drape_state *in, double w, double *x, double *v,
                                drape_step_info *info)
{
    drape_step_equation *e = &s->common.equation;
    e->point.weight = w;
    e->mass_weight = w * w;
    const drape_status status = drape_implicit_solve_from(&s->common, info);
    s->hits = drape_implicit_hits(&s->common, in, 2 / (GAMMA * w), status);
    if (status)
        return status;
    memcpy(x, e->x, e->nodes * sizeof *x);
    memcpy(v, e->v, e->nodes * sizeof *v);
    return DRAPE_OK;
}

/* The first stage, to xg, vg. The guess is free flight without g0, whose stiff part would make it far too
 * long. */
static drape_status trapezoid(trbdf2_state *s, const drape_state *in, double h, double w,
                              drape_step_info *info)
{
    drape_implicit *c = &s->common;
    drape_step_equation *e = &c->equation;
    drape_implicit_base(c, in, in->t + GAMMA * h, GAMMA * h);
    e->point.instant = true;
    /* g0, with the mean velocities of pins and colliders in the stage. */
    memcpy(s->vg, e->v_base, e->nodes * sizeof *s->vg);
    drape_implicit_force_at_start(c, in, s->vg, s->g0);
    for (size_t i = 0; i < e->dofs; i++) {
        size_t at = drape_step_equation_at(e, i);
        double flight = 2 / w * in->v[at];
        e->v_base[at] = -in->v[at];
        e->inertia[i] = flight - s->g0[at] / (e->model->mass[at / 3] * w * w);
        c->d[i] = flight;
    }
    drape_implicit_momentum(c, in->t, in->x, in->v, s->p0);
    drape_implicit_set_momenta(c, w, 1, s->p0, 0, NULL);
    drape_status status = solve_stage(s, in, w, s->xg, s->vg, info);
    if (s->p0)
        memcpy(c->momentum[0], s->p0, e->nodes * sizeof *s->p0);
    drape_implicit_momentum(c, e->point.t, s->xg, s->vg, c->momentum[1]);
    if (!status)
        drape_implicit_audit_stage(c, in->x, s->xg, in->t, GAMMA * h, s->g0, info);
    return status;
}

/* The second stage, to out. Pins get their velocity from the same formula, which is that of their track
 * unless there is a kink in the step. */
static drape_status differentiate(trbdf2_state *s, const drape_state *in, double h, double w,
                                  drape_state *out, drape_step_info *info)
{
    drape_implicit *c = &s->common;
    drape_step_equation *e = &c->equation;
    drape_implicit_base(c, in, out->t, h);
    e->x_start = s->xg;
    for (int32_t i = 0; i < c->motion->moved_count; i++)
        for (size_t k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)c->motion->moved_node[i] + k;
            e->v_base[at] = w * (e->x_base[at] - s->xg[at] - A0 * (s->xg[at] - in->x[at]));
        }
    for (size_t i = 0; i < e->dofs; i++) {
        size_t at = drape_step_equation_at(e, i);
        e->x_base[at] = A1 * s->xg[at] - A0 * in->x[at];
        e->inertia[i] = (A1 * s->vg[at] - A0 * in->v[at]) / w;
        c->d[i] = e->inertia[i];
    }
    if (s->p0)
        memcpy(c->momentum[0], c->momentum[1], e->nodes * sizeof *s->p0);
    drape_implicit_set_momenta(c, w, A1, c->momentum[0], -A0, s->p0);
    drape_status status = solve_stage(s, in, w, out->x, out->v, info);
    drape_implicit_momentum(c, out->t, out->x, out->v, c->momentum[1]);
    if (!status)
        drape_implicit_audit_stage(c, s->xg, out->x, in->t + GAMMA * h, (1 - GAMMA) * h, s->g0, info);
    return status;
}

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    trbdf2_state *s = state;
    drape_implicit *c = &s->common;
    const double w = 2 / (GAMMA * h);
    const drape_step_info before = *info;
    s->hits = drape_implicit_follows_impact(c, in);
    drape_status status = DRAPE_OK;
    if (!s->hits)
        status = trapezoid(s, in, h, w, info);
    if (!s->hits && !status)
        status = differentiate(s, in, h, w, out, info);
    if (!s->hits)
        return status;
    drape_system_begin_work(c->equation.system);
    info->dissipated = before.dissipated;
    return drape_implicit_euler(c, in, out, h, info);
}

const drape_integrator_ops drape_integrator_trbdf2 = {
    .entry = {.name = "trbdf2",
              .summary = "trapezoid, then backward differentiation, in one step by Newton: fixed step, "
                         "second order, L-stable",
              .reference = "Bank et al. 1985; Hosea & Shampine 1996",
              DRAPE_PARAMS(drape_newton_params)},
    .order = 2,
    .create = create,
    .momenta = true,
    .step = step,
    .restart = drape_implicit_restart,
    .archive = drape_implicit_archive,
    DRAPE_IMPLICIT_OPS,
};
