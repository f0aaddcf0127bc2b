/*
 * bound.h: lower bounds of the distance between the two pieces of a pair that are cheaper than its closest
 * points, and hold on a whole path.
 */
#ifndef DRAPE_CONTACT_BOUND_H
#define DRAPE_CONTACT_BOUND_H

#include "contact/pair.h"

/* Bounds the distance of the pieces, not surfaces, on their straight path from x to y, by the axes through
 * their centres at either end; y NULL: at x. May be negative. x, y: (points x 3). */
double drape_bound_by_axes(const drape_pair *pair, const double *x, const double *y);

/* Whether that bound is at least a distance > 0, without its square roots: of the pairs of a search most
 * are so far apart. */
bool drape_bound_is_apart(const drape_pair *pair, const double *x, const double *y, double distance);

/* Bounds how much the distance of the pieces changes between x and y: the sum of the largest moves of a point
 * of each, without their common motion. */
double drape_bound_change(const drape_pair *pair, const double *x, const double *y);

#endif
