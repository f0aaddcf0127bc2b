/*
 * bdf2: the backward differentiation formula of order 2 with variable steps. With r = h/h_before, a =
 * r^2/(1 + 2 r) and the weight w = (1 + 2 r)/(1 + r)/h:
 *     v1 = w (x1 - x0 - a (x0 - x_))
 *     M w (v1 - v0 - a (v0 - v_)) + g(x1, v1) = 0,  q' = w (q1 - q0 - a (q0 - q_))
 * where x_, v_, q_ belong to the state before the present one; momenta P as M v. With d = x1 - x0 and c = a
 * (x0 - x_):
 *     M w^2 (d - p) + g(x0 + d, w (d - c)) = 0,  p = c + (v0 + a (v0 - v_))/w
 * A- and L-stable at constant steps, zero-stable for r < 1 + sqrt(2), which halving and doubling satisfy.
 * Hairer, Norsett & Wanner 1993, III.5. The first step, the first one after a discontinuity, and those of
 * impacts are backward Euler.
 *
 * The local error, by Milne's device: with c = (1 + r)^2/(6 r (1 + 2 r)) the formula is off by c h^3 x''',
 * and x0 + h v0 + h^2/2 (v0 - v_)/h_before by -(1/6 + 1/(4 r)) h^3 x''', because the difference of velocities
 * is the acceleration half a step ago.
 */
#include "integrators/implicit.h"

#include <math.h>
#include <string.h>

/* The history that the formula needs: differences between a state and the one before it. */
typedef struct past {
    double t, h;          /* [s] time of the state; size of the step that led to it */
    double *dx, *dv, *dq; /* x0 - x_, v0 - v_ (nodes), q0 - q_ (measures) */
    double *dp;           /* P0 - P_ (nodes); NULL if no term has momenta */
    bool known;
} past;

typedef struct bdf2_state {
    drape_implicit common; /* first */
    past past, made;       /* of the last accepted state; of the state that the last attempt computed */
    double *expected;      /* free DOFs */
    double *q0;            /* measures */
} bdf2_state;

static void create_past(drape_arena *arena, const drape_implicit *common, past *p)
{
    const drape_step_equation *e = &common->equation;
    p->dx = drape_arena_take(arena, e->nodes, sizeof *p->dx);
    p->dv = drape_arena_take(arena, e->nodes, sizeof *p->dv);
    if (common->history)
        p->dq = drape_arena_take(arena, (size_t)e->model->measure_count, sizeof *p->dq);
    if (e->momentum)
        p->dp = drape_arena_take(arena, e->nodes, sizeof *p->dp);
}

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    bdf2_state *s = *state = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    drape_status status = drape_implicit_init_newton(arena, system, values, &s->common);
    if (s->common.history)
        s->q0 = drape_arena_take(arena, (size_t)s->common.equation.model->measure_count, sizeof *s->q0);
    s->expected = drape_arena_take(arena, s->common.equation.dofs, sizeof *s->expected);
    create_past(arena, &s->common, &s->past);
    create_past(arena, &s->common, &s->made);
    return status ? status : drape_arena_status(arena);
}

static void set_equation(bdf2_state *s, const drape_state *in, double a, double w)
{
    drape_implicit *c = &s->common;
    drape_step_equation *e = &c->equation;
    e->point.weight = w;
    e->mass_weight = w * w;
    for (size_t i = 0; i < e->dofs; i++) {
        size_t at = drape_step_equation_at(e, i);
        const double dx = a * s->past.dx[at], dv = a * s->past.dv[at];
        e->v_base[at] = -w * dx;
        e->inertia[i] = dx + (in->v[at] + dv) / w;
    }
    drape_implicit_momentum(c, in->t, in->x, in->v, c->momentum[0]);
    drape_implicit_set_momenta(c, w, 1, c->momentum[0], a, s->past.dp);
    e->point.history = c->history;
    if (!c->history)
        return;
    drape_implicit_measure(c, in->t, in->x, s->q0);
    for (int64_t i = 0; i < e->model->measure_count; i++)
        c->history[i] = -w * (s->q0[i] + a * s->past.dq[i]);
}

/* What the local error is measured by; r: h / h_before. */
static void expect(bdf2_state *s, const drape_state *in, double h, double r)
{
    drape_step_equation *e = &s->common.equation;
    e->expected = s->expected;
    const double c = (1 + r) * (1 + r) / (6 * r * (1 + 2 * r));
    e->error_share = c / (c + 1 / 6. + 1 / (4 * r));
    for (size_t i = 0; i < e->dofs; i++) {
        const size_t at = drape_step_equation_at(e, i);
        s->expected[i] = h * in->v[at] + h * h / 2 * s->past.dv[at] / s->past.h;
    }
    drape_implicit_carry(&s->common, in, h, s->past.dv, s->past.h);
}

