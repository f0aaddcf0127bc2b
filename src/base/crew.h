/*
 * crew.h: threads that help with loops whose rounds are independent of each other. Rounds are taken, one at a
 * time, by whoever is free: the caller takes them too, and waits for none but those that a helper has begun.
 * A helper that another program keeps from its core takes nothing, so the caller does its part; a team that
 * meets at a barrier would wait for it at every loop.
 */
#ifndef DRAPE_BASE_CREW_H
#define DRAPE_BASE_CREW_H

#include "base/arena.h"

#include <stdint.h>

typedef struct drape_crew drape_crew;
typedef void drape_round(void *user, int64_t round);

/* The caller and threads - 1 helpers; fewer where the system gives no more. NULL in *out for one thread.
 * Errors: DRAPE_E_MEMORY. */
drape_status drape_crew_create(drape_arena *arena, int threads, drape_crew **out);
void drape_crew_destroy(drape_crew **crew); /* ends the threads; before the arena is freed */

/* Of those asked for; 1 for NULL. */
int drape_crew_threads(const drape_crew *crew);

/* Calls one(user, k) for k = 0 ... rounds - 1 < 2^31, and returns when all are done. crew: NULL: in order, by
 * the caller. One loop at a time: a round starts none. */
void drape_parallel(drape_crew *crew, int64_t rounds, drape_round *one, void *user);

#endif
