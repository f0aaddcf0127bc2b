/* planes.h: vectors of all nodes as three arrays, all x, all y, all z, for loops that compilers vectorise. */
#ifndef DRAPE_INTEGRATORS_PLANES_H
#define DRAPE_INTEGRATORS_PLANES_H

#include <stddef.h>

static inline void planes_from(size_t n, const double *restrict from, double *restrict planes)
{
    double *restrict y = planes + n, *restrict z = y + n;
    for (size_t i = 0; i < n; i++) {
        planes[i] = from[3 * i];
        y[i] = from[3 * i + 1];
        z[i] = from[3 * i + 2];
    }
}

static inline void planes_to(size_t n, const double *restrict planes, double *restrict to)
{
    const double *restrict y = planes + n, *restrict z = y + n;
    for (size_t i = 0; i < n; i++) {
        to[3 * i] = planes[i];
        to[3 * i + 1] = y[i];
        to[3 * i + 2] = z[i];
    }
}

static inline void planes_add_to(size_t n, const double *restrict planes, double *restrict to)
{
    const double *restrict y = planes + n, *restrict z = y + n;
    for (size_t i = 0; i < n; i++) {
        to[3 * i] += planes[i];
        to[3 * i + 1] += y[i];
        to[3 * i + 2] += z[i];
    }
}

#endif
