/*
 * hold.h: the last resort of advances with a time budget. If a step fails again and again, whatever its size,
 * a held step is made: until the end of the nominal step, the free nodes of a cloth whose pins all have the
 * same displacement go along with them, all other free nodes stay where they are, and lose their velocity.
 * Pins and colliders move on, and bodies are let into the cloth that they reach (room.h). So each call
 * advances the time, and no call fails for good. Held steps are counted and reported. There are none with
 * contact/no_room "stop", nor with integrators that choose their own steps.
 */
#ifndef DRAPE_REALTIME_HOLD_H
#define DRAPE_REALTIME_HOLD_H

#include "realtime/realtime.h"

/* After a trial that the controller did not accept (stopped: and is not to be made again): makes a held step
 * into the next state, described by trial->info, if enough attempts have failed and it is possible. Not if
 * moving pins would make an element degenerate, nor over an event: then the next attempt ends there. Returns
 * false if no step was made; *error then has what ends the advance, or DRAPE_OK. */
bool drape_hold(drape_sim *sim, drape_trial *trial, bool stopped, drape_status *error);

#endif
