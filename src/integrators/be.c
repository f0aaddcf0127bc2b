/*
 * be: backward Euler, first order and L-stable. It damps oscillations that it cannot resolve: each step
 * multiplies an oscillator's energy by 1/(1 + (w h)^2). As in Baraff & Witkin 1998, but solved to a tolerance
 * instead of by one linear solve.
 *     v1 = (x1 - x0)/h,  M (v1 - v0)/h + g(x1, v1) = 0,  q' = (q(x1) - q(x0))/h
 * With d = x1 - x0:  M (d - h v0)/h^2 + g(x0 + d, d/h) = 0. The local error is h^2 a/2, half of d - h v0:
 * that is q and C of nonlinear/stopping.h.
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
