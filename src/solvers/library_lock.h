/*
 * library_lock.h: a lock around calls into libraries that only one thread of the process may use at a time:
 * METIS, which draws from rand(), and BLAS. OpenBLAS built without threads hands out its workspace without
 * a lock: two sims, each on its own thread, wrote into each other's products, and their results were
 * silently wrong. A host that itself calls these libraries from another thread does not take this lock.
 */
#ifndef DRAPE_SOLVERS_LIBRARY_LOCK_H
#define DRAPE_SOLVERS_LIBRARY_LOCK_H

/* Between the two calls no code may wait for another thread of ours, or leave without
 * drape_library_unlock. */
void drape_library_lock(void);
void drape_library_unlock(void);

#endif
