/* search.h: binary search in times that increase. */
#ifndef DRAPE_BASE_SEARCH_H
#define DRAPE_BASE_SEARCH_H

#include <stddef.h>
#include <stdint.h>

/* The number of the last of `count` times, `stride` bytes apart, that is at or before t; -1: none is. time:
 * the first, which may be the first member of a struct; NULL if there are none. */
static inline int64_t drape_last_time(const void *time, size_t stride, int64_t count, double t)
{
    int64_t low = -1, high = count;
    while (high - low > 1) {
        const int64_t middle = low + (high - low) / 2;
        const double *at = (const void *)((const char *)time + (size_t)middle * stride);
        *(*at <= t ? &low : &high) = middle;
    }
    return low;
}

#endif
