/* halve.c: see halve.h. */
#include "control/halve.h"

const drape_param drape_dt_min_param = {.name = "dt_min",
                                        .unit = "s",
                                        .default_value = 1e-7,
                                        .min = 0,
                                        .max = 1e6,
                                        .open_min = true,
                                        .help = "no step is cut to less than this"};

drape_verdict drape_halve(double dt_min, drape_trial *trial)
{
    if (trial->status < 0)
        return DRAPE_STOP;
    trial->h_next = trial->h / 2;
    if (trial->h_next >= dt_min && trial->in->t + trial->h_next > trial->in->t)
        return DRAPE_RETRY;
    trial->status = DRAPE_E_STEP_TOO_SMALL;
    return DRAPE_STOP;
}
