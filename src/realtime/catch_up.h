/*
 * catch_up.h: bodies and pins after simulated time was dropped. A host that gives them targets at the end of
 * each frame (it sends them there) then gives targets that also include the path of the dropped time. In one
 * frame they would have to move at many times their speed, at which no step succeeds, so that more time would
 * be dropped. Instead
 *
 *  - the displacement that all pins have in common is made at once for the time that was dropped, by the
 *    cloth and by everything that is sent with it: nothing moves relative to anything else;
 *  - the rest of the path, relative to that, is made at no more than HURRY times its own speed, and at no
 *    more than its own speed after an attempt that failed. Bodies and pins are behind the host until they
 *    have caught up.
 */
#ifndef DRAPE_REALTIME_CATCH_UP_H
#define DRAPE_REALTIME_CATCH_UP_H

#include "realtime/realtime.h"

/* Whether a host sends anything in a call, and the speeds of bodies, relative to the pins, and of pins in
 * multiples of those that the host gives. */
typedef struct drape_catch_up {
    bool sent;
    double bodies, pins;
} drape_catch_up;

/* At the beginning of a call that owes so many seconds. Errors: DRAPE_E_ARGUMENT (beyond where anything can
 * be placed), DRAPE_E_MEMORY. */
drape_status drape_sim_catch_up(drape_sim *sim, double owed, drape_catch_up *rates);

/* At the end of the call: so many seconds of it were left, and so many of these are dropped. */
void drape_sim_fall_behind(drape_sim *sim, const drape_catch_up *rates, double left, double dropped);

#endif
