/*
 * catch_up.h: bodies and pins after simulated time was dropped. A host that sends them to where they are at
 * the end of a frame sends them, by then, along the path of all the time that was dropped, too. In the time
 * of one frame that may be many times their speed, at which no step succeeds, so that more time is dropped.
 * Instead
 *
 *  - the displacement that all pins have in common is made at once for the time that was dropped, by the
 *    cloth and by all that is sent with it: nothing moves relative to anything else;
 *  - of the rest, relative to that, no more is made than at HURRY times its speed, and no more than at its
 *    own after an attempt that failed. What is left is behind the host, until it has caught up.
 */
#ifndef DRAPE_REALTIME_CATCH_UP_H
#define DRAPE_REALTIME_CATCH_UP_H

#include "realtime/realtime.h"

/* Whether a host sends anything in a call, and how many times faster than that bodies, relative to the pins,
 * and pins go. */
typedef struct drape_catch_up {
    bool sent;
    double bodies, pins;
} drape_catch_up;

/* At the beginning of a call that owes so many seconds. Errors: DRAPE_E_ARGUMENT (beyond where anything can
 * be placed), DRAPE_E_MEMORY. */
drape_status drape_sim_catch_up(drape_sim *sim, double owed, drape_catch_up *rates);

/* At its end: so many seconds of it were not made, and so many of these are dropped. */
void drape_sim_fall_behind(drape_sim *sim, const drape_catch_up *rates, double left, double dropped);

#endif
