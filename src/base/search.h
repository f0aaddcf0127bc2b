/* search.h: binary search in times that increase; sets that are joined. */
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

/* Sets that are joined (union-find): parent[i] of each item begins as i, and leads to the lowest item of its
 * set; path halving (Tarjan and van Leeuwen 1984, doi:10.1145/62.2160, section 2). */
static inline int32_t drape_set_of(int32_t *parent, int32_t item)
{
    while (parent[item] != item)
        item = parent[item] = parent[parent[item]];
    return item;
}

static inline void drape_set_join(int32_t *parent, int32_t a, int32_t b)
{
    a = drape_set_of(parent, a);
    b = drape_set_of(parent, b);
    parent[a > b ? a : b] = a < b ? a : b;
}

#endif
