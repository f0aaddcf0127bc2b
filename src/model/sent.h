/*
 * sent.h: what a host sends of pins and colliders from one moment on, to be there at the end of a frame, and
 * how less of it is done in that time.
 */
#ifndef DRAPE_MODEL_SENT_H
#define DRAPE_MODEL_SENT_H

#include "model/motion.h"

/* How much of the motions is done that were sent at time t and end no later than `end`: what is `common` to
 * all of them, but for `left`, and a share of the rest. */
typedef struct drape_sent_part {
    double t, end;    /* [s] */
    double common[3]; /* [m] */
    double left[3];   /* [m] what is still to be done of it */
    double share;     /* of the rest, from 0 to 1 */
} drape_sent_part;

/* Whether a host has sent at time t, to be there no later than `end`: a collider; anything; all pinned nodes,
 * by themselves or with a collider that carries them. */
bool drape_motion_sends_collider(const drape_motion *motion, int32_t collider, double t, double end);
bool drape_motion_sends(const drape_motion *motion, double t, double end);
bool drape_motion_sends_pins(const drape_motion *motion, double t, double end);

/* Whether the pinned ones of `count` nodes from the first on, which are at x (node_count x 3) now, go in much
 * the same direction until `end`, if there are any, whatever moves them. *common: their mean displacement
 * [m]. */
bool drape_motion_moves_as_one(const drape_motion *motion, int32_t first, int32_t count, const double *x,
                               double end, double common[3]);

/* Shortens the motions that were sent at part->t to that part of them. They begin where they did. */
void drape_motion_shorten(drape_motion *motion, const drape_sent_part *part);

#endif
