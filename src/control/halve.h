/* halve.h: shared by controllers: dt_min, and the rule that a failed step is halved until it is too small. */
#ifndef DRAPE_CONTROL_HALVE_H
#define DRAPE_CONTROL_HALVE_H

#include "control/control.h"

#define DRAPE_DT_MIN_PARAM                                                                                   \
    DRAPE_NUMBER("dt_min", "s", 1e-7, DRAPE_ABOVE(0), 1e6, "lower bound of the step size")

/* For an attempt that failed or was rejected with a status > 0: retries with half the size, or stops with
 * DRAPE_E_STEP_TOO_SMALL if that is below dt_min or no longer changes the time. A size that the integrator
 * advises takes the place of half; dt_min does not apply to it. A negative status stops unchanged. */
drape_verdict drape_halve(double dt_min, drape_trial *trial);

#endif
