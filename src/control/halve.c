/* halve.c: see halve.h. */
#include "control/halve.h"

drape_verdict drape_halve(double dt_min, drape_trial *trial)
{
    trial->stop = trial->status < 0 ? trial->status : DRAPE_E_STEP_TOO_SMALL;
    if (trial->status < 0)
        return DRAPE_STOP;
    const bool advised = trial->info->retry > 0;
    trial->h_next = advised ? trial->info->retry : trial->h / 2;
    const bool possible = (advised || trial->h_next >= dt_min) && trial->in->t + trial->h_next > trial->in->t;
    return possible ? DRAPE_RETRY : DRAPE_STOP;
}
