/*
 * room.h: which cloth bodies leave no room. Nodes without room are those that a collider pushes into
 * another one, so that across the cloth there is no place outside of both, and pins inside a collider.
 * Where a step fails for another reason, such as cloth that is too taut, it is the pair that refused it,
 * and those whose gap is hardly above the least. Pairs of free cloth with free cloth are never relaxed:
 * layers between two bodies keep apart from each other, and yield to the bodies together.
 */
#ifndef DRAPE_CONTACT_ROOM_H
#define DRAPE_CONTACT_ROOM_H

#include "contact/contact.h"
#include "contact/pair.h"

/* Adds the contacts of relaxed cloth that no pair stands for, to the active set of a configuration: nodes
 * with colliders without a smooth surface, and faces, at some points of them, where the features of a
 * collider have no radius and their pairs are left out. Errors: DRAPE_E_MEMORY. */
drape_status drape_room_add_surfaces(drape_contact *contact, const drape_configuration *at);

/* At the beginning of a step: measures the relaxed nodes at the present point, which is listed, and holds
 * those again that came out. *changed: some were. */
drape_status drape_room_review(drape_contact *contact, double t, bool *changed);

/* Looks for cloth without room where the pins and colliders of time t1 meet the nodes x (node_count x 3) of
 * time t, and relaxes what it finds, if it may: *added nodes. Moves the point of contact. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_room_look_ahead(drape_contact *contact, const double *x, double t, double t1,
                                   bool may_relax, int32_t *added);

#endif
