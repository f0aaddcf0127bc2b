/* rod.h: differential equations and roots by GSL: heavy and loaded inextensible rods in a plane. */
#ifndef DRAPE_LAB_ROD_H
#define DRAPE_LAB_ROD_H

#include <stddef.h>

/* The tip of a rod of length 1, clamped horizontally, under its weight G = q L^3/B and a force P = F L^2/B at
 * its end, both downwards: how far it hangs down and reaches. */
void drape_rod_tip(double weight, double force, double *drop, double *reach);

/* The angle [degree] below the horizontal of the chord to the tip, without a force. */
double drape_rod_chord(double weight);

/* The smallest k > 0 with y(1) = 0 for y'' + k t^power y = 0, y(0) = 1, y'(0) = 0; it lies between low and
 * high. */
double drape_rod_threshold(double power, double low, double high);

/* The root of f between low and high, where its signs differ. */
double drape_root(double (*f)(double x, void *context), void *context, double low, double high);

/* y (n) from t = 0 to 1, with a first step and an absolute tolerance. Returns GSL's status; y[0] is NaN if it
 * failed. */
int drape_ode(int (*rate)(double t, const double y[], double dy[], void *context), void *context, size_t n,
              double step, double tolerance, double *y);

#endif
