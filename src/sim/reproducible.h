/* reproducible.h: whether the bits of results are those of other builds and processors. */
#ifndef DRAPE_SIM_REPRODUCIBLE_H
#define DRAPE_SIM_REPRODUCIBLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A hash of results of base/elementary.h for fixed arguments, computed at each call: the same wherever
 * arithmetic is that of IEEE 754 without contraction, rounding to nearest, and denormal numbers are kept. */
uint64_t drape_arithmetic_hash(void);

/* Whether the same scene has the same bits in every build of the same versions of Drape, its libraries and
 * the compiler, on any processor. If not, `why` has the reasons, else "". */
bool drape_reproducible(char *why, size_t size);

#endif
