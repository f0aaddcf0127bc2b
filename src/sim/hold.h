/*
 * hold.h: the last resort of advances with a time budget. Where a step fails again and again, whatever its
 * size, the free nodes go where the pins of their cloth go as one, or are held where they are, until the end
 * of the nominal step, and lose all other velocity; pins and colliders move on, and bodies are let into the
 * cloth that they reach (contact/relaxed.h). So a call makes headway, and no call fails for good. Held steps
 * are counted and reported. Not with contact/no_room "stop", nor with integrators that choose their own
 * steps.
 */
#ifndef DRAPE_SIM_HOLD_H
#define DRAPE_SIM_HOLD_H

#include "sim/sim.h"

/* For an attempt that failed, whether the cloth is to be held. stopped: it is not to be tried again. */
bool drape_sim_must_hold(const drape_sim *sim, drape_status failure, bool stopped);

/* Makes such a step into `next`. A status > 0: this is not possible either, because moving pins would make
 * an element degenerate. Errors: DRAPE_E_MEMORY. */
drape_status drape_sim_hold(drape_sim *sim, drape_state *next, drape_step_info *info);

#endif
