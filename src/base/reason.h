/* reason.h: why an attempt at a step was accepted or rejected: the reasons in steps.csv, in summary.json and
 * in drape_attempt. One table has all of those that Drape itself reports, each with its meaning; `drape list
 * reasons` prints it. User-defined terms report reasons of their own. */
#ifndef DRAPE_BASE_REASON_H
#define DRAPE_BASE_REASON_H

#include "base/registry.h"

typedef enum drape_reason {
    DRAPE_REASON_CONVERGED,
    DRAPE_REASON_ROUNDING,
    DRAPE_REASON_LOCAL_ERROR,
    DRAPE_REASON_CORRECTION,
    DRAPE_REASON_ITERATIONS,
    DRAPE_REASON_HELD,
    DRAPE_REASON_RESIDUAL,
    DRAPE_REASON_STAGNATION,
    DRAPE_REASON_MAX_ITERATIONS,
    DRAPE_REASON_LINE_SEARCH,
    DRAPE_REASON_NEWTON_STEP,
    DRAPE_REASON_NEWTON,
    DRAPE_REASON_SINGULAR,
    DRAPE_REASON_SOLVER,
    DRAPE_REASON_MEMORY,
    DRAPE_REASON_NONFINITE,
    DRAPE_REASON_ERROR_TEST,
    DRAPE_REASON_ROUND_OFF,
    DRAPE_REASON_MAX_STEPS,
    DRAPE_REASON_MAX_SUBSTEPS,
    DRAPE_REASON_MOVE,
    DRAPE_REASON_STRETCH,
    DRAPE_REASON_UNSTABLE,
    DRAPE_REASON_BLOW_UP,
    DRAPE_REASON_STALLED,
    DRAPE_REASON_ENERGY,
    DRAPE_REASON_EDGE_COLLAPSE,
    DRAPE_REASON_ALTITUDE_COLLAPSE,
    DRAPE_REASON_AREA_COLLAPSE,
    DRAPE_REASON_SPRING_COLLAPSE,
    DRAPE_REASON_HINGE_BRANCH,
    DRAPE_REASON_STRAIN_LIMIT,
    DRAPE_REASON_PENETRATION,
    DRAPE_REASON_COLLISION,
    DRAPE_REASON_EVENT,
    DRAPE_REASON_CANCELLED,
    DRAPE_REASON_OTHER,
    DRAPE_REASON_COUNT
} drape_reason;

/* The name of a reason, static: "converged". */
const char *drape_reason_name(drape_reason reason);

extern const drape_registry
    drape_reason_registry; /* in the order of drape_reason; reference: who reports it */

#endif
