/* sample.h: tests that combine every item of a list with every item of another take a sample of the pairs, in
 * which each item of both lists is met. With DRAPE_ALL, which the suite `long` sets, they take all pairs. */
#ifndef DRAPE_TESTS_SAMPLE_H
#define DRAPE_TESTS_SAMPLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>

static inline bool complete_sweep(void)
{
    return getenv("DRAPE_ALL") != NULL;
}

/* Whether the pair of the i-th item of one list and the k-th of the other is in the sample: one pair in
 * `every`. Each i is in it with every `every`-th k, and each k with every `every`-th i. */
static inline bool in_sample(size_t i, size_t k, size_t every)
{
    return complete_sweep() || (i + k) % every == 0;
}

#endif
