/* halve.c: see halve.h. */
#include "control/halve.h"

drape_verdict drape_halve(double dt_min, drape_trial *trial)
{
    if (trial->status < 0)
        return DRAPE_STOP;
    const bool advised = trial->info->retry > 0;
    trial->h_next = advised ? trial->info->retry : trial->h / 2;
    if ((advised || trial->h_next >= dt_min) && trial->in->t + trial->h_next > trial->in->t)
        return DRAPE_RETRY;
    trial->status = DRAPE_E_STEP_TOO_SMALL;
    return DRAPE_STOP;
}
