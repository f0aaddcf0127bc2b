/* alone.c: see alone.h. */
#include "solvers/library_lock.h"

#include <pthread.h>

/* What is guarded is of the process, so this is, too. */
static pthread_mutex_t alone = PTHREAD_MUTEX_INITIALIZER;

void drape_library_lock(void)
{
    pthread_mutex_lock(&alone);
}

void drape_library_unlock(void)
{
    pthread_mutex_unlock(&alone);
}
