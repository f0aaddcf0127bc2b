/*
 * depth.h: how deep a whole edge or face of cloth lies in a convex collider whose points and segments stay
 * inside of its curved surface (drape_collider_shape.inscribed), where pairs are not enough. The signed
 * distance of a convex body is convex, so its least value on a segment lies above every tangent: the tangents
 * at two points on either side of it intersect below it, and the next point is where they intersect.
 */
#ifndef DRAPE_CONTACT_DEPTH_H
#define DRAPE_CONTACT_DEPTH_H

#include "colliders/colliders.h"

/* The least signed distance [m] between a and b or, if it is larger than `enough`, a value between `enough`
 * and it. */
double drape_depth_edge(const drape_collider *collider, const drape_collider_pose *pose, const double *a,
                        const double *b, double enough);

/* The same on a triangle (three corners). */
double drape_depth_face(const drape_collider *collider, const drape_collider_pose *pose,
                        const double *const corner[3], double enough);

#endif
