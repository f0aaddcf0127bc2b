/*
 * crew.c: see crew.h. The rounds of a loop that no one has taken are a number, and a round is taken by making
 * it one less, if nothing has changed since it was read. The number of the loop is in the same word: whoever
 * read of a loop that is over takes nothing of the next one, whose round it would call with the other's
 * function. Who takes a round is for chance; what it writes is not.
 */
#include "base/crew.h"

#include <assert.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>

/* Looks before one sleeps, each of which lets others have the core, a third of a microsecond where there are
 * none: a millisecond or two, longer than the caller takes between two loops of one step. To wake a core that
 * has gone to sleep takes up to a tenth of that, each time; where a core is taken, longer looks cost nothing
 * that was measured. */
#define HELPER_LOOKS 5000
#define CALLER_LOOKS 3000
#define LEFT         0xffffffffu /* of `open`: rounds not taken; above it, the number of the loop */
#define APART        64 /* bytes: in one line of the cache, what one thread writes is taken from all others */

struct drape_crew {
    int threads, helpers;
    pthread_t *helper;    /* (threads - 1), of which helpers run */
    pthread_mutex_t lock; /* of who goes to sleep */
    pthread_cond_t work, done;
    /* The loop: written while no round of it is open, and read, of a loop that may be over, by whoever is
     * late. */
    _Atomic(drape_round *) one;
    _Atomic(void *) user;
    atomic_int_fast64_t rounds;
    char apart[APART];
    atomic_uint_fast64_t open;
    char apart_too[APART];
    atomic_int_fast64_t unfinished; /* rounds, less those that were told */
    atomic_int asleep;              /* helpers */
    atomic_bool waiting, ended;     /* waiting: the caller sleeps */
};

int drape_crew_threads(const drape_crew *crew)
{
    return crew ? crew->threads : 1;
}

/* ---- Rounds ---- */

/* Takes a round and does it; false where none is open. */
static bool do_round(drape_crew *c)
{
    uint_fast64_t open = atomic_load(&c->open);
    while (open & LEFT) {
        drape_round *one = atomic_load_explicit(&c->one, memory_order_relaxed);
        void *user = atomic_load_explicit(&c->user, memory_order_relaxed);
        const int64_t round = atomic_load_explicit(&c->rounds, memory_order_relaxed) - (int64_t)(open & LEFT);
        if (!atomic_compare_exchange_weak(&c->open, &open, open - 1))
            continue;
        one(user, round);
        return true;
    }
    return false;
}

/* As many as there are; all are of one loop, which does not end before they are told. */
static void do_rounds(drape_crew *c)
{
    int64_t done = 0;
    while (do_round(c))
        done++;
    if (done > 0 && atomic_fetch_sub(&c->unfinished, done) == done && atomic_load(&c->waiting)) {
        pthread_mutex_lock(&c->lock);
        pthread_cond_signal(&c->done);
        pthread_mutex_unlock(&c->lock);
    }
}

/* ---- Helpers ---- */

static bool is_called(drape_crew *c)
{
    return atomic_load(&c->open) & LEFT || atomic_load(&c->ended);
}

static void await_call(drape_crew *c)
{
    for (int i = 0; i < HELPER_LOOKS; i++) {
        if (is_called(c))
            return;
        sched_yield();
    }
    pthread_mutex_lock(&c->lock);
    atomic_fetch_add(&c->asleep, 1);
    while (!is_called(c))
        pthread_cond_wait(&c->work, &c->lock);
    atomic_fetch_sub(&c->asleep, 1);
    pthread_mutex_unlock(&c->lock);
}

static void *help(void *crew)
{
    drape_crew *c = crew;
    while (!atomic_load(&c->ended)) {
        await_call(c);
        do_rounds(c);
    }
    return NULL;
}

/* Signals are for the host's threads. */
static void start_helpers(drape_crew *c)
{
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    while (c->helpers < c->threads - 1 && !pthread_create(&c->helper[c->helpers], NULL, help, c))
        c->helpers++;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
}

drape_status drape_crew_create(drape_arena *arena, int threads, drape_crew **out)
{
    *out = NULL;
    if (threads <= 1)
        return DRAPE_OK;
    drape_crew *c = drape_arena_take(arena, 1, sizeof *c);
    pthread_t *helper = drape_arena_take(arena, (size_t)threads - 1, sizeof *helper);
    if (!c || !helper)
        return DRAPE_E_MEMORY;
    c->threads = threads;
    c->helper = helper;
    pthread_mutex_init(&c->lock, NULL);
    pthread_cond_init(&c->work, NULL);
    pthread_cond_init(&c->done, NULL);
    start_helpers(c);
    *out = c;
    return DRAPE_OK;
}

static void wake(drape_crew *c)
{
    pthread_mutex_lock(&c->lock);
    pthread_cond_broadcast(&c->work);
    pthread_mutex_unlock(&c->lock);
}

void drape_crew_destroy(drape_crew **crew)
{
    drape_crew *c = *crew;
    if (!c)
        return;
    atomic_store(&c->ended, true);
    wake(c);
    for (int i = 0; i < c->helpers; i++)
        pthread_join(c->helper[i], NULL);
    pthread_cond_destroy(&c->work);
    pthread_cond_destroy(&c->done);
    pthread_mutex_destroy(&c->lock);
    *crew = NULL;
}

/* ---- The caller ---- */

/* All is said before the rounds are open; the fence between `open` and `asleep` is that both are sequentially
 * consistent: a helper that goes to sleep has counted itself before it looks for the last time. */
static void call_helpers(drape_crew *c, int64_t rounds, drape_round *one, void *user)
{
    const uint_fast64_t loop = (atomic_load_explicit(&c->open, memory_order_relaxed) >> 32) + 1;
    atomic_store_explicit(&c->one, one, memory_order_relaxed);
    atomic_store_explicit(&c->user, user, memory_order_relaxed);
    atomic_store_explicit(&c->rounds, rounds, memory_order_relaxed);
    atomic_store_explicit(&c->unfinished, rounds, memory_order_relaxed);
    atomic_store(&c->open, loop << 32 | (uint_fast64_t)rounds);
    if (atomic_load(&c->asleep))
        wake(c);
}

static void await_helpers(drape_crew *c)
{
    for (int i = 0; i < CALLER_LOOKS; i++) {
        if (!atomic_load(&c->unfinished))
            return;
        sched_yield();
    }
    pthread_mutex_lock(&c->lock);
    atomic_store(&c->waiting, true);
    while (atomic_load(&c->unfinished))
        pthread_cond_wait(&c->done, &c->lock);
    atomic_store(&c->waiting, false);
    pthread_mutex_unlock(&c->lock);
}

void drape_parallel(drape_crew *crew, int64_t rounds, drape_round *one, void *user)
{
    if (!crew || crew->helpers == 0 || rounds <= 1) {
        for (int64_t k = 0; k < rounds; k++)
            one(user, k);
        return;
    }
    assert(rounds <= INT32_MAX);
    call_helpers(crew, rounds, one, user);
    do_rounds(crew);
    await_helpers(crew);
}
