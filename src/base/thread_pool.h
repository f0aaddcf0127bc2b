/*
 * thread_pool.h: threads that help with loops over independent tasks. Each thread that is free takes the next
 * task; the caller takes tasks too, and waits only for those that a helper has begun. A helper that another
 * program keeps from its core takes none, so the caller does its part; threads that meet at a barrier would
 * wait for it at every loop.
 */
#ifndef DRAPE_BASE_THREAD_POOL_H
#define DRAPE_BASE_THREAD_POOL_H

#include "base/arena.h"

#include <stdint.h>

typedef struct drape_pool drape_pool;
typedef void drape_task(void *user, int64_t task);

/* The caller and threads - 1 helpers, fewer if the system refuses. *out is NULL for one thread.
 * Errors: DRAPE_E_MEMORY. */
drape_status drape_pool_create(drape_arena *arena, int threads, drape_pool **out);
void drape_pool_destroy(drape_pool **pool); /* ends the threads; before the arena is freed */

/* The number asked for; 1 for NULL. */
int drape_pool_threads(const drape_pool *pool);

/* Calls run(user, k) for k = 0 ... tasks - 1 < 2^31, and returns when all are done; with pool NULL in order,
 * by the caller. One loop at a time: a task starts none. */
void drape_parallel(drape_pool *pool, int64_t tasks, drape_task *run, void *user);

#endif
