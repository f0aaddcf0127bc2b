/*
 * depth.h: how deep a whole edge or face of cloth lies in a convex collider whose points and segments stay inside
 * of its curved surface (drape_collider_shape.inscribed): there pairs alone do not tell. The signed distance of a
 * convex body is convex, so its least value on a way lies above every tangent: those at two points, one on either
 * side, meet below it, and where they meet is the next point.
 */
#ifndef DRAPE_CONTACT_DEPTH_H
#define DRAPE_CONTACT_DEPTH_H

#include "colliders/colliders.h"

/* The least signed distance [m] between a and b; where it is above `enough`, something between that and it. */
double drape_depth_edge(const drape_collider *collider, const drape_collider_pose *pose, const double *a,
                        const double *b, double enough);

/* The same on a triangle (three corners). */
double drape_depth_face(const drape_collider *collider, const drape_collider_pose *pose,
                        const double *const corner[3], double enough);

#endif
