/* fixed: every step has the nominal size; the first failed step ends the run. */
#include "control/control.h"

static drape_verdict judge(const double *values, drape_trial *trial)
{
    (void)values;
    trial->stop = trial->status > 0 ? DRAPE_E_SOLVER : trial->status;
    return drape_trial_failed(trial) ? DRAPE_STOP : DRAPE_ACCEPT;
}

const drape_controller_ops drape_controller_fixed = {
    .entry = {.name = "fixed",
              .summary = "steps of the nominal size only; a failed step ends the run with e_solver",
              .reference = "-"},
    .by_ranks = true,
    .judge = judge,
};