/* What the next step needs if this one is accepted; q0 is known. */
static void record(bdf2_state *s, const drape_state *in, const drape_state *out, double h)
{
    const drape_implicit *c = &s->common;
    s->made.t = out->t;
    s->made.h = h;
    s->made.known = true;
    for (size_t i = 0; i < c->equation.nodes; i++) {
        s->made.dx[i] = out->x[i] - in->x[i];
        s->made.dv[i] = out->v[i] - in->v[i];
    }
    drape_implicit_momentum(c, out->t, out->x, out->v, c->momentum[1]);
    for (size_t i = 0; s->made.dp && i < c->equation.nodes; i++)
        s->made.dp[i] = c->momentum[1][i] - c->momentum[0][i];
    if (!c->history)
        return;
    drape_implicit_measure(c, out->t, out->x, s->made.dq);
    for (int64_t i = 0; i < c->equation.model->measure_count; i++)
        s->made.dq[i] -= s->q0[i];
}

/* By the formula, from a state with a past. *hits: something was hit, and the step is not made. */
static drape_status differentiate(bdf2_state *s, const drape_state *in, drape_state *out, double h,
                                  bool *hits, drape_step_info *info)
{
    drape_step_equation *e = &s->common.equation;
    const double r = h / s->past.h, a = r * r / (1 + 2 * r), w = (1 + 2 * r) / (1 + r) / h;
    drape_implicit_base(&s->common, in, out->t, h);
    e->point.instant = true;
    set_equation(s, in, a, w);
    expect(s, in, h, r);
    const drape_status status = drape_implicit_solve(&s->common, info);
    *hits = drape_implicit_hits(&s->common, in, h, status);
    if (status || *hits)
        return status;
    memcpy(out->x, e->x, e->nodes * sizeof *out->x);
    memcpy(out->v, e->v, e->nodes * sizeof *out->v);
    record(s, in, out, h);
    drape_implicit_audit_stage(&s->common, in->x, out->x, in->t, h, e->probe, info);
    return status;
}

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    bdf2_state *s = state;
    drape_status status = DRAPE_OK;
    /* The last attempt was accepted if the state that it computed is the one that this step starts from. */
    if (s->made.known && s->made.t == in->t) {
        past swap = s->past;
        s->past = s->made;
        s->made = swap;
    }
    s->made.known = false;
    s->past.known = s->past.known && s->past.t == in->t;
    bool euler = drape_implicit_follows_impact(&s->common, in) || !s->past.known;
    if (!euler)
        status = differentiate(s, in, out, h, &euler, info);
    if (!euler)
        return status;
    status = drape_implicit_euler(&s->common, in, out, h, info);
    if (!status && isnan(s->common.made_end)) {
        drape_implicit_measure(&s->common, in->t, in->x, s->q0);
        record(s, in, out, h);
    }
    return status;
}

static void restart(void *state, const drape_state *from)
{
    bdf2_state *s = state;
    s->past.known = s->made.known = false;
    drape_implicit_restart(state, from);
}

static void archive_past(const bdf2_state *s, past *p, drape_archive *a)
{
    const drape_step_equation *e = &s->common.equation;
    drape_archive_bool(a, &p->known);
    if (!p->known)
        return;
    drape_archive_double(a, &p->t);
    drape_archive_double(a, &p->h);
    drape_archive_doubles(a, p->dx, e->nodes);
    drape_archive_doubles(a, p->dv, e->nodes);
    if (p->dq)
        drape_archive_doubles(a, p->dq, (size_t)e->model->measure_count);
    if (p->dp)
        drape_archive_doubles(a, p->dp, e->nodes);
}

static void archive(void *state, drape_archive *a)
{
    bdf2_state *s = state;
    archive_past(s, &s->past, a);
    archive_past(s, &s->made, a);
    drape_implicit_archive(state, a);
}

const drape_integrator_ops drape_integrator_bdf2 = {
    .entry =
        {.name = "bdf2",
         .summary =
             "two-step backward differentiation by Newton: fixed step, second order, damps what h does not "
             "resolve",
         .reference = "Hairer, Norsett & Wanner 1993, Solving Ordinary Differential Equations I, III.5",
         DRAPE_PARAMS(drape_newton_params)},
    .order = 2,
    .create = create,
    .momenta = true,
    .step = step,
    .restart = restart,
    .archive = archive,
    DRAPE_IMPLICIT_OPS,
};
