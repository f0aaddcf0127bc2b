/*
 * library_lock.h: a lock around calls into libraries that only one thread of the process may be in: METIS,
 * which draws from rand(), and BLAS. OpenBLAS, built without threads, hands out its work space without a
 * lock: two sims at once, each on its own thread, wrote into each other's products, and their results were
 * silently wrong. A host that calls these libraries itself from another thread is not held off.
 */
#ifndef DRAPE_SOLVERS_LIBRARY_LOCK_H
#define DRAPE_SOLVERS_LIBRARY_LOCK_H

/* Between the two nothing may wait for another thread of ours or fail to reach drape_library_unlock. */
void drape_library_lock(void);
void drape_library_unlock(void);

#endif
