/*
 * crew.h: threads that help with loops over independent tasks. Each thread that is free takes the next task;
 * the caller takes tasks too, and waits only for those that a helper has begun. A helper that another program
 * keeps from its core takes none, so the caller does its part; threads that meet at a barrier would wait for
 * it at every loop.
 */
#ifndef DRAPE_BASE_CREW_H
#define DRAPE_BASE_CREW_H

#include "base/arena.h"

#include <stdint.h>

typedef struct drape_crew drape_crew;
typedef void drape_round(void *user, int64_t task);

/* The caller and threads - 1 helpers, fewer if the system refuses. *out is NULL for one thread.
 * Errors: DRAPE_E_MEMORY. */
drape_status drape_crew_create(drape_arena *arena, int threads, drape_crew **out);
void drape_crew_destroy(drape_crew **crew); /* ends the threads; before the arena is freed */

/* The number asked for; 1 for NULL. */
int drape_crew_threads(const drape_crew *crew);

/* Calls run(user, k) for k = 0 ... tasks - 1 < 2^31, and returns when all are done; with crew NULL in order,
 * by the caller. One loop at a time: a task starts none. */
void drape_parallel(drape_crew *crew, int64_t tasks, drape_round *run, void *user);

#endif
