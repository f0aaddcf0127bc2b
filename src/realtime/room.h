/*
 * room.h: finds the cloth that bodies leave no room, and relaxes it (relaxed.h). A node has no room if one
 * collider pushes it into another one, so that across the cloth there is no place outside of both, or if it
 * is near a pin that is inside a collider. If a step fails for another reason, as where cloth is too taut,
 * the pair that refused the step is relaxed, and pairs whose gap is hardly above the least one. Pairs of free
 * cloth with free cloth are never relaxed: layers between two bodies keep apart from each other, and yield to
 * the bodies together.
 *
 * All functions do nothing if contact is NULL.
 */
#ifndef DRAPE_REALTIME_ROOM_H
#define DRAPE_REALTIME_ROOM_H

#include "realtime/relaxed.h"

/* Lets pairs of this contact be relaxed from now on. The arena must outlive the contact. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_room_open(drape_arena *arena, drape_contact *contact);

/* Says that the step that begins next ends at t1, and whether cloth that has no room there may be relaxed.
 * Without this call, no cloth is relaxed at the beginning of the step, and relaxed cloth stays relaxed. */
void drape_room_expect(drape_contact *contact, double t1, bool may_relax);

/* What is relaxed after a step that failed, if no cloth is found that has no room. */
typedef enum drape_relax_extent {
    DRAPE_RELAX_NONE,
    DRAPE_RELAX_PAIR, /* the pair that refused the step, if it is one of cloth with a body */
    DRAPE_RELAX_NEAR  /* also near pairs (contact/active.h) with bodies; if there are none, those of cloth and
                         pinned cloth */
} drape_relax_extent;

/* After a step to t1 that failed: relaxes cloth that has no room or, if there is none, what extent says.
 * *added: the number of nodes that were not relaxed before; if it is not 0, the same step may succeed.
 * Errors: DRAPE_E_MEMORY. */
drape_status drape_room_relax(drape_contact *contact, double t1, drape_relax_extent extent, int32_t *added);

/* After a step that failed: whether drape_room_relax would relax any cloth in a step to t1, also if
 * drape_room_open was not called. Errors: DRAPE_E_MEMORY. */
drape_status drape_room_lacks(drape_contact *contact, double t1, drape_relax_extent extent, bool *lacks);

/* In a step that has begun: relaxes cloth until no pair that can be relaxed refuses a step that ends at x and
 * t1, with the free nodes where the step began. Errors: DRAPE_E_MEMORY. */
drape_status drape_room_let_in(drape_contact *contact, const double *x, double t1);

#endif
