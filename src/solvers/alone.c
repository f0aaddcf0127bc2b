/* alone.c: see alone.h. */
#include "solvers/alone.h"

#include <pthread.h>

/* What is guarded is of the process, so this is, too. */
static pthread_mutex_t alone = PTHREAD_MUTEX_INITIALIZER;

void drape_alone_begin(void)
{
    pthread_mutex_lock(&alone);
}

void drape_alone_end(void)
{
    pthread_mutex_unlock(&alone);
}
