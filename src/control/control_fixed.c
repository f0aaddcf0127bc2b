/* fixed: every step has the nominal size; the first that fails ends the run. */
#include "control/control.h"

static drape_verdict judge(const double *values, double t, double h, const drape_step_info *info,
                           drape_status *status)
{
    (void)values, (void)t, (void)h;
    if (*status == DRAPE_OK || info->usable)
        return DRAPE_ACCEPT;
    if (*status > 0)
        *status = DRAPE_E_SOLVER;
    return DRAPE_STOP;
}

const drape_controller_ops drape_controller_fixed = {
    .name = "fixed",
    .summary = "steps of the nominal size only; a failed step ends the run with e_solver",
    .reference = "-",
    .judge = judge,
};
