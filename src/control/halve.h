/* halve.h: what controllers share: dt_min, max_attempts, and the rule that a step is halved until it is too
 * small. */
#ifndef DRAPE_CONTROL_HALVE_H
#define DRAPE_CONTROL_HALVE_H

#include "control/control.h"

#define DRAPE_DT_MIN_PARAM                                                                                   \
    DRAPE_NUMBER("dt_min", "s", 1e-7, DRAPE_ABOVE(0), 1e6, "no step is cut to less than this")

/* The driver counts and stops (sim/step.c): attempts that are all accepted may be too many as well. */
#define DRAPE_MAX_ATTEMPTS_PARAM(usual)                                                                      \
    DRAPE_INTEGER("max_attempts", "1", usual, 1, 1e9,                                                        \
                  "steps tried, accepted or not, within one dt; one more ends the run")

/* The attempt failed, or was refused with a status > 0: half of it next, or DRAPE_E_STEP_TOO_SMALL where
 * that is below dt_min or no longer moves the time. A negative status stops as it is. */
drape_verdict drape_halve(double dt_min, drape_trial *trial);

#endif
