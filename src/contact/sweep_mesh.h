/* sweep_mesh.h: what a collider whose triangles move and deform would sweep over in a step, moved along with
 * it: a part of drape_contact_sweep (contact.h). */
#ifndef DRAPE_CONTACT_SWEEP_MESH_H
#define DRAPE_CONTACT_SWEEP_MESH_H

#include "contact/contact.h"

/* Moves the nodes of y (points x 3; its points of colliders are those at the end of the step) that triangles
 * of colliders that deform reach, on straight paths of all points from the beginning of the step, to where
 * they slide on these triangles. Returns whether there are any. */
bool drape_contact_sweep_meshes(drape_contact *contact, double *y);

#endif
