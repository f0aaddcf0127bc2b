/* root.h: a root of a continuous function of one variable between two points at which its signs differ. */
#ifndef DRAPE_SIM_ROOT_H
#define DRAPE_SIM_ROOT_H

#include "base/context.h"

/* Writes f(t) to *value. A status other than DRAPE_OK ends the search, which returns it. */
typedef drape_status drape_root_function(void *user, double t, double *value);

/* Encloses a root in an interval no longer than tolerance (> 0), or finds it exactly, and writes to *root
 * the end of the interval on the side of b: a point where f is 0 or has the sign of fb, but not a. fa and fb
 * are f(a) and f(b), a < b; fb may be 0, and fa has another sign than fb, or is 0. It takes at most two
 * evaluations more than bisection, one of them for rounding. Oliveira & Takahashi 2020, An enhancement of
 * the bisection method average performance preserving minmax optimality (ITP), ACM Trans. Math. Softw. 47
 * (1). */
drape_status drape_root_find(drape_root_function *f, void *user, double a, double fa, double b, double fb,
                             double tolerance, double *root);

#endif
