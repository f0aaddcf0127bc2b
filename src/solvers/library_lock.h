/*
 * alone.h: for calls into libraries that only one thread of the process may be in: METIS, which draws from rand(), and BLAS. OpenBLAS as
 * it is built without threads hands out its work space without a lock: two sims at once, each on its own thread, wrote into each
 * other's products, and their results were silently wrong. A host that calls them itself from another thread is not held off.
 */
#ifndef DRAPE_SOLVERS_LIBRARY_LOCK_H
#define DRAPE_SOLVERS_LIBRARY_LOCK_H

/* Waits for its turn; nothing in between may wait for another thread of ours or fail to come to the end. */
void drape_library_lock(void);
void drape_library_unlock(void);

#endif
