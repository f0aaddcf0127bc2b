/* fixed: every step has the nominal size; the first failed step ends the run. */
#include "control/control.h"

static drape_verdict judge(const double *values, drape_trial *trial)
{
    (void)values;
    if (trial->status == DRAPE_OK || trial->info->usable)
        return DRAPE_ACCEPT;
    if (trial->status > 0)
        trial->status = DRAPE_E_SOLVER;
    return DRAPE_STOP;
}

const drape_controller_ops drape_controller_fixed = {
    .entry = {.name = "fixed",
              .summary = "steps of the nominal size only; a failed step ends the run with e_solver",
              .reference = "-"},
    .by_ranks = true,
    .judge = judge,
};
