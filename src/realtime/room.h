/*
 * room.h: which cloth bodies leave no room. Nodes without room are those that a collider pushes into
 * another one, so that across the cloth there is no place outside of both, and pins inside a collider.
 * Where a step fails for another reason, such as cloth that is too taut, it is the pair that refused it,
 * and those whose gap is hardly above the least. Pairs of free cloth with free cloth are never relaxed:
 * layers between two bodies keep apart from each other, and yield to the bodies together.
 *
 * contact NULL: there is none, and nothing is done.
 */
#ifndef DRAPE_REALTIME_ROOM_H
#define DRAPE_REALTIME_ROOM_H

#include "realtime/relaxed.h"

/* From now on pairs of this contact can be relaxed (relaxed.h). The arena must outlive it. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_room_open(drape_arena *arena, drape_contact *contact);

/* Says that the step that begins next ends at t1, and whether cloth that has no room there may be relaxed.
 * Without it, no cloth is, and what is relaxed stays so. */
void drape_room_expect(drape_contact *contact, double t1, bool may_relax);

/* What is relaxed after a step that failed, if no cloth is found that has no room. */
typedef enum drape_relax_extent {
    DRAPE_RELAX_NONE,
    DRAPE_RELAX_PAIR, /* the pair that refused the step, if it is one with a body */
    DRAPE_RELAX_NEAR  /* also those whose gaps are hardly above the least; if none of them is one with a body,
                         those of cloth and pinned cloth */
} drape_relax_extent;

/* After a step to t1 that failed: relaxes cloth that has no room, or, if there is none, what extent says.
 * *added: nodes that are relaxed from now on; if there are any, the same step may succeed. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_room_relax(drape_contact *contact, double t1, drape_relax_extent extent, int32_t *added);

/* After a step that failed: whether drape_room_relax would relax any cloth in a step to t1, also where it
 * cannot. Errors: DRAPE_E_MEMORY. */
drape_status drape_room_lacks(drape_contact *contact, double t1, drape_relax_extent extent, bool *lacks);

/* In a step that has begun: relaxes cloth until nothing refuses an end of the step at x, t1 where free nodes
 * are where the step began, as far as pairs can be relaxed. Errors: DRAPE_E_MEMORY. */
drape_status drape_room_let_in(drape_contact *contact, const double *x, double t1);

#endif
