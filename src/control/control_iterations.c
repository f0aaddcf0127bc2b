/*
 * iterations: chooses the step by the number of Newton iterations that it takes, as incremental analyses of
 * structures do. A step of buckling or colliding cloth takes about as many iterations as two of half the
 * size: then the smaller ones are more accurate at about the same cost. Where cloth moves freely, half the
 * step takes hardly fewer iterations, and steps stay as large as the nominal one.
 */
#include "control/halve.h"

#include <math.h>

enum { PARAM_DT_MIN, PARAM_MAX_ATTEMPTS, PARAM_MOST, PARAM_LEAST, PARAM_SUBSTEPS, PARAM_COUNT };

static const drape_param params[PARAM_COUNT] = {
    [PARAM_DT_MIN] = DRAPE_DT_MIN_PARAM,
    [PARAM_MAX_ATTEMPTS] = DRAPE_MAX_ATTEMPTS_PARAM(10000),
    [PARAM_MOST] = DRAPE_INTEGER("most_iterations", "1", 8, 1, 1e6,
                                 "the step after one that took more iterations has half its size"),
    [PARAM_LEAST] = DRAPE_INTEGER("least_iterations", "1", 3, 0, 1e6,
                                  "the step after one that took fewer iterations has twice its size"),
    [PARAM_SUBSTEPS] =
        DRAPE_INTEGER("max_substeps", "1", 4, 1, 1e6,
                      "largest number of steps in one dt, except where a step has to be repeated"),
};

/* A step that was cut short by the end of an advance says nothing about a step larger than itself. */
static double next_size(const double *values, const drape_trial *trial)
{
    const double least = trial->dt / values[PARAM_SUBSTEPS];
    if (trial->info->iterations > values[PARAM_MOST])
        return fmin(trial->h, fmax(trial->h / 2, least));
    if (trial->info->iterations < values[PARAM_LEAST])
        return fmin(2 * trial->h, trial->dt);
    return trial->h;
}

static drape_status check(drape_context *ctx, const double *values)
{
    if (values[PARAM_LEAST] <= values[PARAM_MOST])
        return DRAPE_OK;
    return drape_fail_at(
        ctx, DRAPE_E_ARGUMENT, "/controller/least_iterations",
        "%g is above most_iterations, %g: steps would be halved and doubled in turn; it is at "
        "most that",
        values[PARAM_LEAST], values[PARAM_MOST]);
}

static drape_verdict judge(const double *values, drape_trial *trial)
{
    if (trial->status && !trial->info->usable)
        return drape_halve(values[PARAM_DT_MIN], trial);
    trial->h_next = next_size(values, trial);
    return DRAPE_ACCEPT;
}

const drape_controller_ops drape_controller_iterations = {
    .entry = {.name = "iterations",
              .summary =
                  "smaller steps where Newton's method takes many iterations, which cost no more there; "
                  "failed steps are halved",
              .reference = "Crisfield 1991, 9.5: increments by the number of iterations",
              DRAPE_PARAMS(params)},
    .own_steps = true,
    .by_ranks = true,
    .check = check,
    .judge = judge,
};
