/*
 * lanes.h: four doubles at once, as vector types of GCC and Clang, which map them to the processor's vectors.
 * Each lane is computed as a single double would be, so all processors give the same bits.
 *
 * A function over lanes is marked LANES_INLINE, so that it is inlined into one marked LANES_DISPATCH, which
 * is compiled for several processors and selected when the program starts. A call between functions for
 * different processors must not pass lanes.
 */
#ifndef DRAPE_BASE_LANES_H
#define DRAPE_BASE_LANES_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#define LANES 4

typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef int64_t lanes_mask __attribute__((vector_size(LANES * sizeof(double)))); /* -1 or 0 in each lane */

#define LANES_INLINE static inline __attribute__((always_inline))

/* The sanitizers' code is not initialised yet when the program selects a version. */
#if defined(__x86_64__) && defined(__gnu_linux__) && defined(__GNUC__) && !defined(__clang__) &&             \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define LANES_DISPATCH __attribute__((target_clones("avx2", "default")))
#else
#define LANES_DISPATCH
#endif

LANES_INLINE lanes lanes_load(const double *from)
{
    lanes a;
    memcpy(&a, from, sizeof a);
    return a;
}

LANES_INLINE void lanes_store(double *to, lanes a)
{
    memcpy(to, &a, sizeof a);
}

LANES_INLINE lanes lanes_sqrt(lanes a)
{
    for (int l = 0; l < LANES; l++)
        a[l] = sqrt(a[l]);
    return a;
}

LANES_INLINE lanes lanes_dot(const lanes a[3], const lanes b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

LANES_INLINE void lanes_cross(const lanes a[3], const lanes b[3], lanes out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* One point of the array (points x 3) per lane. */
LANES_INLINE void lanes_gather(const double *from, const int32_t point[LANES], lanes out[3])
{
    for (int l = 0; l < LANES; l++)
        for (int k = 0; k < 3; k++)
            out[k][l] = from[3 * (size_t)point[l] + (size_t)k];
}

#endif
