/*
 * exit.h: how cloth comes out of a body that it is entangled with: a segment of the body passes through its
 * faces, or parts of one patch are nearer to one side of the body and parts to another. There the nearest
 * surface does not lead out. Such faces form patches; all nodes of a patch are pushed along one direction,
 * across the cloth, to the side from which less of it has a shorter path out of the body, and as far as the
 * last of it needs. Direction and end of the path move with the body.
 */
#ifndef DRAPE_REALTIME_EXIT_H
#define DRAPE_REALTIME_EXIT_H

#include "realtime/relaxed.h"

/* Whether a segment or triangle of a collider and a face of cloth pass through each other where contact is
 * evaluated. piercing, unless NULL: where, if it is a segment that passes through the face, else a corner
 * of the face. */
bool drape_exit_is_pierced(const drape_contact *contact, int32_t collider, int32_t face, double piercing[3]);

/* At the beginning of a step: finds which relaxed nodes are in patches, and where these go. The other nodes
 * of their faces are relaxed from time t on, too. Errors: DRAPE_E_MEMORY. */
drape_status drape_exit_find(drape_contact *contact, double t);

/* Adds the contacts of these nodes with the ends of their paths to the active set of a configuration. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_exit_add(drape_contact *contact, const drape_configuration *at);

#endif
