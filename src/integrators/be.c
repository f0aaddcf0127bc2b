/*
 * be: backward Euler, first order and L-stable. It damps oscillations that it cannot resolve: each step
 * multiplies an oscillator's energy by 1/(1 + (w h)^2). As in Baraff & Witkin 1998, but solved to a tolerance
 * instead of by one linear solve.
 *     u1 = (x1 - x0)/h,  M (u1 - u0)/s + g(x1, u1) = 0,  q' = (q(x1) - q(x0))/h
 * The velocity u1 is the mean of the step, and so that of its middle. From the middle of a step of size h_ to
 * that of this one it is s = (h_ + h)/2, and from a state whose velocity is that of its time, h/2: there u0 =
 * v0. At constant steps this is x1 - 2 x0 + x_ = -h^2 M^-1 g(x1, u1), the recurrence of backward Euler with
 * its damping and stability; but with s = h and u0 = v0 in the first step, as it is usually written, a fall
 * is ahead of itself by g h t/2. Here it is exact. A state has the velocity of its time, v1 = u1 + h/2 (u1 -
 * u0)/s; of nodes in contact, whose acceleration may be that of an impact, u1. With terms that have momenta,
 * s = h, u0 = v0 and v1 = u1.
 *
 * With d = x1 - x0:  M (d - h u0)/(h s) + g(x0 + d, d/h) = 0. What solves are measured by is half of d - h
 * u0, h^2 a/2 (q and C of nonlinear/stopping.h).
 */
#include "integrators/implicit.h"

enum { PARAM_ON_FAILURE = DRAPE_NEWTON_PARAM_COUNT, PARAM_COUNT };

static const drape_param params[PARAM_COUNT] = {DRAPE_NEWTON_PARAMS, [PARAM_ON_FAILURE] =
                                                                         DRAPE_ON_FAILURE_PARAM};

static drape_status create(drape_arena *arena, drape_system *system, const double *values, void **state)
{
    const drape_status status = drape_implicit_create(arena, system, values, state);
    if (!status)
        drape_newton_set_lenient(((drape_implicit *)*state)->newton, values[PARAM_ON_FAILURE] > 0);
    return status;
}

static drape_status step(void *state, const drape_state *in, drape_state *out, double h,
                         drape_step_info *info)
{
    return drape_implicit_euler(state, in, out, h, info);
}

const drape_integrator_ops drape_integrator_be = {
    .entry = {.name = "be",
              .summary = "backward Euler by Newton: fixed step, first order, L-stable",
              .reference = "Baraff & Witkin 1998, solved to a tolerance",
              DRAPE_PARAMS(params)},
    .order = 1,
    .create = create,
    .momenta = true,
    .step = step,
    .restart = drape_implicit_restart,
    .archive = drape_implicit_archive,
    DRAPE_IMPLICIT_OPS,
    .mean_velocities = true,
    .by_ranks = true,
};
