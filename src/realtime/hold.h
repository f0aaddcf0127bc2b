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

/* After a trial that the controller did not accept (stopped: and is not to be made again): makes such a step
 * into the next state, described by trial->info, if that is the last resort and possible. Not where moving
 * pins would make an element degenerate, nor over an event: then the next attempt ends there. False if there
 * is none; *error then has what ends the advance, or DRAPE_OK. */
bool drape_hold(drape_sim *sim, drape_trial *trial, bool stopped, drape_status *error);

#endif
