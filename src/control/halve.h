/* halve.h: shared by controllers: dt_min, max_attempts, and the rule that a failed step is halved until it is
 * too small. */
#ifndef DRAPE_CONTROL_HALVE_H
#define DRAPE_CONTROL_HALVE_H

#include "control/control.h"

#define DRAPE_DT_MIN_PARAM                                                                                   \
    DRAPE_NUMBER("dt_min", "s", 1e-7, DRAPE_ABOVE(0), 1e6, "lower bound of the step size")

/* The driver counts attempts and stops the run (sim/step.c): too many accepted attempts are possible, too. */
#define DRAPE_MAX_ATTEMPTS_PARAM(usual)                                                                      \
    DRAPE_INTEGER("max_attempts", "1", usual, 1, 1e9,                                                        \
                  "largest number of attempted steps within one dt; one more ends the run")

/* For an attempt that failed or was rejected with a status > 0: retries with half the size, or stops with
 * DRAPE_E_STEP_TOO_SMALL if that is below dt_min or no longer changes the time. A size that the integrator
 * advises takes the place of half; dt_min does not apply to it. A negative status stops unchanged. */
drape_verdict drape_halve(double dt_min, drape_trial *trial);

#endif
