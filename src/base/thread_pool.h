/*
 * thread_pool.h: threads that help with loops over independent tasks. Each free thread takes the next task;
 * the caller takes tasks, too, and waits only for those that a helper has begun. A helper that is kept from
 * its core by another program takes no tasks, and the caller does its share; threads that meet at a barrier
 * would have to wait for it in every loop.
 */
#ifndef DRAPE_BASE_THREAD_POOL_H
#define DRAPE_BASE_THREAD_POOL_H

#include "base/arena.h"

#include <stdint.h>

typedef struct drape_pool drape_pool;
typedef void drape_task(void *user, int64_t task);

/* Creates a pool of the caller and threads - 1 helpers, or fewer if the system refuses. For one thread *out
 * is NULL. Errors: DRAPE_E_MEMORY. */
drape_status drape_pool_create(drape_arena *arena, int threads, drape_pool **out);
void drape_pool_destroy(drape_pool **pool); /* ends the threads; call it before the arena is freed */

/* Returns the number of threads asked for; 1 if pool is NULL. */
int drape_pool_threads(const drape_pool *pool);

/* Calls run(user, k) for k = 0 ... tasks - 1 < 2^31 and returns when all are done; if pool is NULL, the
 * caller runs them in order. Only one loop runs at a time: a task must not start another. */
void drape_parallel(drape_pool *pool, int64_t tasks, drape_task *run, void *user);

#endif
