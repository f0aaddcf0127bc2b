/*
 * exit.h: how cloth comes out of a body if the nearest surface does not lead out: if a segment of the body
 * passes through faces of the cloth, or parts of one patch of cloth are nearer to different sides of the
 * body. Such faces form patches. All nodes of a patch are pushed in one direction, across the cloth, to the
 * side with the shorter paths out of the body, as far as the longest of these paths. The direction and the
 * end of the path move with the body.
 */
#ifndef DRAPE_REALTIME_EXIT_H
#define DRAPE_REALTIME_EXIT_H

#include "realtime/relaxed.h"

/* Whether a segment or triangle of a collider and a face of cloth pass through each other where contact is
 * evaluated. piercing, unless NULL: where, if it is a segment that passes through the face, else a corner
 * of the face. */
bool drape_exit_is_pierced(const drape_contact *contact, int32_t collider, int32_t face, double piercing[3]);

/* At the beginning of a step: finds which relaxed nodes are in patches, and the directions of the patches.
 * Other nodes of their faces are relaxed from time t on, too. Errors: DRAPE_E_MEMORY. */
drape_status drape_exit_find(drape_contact *contact, double t);

/* Adds to the active set of a configuration the contacts of nodes of patches with the ends of their paths.
 * Errors: DRAPE_E_MEMORY. */
drape_status drape_exit_add(drape_contact *contact, const drape_configuration *at);

#endif
