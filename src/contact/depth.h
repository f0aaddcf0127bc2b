/*
 * depth.h: how deep a whole edge or face of cloth is inside a convex collider whose points and segments lie
 * inside its curved surface (drape_collider_shape.inscribed), for which pairs do not suffice. The signed
 * distance of a convex body is a convex function, so it lies above all its tangents on a segment: the
 * tangents at two points on either side of its minimum intersect below it, and the next point is that of
 * the intersection.
 */
#ifndef DRAPE_CONTACT_DEPTH_H
#define DRAPE_CONTACT_DEPTH_H

#include "colliders/colliders.h"

/* The smallest signed distance [m] between a and b or, if that is larger than `enough`, a value between
 * `enough` and it. */
double drape_depth_edge(const drape_collider *collider, const drape_collider_pose *pose, const double *a,
                        const double *b, double enough);

/* The same on a triangle (three corners). */
double drape_depth_face(const drape_collider *collider, const drape_collider_pose *pose,
                        const double *const corner[3], double enough);

#endif
