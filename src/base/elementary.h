/*
 * elementary.h: elementary functions with the same bits on every machine with IEEE doubles. The C library
 * chooses its own by the processor and changes them from version to version, so code whose results reach a
 * state calls these. They use additions, products, quotients and square roots only, whose rounding IEEE 754
 * defines, in a fixed order; the compiler must not contract a product and a sum into one operation
 * (-ffp-contract=off in meson.build).
 *
 * Every function is faithful: its error is below one unit in the last place. tests/unit/test_elementary.c
 * checks a bound of 0.8 against results of twice the precision, and up to 1 where the result is denormal.
 * fabs, fmin, fmax, floor, ceil, round, fmod, frexp, ldexp and sqrt of the C library are exact or correctly
 * rounded by their definition and need no substitute; a small integer power is written as a product.
 */
#ifndef DRAPE_BASE_ELEMENTARY_H
#define DRAPE_BASE_ELEMENTARY_H

#define DRAPE_SIN_COS_MAX 1024.0

/* Sine and cosine of an angle [rad]; NaN beyond DRAPE_SIN_COS_MAX in magnitude. */
void drape_sin_cos(double angle, double *sine, double *cosine);

/* The angle of the point (x, y) in [-pi, pi], as atan2 of C, zeros and infinities included. The same bits as
 * lanes_atan2 of base/lanes_atan2.h. */
double drape_atan2(double y, double x);

/* sqrt(x^2 + y^2), without overflow or underflow between. */
double drape_hypot(double x, double y);

/* Natural logarithms of x and of 1 + x, as log and log1p of C. */
double drape_ln(double x);
double drape_ln1p(double x);

/* x^y for x >= 0, as pow of C; NaN for x < 0. */
double drape_pow(double x, double y);

#endif
