/* warnings.h: what drape_sim_warning looks for. */
#ifndef DRAPE_SIM_WARNINGS_H
#define DRAPE_SIM_WARNINGS_H

#define DRAPE_FEW_STEPS 20 /* a run of fewer steps shows neither whether it is stable nor how it moves */

#include "sim/sim.h"

/* A test of drape_sim_warning: describes what it found. */
typedef struct drape_warning_check {
    const char *name;
    bool (*applies)(drape_sim *sim, char *text, size_t size);
} drape_warning_check;

/* Whether memory was out for a test since the last call, so that a warning may be missing. */
bool drape_sim_take_warning_failure(drape_sim *sim);

#endif
