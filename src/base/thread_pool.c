/*
 * thread_pool.c: see thread_pool.h. The number of open tasks and the number of the loop share one atomic
 * word. A thread takes a task by decrementing the word if it is unchanged since it was read. A thread that
 * has read the word of a finished loop therefore takes no task of the next loop, which it would run with the
 * wrong function. Which thread runs a task is left to chance; what the task writes must not depend on it.
 */
#include "base/thread_pool.h"

#include <assert.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>

/* Number of spins before a thread sleeps. Each yields the core and takes a third of a microsecond if no other
 * thread wants it; together they take one to two milliseconds, longer than the caller needs between two loops
 * of one step. Waking a sleeping core takes up to a tenth of that, every time; longer spinning on a core that
 * others want had no measurable cost. */
#define HELPER_SPINS 5000
#define CALLER_SPINS 3000
/* mask of `open` for the tasks not yet taken; the bits above are the number of the loop */
#define LEFT  0xffffffffu
#define APART 64 /* bytes of a cache line: a write by one thread invalidates the line for all others */

struct drape_pool {
    int threads, helpers;
    pthread_t *helper;    /* (threads - 1), of which `helpers` are running */
    pthread_mutex_t lock; /* guards going to sleep */
    pthread_cond_t work, done;
    /* The loop: written while no task is open, but still read by threads for which the loop may already be
     * over. */
    _Atomic(drape_task *) run;
    _Atomic(void *) user;
    atomic_int_fast64_t tasks;
    char apart[APART];
    atomic_uint_fast64_t open;
    char apart_again[APART];
    atomic_int_fast64_t unfinished; /* tasks that have not been reported as done */
    atomic_int asleep;              /* number of sleeping helpers */
    atomic_bool waiting, ended;     /* waiting: the caller sleeps */
};

int drape_pool_threads(const drape_pool *pool)
{
    return pool ? pool->threads : 1;
}

/* ---- Tasks ---- */

/* Runs as many tasks as it can take. They belong to one loop, which does not end before they are reported as
 * done. */
static void run_tasks(drape_pool *c)
{
    int64_t done = 0;
    uint_fast64_t open = atomic_load(&c->open);
    while (open & LEFT) {
        drape_task *run = atomic_load_explicit(&c->run, memory_order_relaxed);
        void *user = atomic_load_explicit(&c->user, memory_order_relaxed);
        const int64_t task = atomic_load_explicit(&c->tasks, memory_order_relaxed) - (int64_t)(open & LEFT);
        if (!atomic_compare_exchange_weak(&c->open, &open, open - 1))
            continue;
        run(user, task);
        done++;
        open = atomic_load(&c->open);
    }
    if (done > 0 && atomic_fetch_sub(&c->unfinished, done) == done && atomic_load(&c->waiting)) {
        pthread_mutex_lock(&c->lock);
        pthread_cond_signal(&c->done);
        pthread_mutex_unlock(&c->lock);
    }
}

/* ---- Helpers ---- */

static bool is_called(drape_pool *c)
{
    return atomic_load(&c->open) & LEFT || atomic_load(&c->ended);
}

static void *help(void *pool)
{
    drape_pool *c = pool;
    while (!atomic_load(&c->ended)) {
        for (int i = 0; i < HELPER_SPINS && !is_called(c); i++)
            sched_yield();
        if (!is_called(c)) {
            pthread_mutex_lock(&c->lock);
            atomic_fetch_add(&c->asleep, 1);
            while (!is_called(c))
                pthread_cond_wait(&c->work, &c->lock);
            atomic_fetch_sub(&c->asleep, 1);
            pthread_mutex_unlock(&c->lock);
        }
        run_tasks(c);
    }
    return NULL;
}

drape_status drape_pool_create(drape_arena *arena, int threads, drape_pool **out)
{
    *out = NULL;
    if (threads <= 1)
        return DRAPE_OK;
    drape_pool *c = drape_arena_take(arena, 1, sizeof *c);
    pthread_t *helper = drape_arena_take(arena, (size_t)threads - 1, sizeof *helper);
    if (!c || !helper)
        return DRAPE_E_MEMORY;
    c->threads = threads;
    c->helper = helper;
    pthread_mutex_init(&c->lock, NULL);
    pthread_cond_init(&c->work, NULL);
    pthread_cond_init(&c->done, NULL);
    /* Helpers block all signals, which are for the host's threads. */
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    while (c->helpers < c->threads - 1 && !pthread_create(&c->helper[c->helpers], NULL, help, c))
        c->helpers++;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    *out = c;
    return DRAPE_OK;
}

static void wake(drape_pool *c)
{
    pthread_mutex_lock(&c->lock);
    pthread_cond_broadcast(&c->work);
    pthread_mutex_unlock(&c->lock);
}

void drape_pool_destroy(drape_pool **pool)
{
    drape_pool *c = *pool;
    if (!c)
        return;
    atomic_store(&c->ended, true);
    wake(c);
    for (int i = 0; i < c->helpers; i++)
        pthread_join(c->helper[i], NULL);
    pthread_cond_destroy(&c->work);
    pthread_cond_destroy(&c->done);
    pthread_mutex_destroy(&c->lock);
    *pool = NULL;
}

/* ---- The caller ---- */

void drape_parallel(drape_pool *pool, int64_t tasks, drape_task *run, void *user)
{
    drape_pool *c = pool;
    if (!c || c->helpers == 0 || tasks <= 1) {
        for (int64_t k = 0; k < tasks; k++)
            run(user, k);
        return;
    }
    assert(tasks <= INT32_MAX);
    /* The loop is written before its tasks are opened. `open` and `asleep` are both sequentially consistent:
     * a helper that goes to sleep counts itself before it reads `open` for the last time. */
    const uint_fast64_t loop = (atomic_load_explicit(&c->open, memory_order_relaxed) >> 32) + 1;
    atomic_store_explicit(&c->run, run, memory_order_relaxed);
    atomic_store_explicit(&c->user, user, memory_order_relaxed);
    atomic_store_explicit(&c->tasks, tasks, memory_order_relaxed);
    atomic_store_explicit(&c->unfinished, tasks, memory_order_relaxed);
    atomic_store(&c->open, loop << 32 | (uint_fast64_t)tasks);
    if (atomic_load(&c->asleep))
        wake(c);
    run_tasks(c);
    for (int i = 0; i < CALLER_SPINS && atomic_load(&c->unfinished); i++)
        sched_yield();
    if (!atomic_load(&c->unfinished))
        return;
    pthread_mutex_lock(&c->lock);
    atomic_store(&c->waiting, true);
    while (atomic_load(&c->unfinished))
        pthread_cond_wait(&c->done, &c->lock);
    atomic_store(&c->waiting, false);
    pthread_mutex_unlock(&c->lock);
}
