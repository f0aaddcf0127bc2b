/*
 * clones.h: DRAPE_CLONES before a function compiles it twice, for plain x86-64 and for AVX2, and the loader takes
 * the one that the machine has. No multiplication is fused with an addition in either: both give the same bits.
 * Elsewhere, and under sanitizers, whose code must not run in the loader, it says nothing.
 */
#ifndef DRAPE_BASE_CLONES_H
#define DRAPE_BASE_CLONES_H

#include <stdlib.h> /* __GLIBC__ */

#define DRAPE_CLONES
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__has_attribute) &&                                 \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#if __has_attribute(target_clones)
#undef DRAPE_CLONES
#define DRAPE_CLONES __attribute__((target_clones("avx2", "default")))
#endif
#endif

#endif
