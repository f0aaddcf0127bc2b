/* halve.h: what controllers share: dt_min, max_attempts, and the rule that a step is halved until it is too
 * small. */
#ifndef DRAPE_CONTROL_HALVE_H
#define DRAPE_CONTROL_HALVE_H

#include "control/control.h"

#define DRAPE_DT_MIN_PARAM                                                                                   \
    {                                                                                                        \
        .name = "dt_min", .unit = "s", .default_value = 1e-7, .min = 0, .max = 1e6, .open_min = true,        \
        .help = "no step is cut to less than this"                                                           \
    }

/* The driver counts and stops (sim/step.c): attempts that are all accepted may be too many as well. */
#define DRAPE_MAX_ATTEMPTS_PARAM(usual)                                                                      \
    {                                                                                                        \
        .name = "max_attempts", .kind = DRAPE_PARAM_INTEGER, .unit = "1", .default_value = (usual),          \
        .min = 1, .max = 1e9, .help = "steps tried, accepted or not, within one dt; one more ends the run"   \
    }

/* The attempt failed, or was refused with a status > 0: half of it next, or DRAPE_E_STEP_TOO_SMALL where
 * that is below dt_min or no longer moves the time. A negative status stops as it is. */
drape_verdict drape_halve(double dt_min, drape_trial *trial);

#endif
