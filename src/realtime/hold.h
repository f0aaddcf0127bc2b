/*
 * hold.h: the last resort of advances with a time budget. Where a step fails again and again, whatever its
 * size, the free nodes go where the pins of their cloth go as one, or are held where they are, until the end
 * of the nominal step, and lose all other velocity; pins and colliders move on, and bodies are let into the
 * cloth that they reach (room.h). So a call makes headway, and no call fails for good. Held steps
 * are counted and reported. Not with contact/no_room "stop", nor with integrators that choose their own
 * steps.
 */
#ifndef DRAPE_REALTIME_HOLD_H
#define DRAPE_REALTIME_HOLD_H

#include "realtime/realtime.h"

/* After an attempt that failed, described by *info: makes such a step into the next state, if that is the
 * last resort and possible. Not where moving pins would make an element degenerate, nor over an event: then
 * the next attempt ends there. *stop as in drape_rescue_ops.failed. */
bool drape_sim_hold(drape_sim *sim, drape_status failure, drape_step_info *info, drape_status *stop);

#endif
