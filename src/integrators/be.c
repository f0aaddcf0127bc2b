/*
 * be: backward Euler, first order and L-stable. It damps what it cannot resolve, an oscillator's energy by
 * the factor 1/(1 + (w h)^2) a step. Baraff & Witkin 1998, solved to a tolerance and not by one linear solve.
 *     v1 = (x1 - x0)/h,  M (v1 - v0)/h + g(x1, v1) = 0,  q' = (q(x1) - q(x0))/h
 * With d = x1 - x0:  M (d - h v0)/h^2 + g(x0 + d, d/h) = 0.
 */
#include "integrators/implicit.h"

#include <string.h>

static void set_history(drape_implicit *s, const drape_state *in, double h)
{
    drape_implicit_measure(s, in, s->history);
    for (int64_t i = 0; s->history && i < s->model->measure_count; i++)
        s->history[i] /= -h;
}

static void write_state(const drape_implicit *s, double h, drape_state *out)
{
    size_t nodes = 3 * (size_t)s->model->node_count;
    memcpy(out->x, s->x_base, nodes * sizeof *out->x);
    memcpy(out->v, s->v_base, nodes * sizeof *out->v);
    for (size_t i = 0; i < 3 * (size_t)s->model->free_count; i++) {
        out->x[drape_implicit_at(s, i)] += s->d[i];
        out->v[drape_implicit_at(s, i)] = s->d[i] / h;
    }
}

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    drape_implicit *s = state;
    drape_implicit_base(s, in, out->t, h);
    for (size_t i = 0; i < 3 * (size_t)s->model->free_count; i++)
        s->inertia[i] = h * in->v[drape_implicit_at(s, i)];
    set_history(s, in, h);
    drape_status status = drape_implicit_solve(s, in->internal, s->history, 1 / h, 1 / (h * h), info);
    if (status && !info->usable)
        return status;
    write_state(s, h, out);
    drape_implicit_audit(s, in, out, info);
    return status;
}

const drape_integrator_ops drape_integrator_be = {
    .entry = {.name = "be",
              .summary = "backward Euler by Newton: fixed step, first order, L-stable",
              .reference = "Baraff & Witkin 1998, solved to a tolerance",
              DRAPE_PARAMS(drape_newton_params)},
    .order = 1,
    .create = drape_implicit_create,
    .step = step,
    .restart = drape_implicit_restart,
    .residual = drape_implicit_residual,
    .work = drape_implicit_work,
    .archive = drape_implicit_archive,
    .bytes = drape_implicit_bytes,
    .destroy = drape_implicit_destroy,
};
