/*
 * halving: a failed step is forgotten and tried at half its size, so that the halves fill the same nominal
 * interval; after two equal steps that end where a step of twice the size would, that size is tried again.
 * Below dt_min, or where a step no longer moves the time, the run ends.
 */
#include "control/control.h"

enum { PARAM_DT_MIN, PARAM_COUNT };

static const drape_param params[PARAM_COUNT] = {
    [PARAM_DT_MIN] = {.name = "dt_min",
                      .unit = "s",
                      .default_value = 1e-7,
                      .min = 0,
                      .max = 1e6,
                      .open_min = true,
                      .help = "steps are not halved below this"},
};

static drape_verdict judge(const double *values, double t, double h, const drape_step_info *info,
                           drape_status *status)
{
    if (*status == DRAPE_OK || info->usable)
        return DRAPE_ACCEPT;
    if (*status < 0)
        return DRAPE_STOP;
    if (h / 2 >= values[PARAM_DT_MIN] && t + h / 2 > t)
        return DRAPE_HALVE;
    *status = DRAPE_E_STEP_TOO_SMALL;
    return DRAPE_STOP;
}

const drape_controller_ops drape_controller_halving = {
    .name = "halving",
    .summary = "a failed step is rolled back and halved; the size grows back after successes",
    .reference = "as DisMech halves unconverged steps, with rollback and filled intervals",
    .params = params,
    .param_count = PARAM_COUNT,
    .judge = judge,
};
