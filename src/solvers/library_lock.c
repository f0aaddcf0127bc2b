/* library_lock.c: see library_lock.h. */
#include "solvers/library_lock.h"

#include <pthread.h>

/* The libraries are shared by the whole process, and so is their lock. */
static pthread_mutex_t library = PTHREAD_MUTEX_INITIALIZER;

void drape_library_lock(void)
{
    pthread_mutex_lock(&library);
}

void drape_library_unlock(void)
{
    pthread_mutex_unlock(&library);
}
