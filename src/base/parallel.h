/* parallel.h: a loop whose rounds are independent of each other, dealt out to threads. */
#ifndef DRAPE_BASE_PARALLEL_H
#define DRAPE_BASE_PARALLEL_H

#include <stdint.h>

typedef void drape_round(void *user, int64_t round);

/* Calls one(user, k) for k = 0 ... rounds - 1, whoever is free next. Without OpenMP, or with one thread, in order:
 * a parallel region of one thread would cost libgomp a heap call. */
static inline void drape_parallel(int threads, int64_t rounds, drape_round *one, void *user)
{
#ifdef _OPENMP
    if (threads > 1 && rounds > 1) {
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads)
        for (int64_t k = 0; k < rounds; k++)
            one(user, k);
        return;
    }
#endif
    (void)threads;
    for (int64_t k = 0; k < rounds; k++)
        one(user, k);
}

#endif
