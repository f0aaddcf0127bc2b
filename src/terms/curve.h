/*
 * curve.h: the force T(s) >= 0 of a measured curve, for strains s >= 0, and its energy, the integral of T.
 *
 * T is the piecewise cubic Hermite polynomial through 0, 0 and the measured points whose slopes are Fritsch &
 * Butland's (1984, A method for constructing local monotone piecewise cubic interpolants, SIAM J. Sci. Stat.
 * Comput. 5): the weighted harmonic mean of the slopes of both neighbouring chords. They lie in the region in
 * which Fritsch & Carlson (1980, Monotone piecewise cubic interpolation, SIAM J. Numer. Anal. 17) prove that
 * such a polynomial increases where the points do: the energy is convex. At both ends, where there is one
 * chord only, the slope is that of the parabola through the three nearest points, but at least a third and at
 * most three times that of the chord: it is never 0, so that the sheet has a stiffness at rest. Beyond the
 * last point T goes on along its tangent. A single point is a straight line.
 */
#ifndef DRAPE_TERMS_CURVE_H
#define DRAPE_TERMS_CURVE_H

#include "drape/extend.h"

/* The number of doubles that a curve of `count` points occupies. */
#define DRAPE_CURVE_SIZE(count) (1 + 6 * ((count) + 1))

/* Makes the table (DRAPE_CURVE_SIZE(points->count)) of at least one point: the forces over strain_of of the
 * first numbers, an increasing function that is 0 at 0, or over themselves if it is NULL. */
void drape_curve_make(const drape_points *points, double (*strain_of)(double), double *table);

/* T'(0). */
double drape_curve_stiffness(const double *table);

/* The energy at a strain s >= 0, T and T'. */
typedef struct drape_curve_value {
    double energy, force, slope;
} drape_curve_value;
drape_curve_value drape_curve_at(const double *table, double s);

/* The measure q(s), s >= 0, for which T'(0) q^2/2 is the energy, with its first two derivatives. It is s near
 * 0. */
typedef struct drape_curve_measure_value {
    double q, dq, ddq;
} drape_curve_measure_value;
drape_curve_measure_value drape_curve_measure(const double *table, double s);

#endif
