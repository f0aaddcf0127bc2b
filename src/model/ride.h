/*
 * ride.h: pins that a collider carries. On a rigid collider a pin stays at a point of its own coordinates. On
 * one that deforms it stays at a point of a triangle with the corners p_i,
 *     X = sum w_i p_i + d n,  sum w_i = 1,  n = (p_1 - p_0) x (p_2 - p_0) / |...|
 * at the same weights w and the same offset d along the normal.
 */
#ifndef DRAPE_MODEL_RIDE_H
#define DRAPE_MODEL_RIDE_H

#include "model/model.h"

/* The ride of a node that no collider carries. */
drape_ride drape_ride_none(void);

/* Fixes the point X of the collider's own coordinates to the triangle with these corners (3 x 3): its
 * projection onto the plane has the weights, which are negative beside the triangle. */
void drape_ride_fix(drape_ride *ride, const double corner[9], const double X[3]);

/* Writes the point X, and its velocity V if the corners have the velocities v (3 x 3). */
void drape_ride_point(const drape_ride *ride, const double corner[9], double X[3]);
void drape_ride_velocity(const drape_ride *ride, const double corner[9], const double v[9], double V[3]);

#endif
