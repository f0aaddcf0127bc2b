/*
 * halving: a failed step is rolled back and retried at half the size. The schedule divides the nominal
 * interval dt into 2^level equal parts and raises the level with each retry, so that the parts always fill
 * the interval. It doubles the size again, by itself, after two accepted parts that end where one part of
 * twice the size would, unless the last one took many iterations (drape_schedule_accept in sim/schedule.c).
 * The run ends if the size falls below dt_min or a step no longer changes the time.
 */
#include "control/halve.h"

enum { PARAM_DT_MIN, PARAM_COUNT };

static const drape_param params[PARAM_COUNT] = {
    [PARAM_DT_MIN] = DRAPE_DT_MIN_PARAM,
};

static drape_verdict judge(const double *values, drape_trial *trial)
{
    return drape_trial_failed(trial) ? drape_halve(values[PARAM_DT_MIN], trial) : DRAPE_ACCEPT;
}

const drape_controller_ops drape_controller_halving = {
    .entry =
        {.name = "halving",
         .summary =
             "a failed step is rolled back and retried at half the size; the size grows back after successes",
         .reference = "DisMech halves steps that do not converge, too",
         DRAPE_PARAMS(params)},
    .by_ranks = true,
    .max_attempts = 10000,
    .judge = judge,
};
