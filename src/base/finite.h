/* finite.h: whether all numbers of an array are finite, in one pass without a branch: 0 a is NaN if a is NaN
 * or infinite, and 0 otherwise. */
#ifndef DRAPE_BASE_FINITE_H
#define DRAPE_BASE_FINITE_H

#include <stdbool.h>
#include <stddef.h>

static inline bool drape_all_finite(const double *a, size_t n)
{
    double probe = 0;
    for (size_t i = 0; i < n; i++)
        probe += 0 * a[i];
    return probe == 0;
}

#endif
