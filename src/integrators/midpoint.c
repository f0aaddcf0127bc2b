/*
 * midpoint: the implicit midpoint rule, the second-order Gauss method: symplectic; it conserves linear and
 * angular momentum and damps nothing. Hairer, Lubich & Wanner 2006, II.1.3.
 *     xm = (x0 + x1)/2,  vm = (x1 - x0)/h,  M (v1 - v0)/h + g(xm, vm) = 0,  v1 = 2 vm - v0
 * With d = xm - x0:  4 M/h^2 (d - h v0/2) + g(x0 + d, 2 d/h) = 0.
 *
 * Rates of measures are grad q(xm) . vm. That is of second order, and it is exactly zero for rigid motion:
 * if x1 is x0 rotated by an angle a, vm is the rigid velocity field (2/h) tan(a/2) k x xm at xm. The
 * difference of q between x0 and xm would be the rate a quarter of a step too early.
 *
 * Stiff waves that h does not resolve oscillate undamped: for scenes with these use bdf2 or ida.
 */
#include "integrators/implicit.h"

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    drape_implicit *s = state;
    drape_step_equation *e = &s->equation;
    if (drape_implicit_follows_impact(s, in))
        return drape_implicit_euler(s, in, out, h, info);
    drape_implicit_base(s, in, in->t + h / 2, h / 2);
    e->point.instant = true;
    e->point.weight = 2 / h;
    e->mass_weight = 4 / (h * h);
    for (size_t i = 0; i < e->dofs; i++)
        e->inertia[i] = h / 2 * in->v[drape_step_equation_at(e, i)];
    drape_status status = drape_implicit_solve(s, info);
    if (drape_implicit_hits(s, in, h, status))
        return drape_implicit_euler(s, in, out, h, info);
    info->error *= 2; /* d is that to the middle of the step */
    if (status)
        return status;
    /* x1 = x0 + 2 d and v1 = 2 vm - v0; pinned nodes at the end of the step, with their mean velocity in
     * it. */
    drape_implicit_place(s, in, out->t, h, out->x, out->v);
    for (size_t i = 0; i < e->dofs; i++) {
        size_t at = drape_step_equation_at(e, i);
        out->x[at] += 2 * s->d[i];
        out->v[at] = 4 * s->d[i] / h - in->v[at];
    }
    drape_implicit_audit(s, in, out, info);
    return status;
}

const drape_integrator_ops drape_integrator_midpoint = {
    .entry = {.name = "midpoint",
              .summary = "implicit midpoint by Newton: fixed step, second order, no damping of its own",
              .reference = "Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, II.1.3",
              DRAPE_PARAMS(drape_newton_params)},
    .order = 2,
    .conservative = true,
    .create = drape_implicit_create,
    .step = step,
    .restart = drape_implicit_restart,
    .archive = drape_implicit_archive,
    DRAPE_IMPLICIT_OPS,
};
