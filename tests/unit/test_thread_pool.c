/*
 * test_crew.c: loops dealt out to threads. Every round is done once, by the function of its own loop, before
 * the loop returns, whatever the number of rounds and threads; helpers that slept come again; a caller whose
 * helpers do not come does all.
 */
#include "base/thread_pool.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <string.h>
#include <time.h>

#include "support/suite.h"

#define MOST 257

/* A loop that writes a number of its own, and who wrote it. */
typedef struct ledger {
    int64_t sign;
    int64_t entry[MOST]; /* sign + round */
    pthread_t by[MOST];
    int times[MOST];
} ledger;

static void enter(void *user, int64_t round)
{
    ledger *l = user;
    l->entry[round] = l->sign + round;
    l->by[round] = pthread_self();
    l->times[round]++;
}

/* Another one, so that a round of one loop by the function of the other shows. */
static void enter_twice(void *user, int64_t round)
{
    enter(user, round);
    enter(user, round);
}

static drape_context *open_context(void)
{
    drape_context *ctx = NULL;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    return ctx;
}

static void check_loop(drape_pool *pool, ledger *l, int64_t sign, int rounds)
{
    const bool twice = sign % 2;
    memset(l, 0, sizeof *l);
    l->sign = sign;
    drape_parallel(pool, rounds, twice ? enter_twice : enter, l);
    for (int k = 0; k < MOST; k++) {
        ck_assert_int_eq(l->times[k], k < rounds ? 1 + twice : 0);
        ck_assert_int_eq(l->entry[k], k < rounds ? sign + k : 0);
    }
}

START_TEST(every_round_is_done_once)
{
    static ledger l;
    drape_context *ctx = open_context();
    drape_arena arena = drape_arena_of(ctx);
    for (int threads = 1; threads <= 5; threads++) {
        drape_pool *pool = NULL;
        ck_assert_int_eq(drape_pool_create(&arena, threads, &pool), DRAPE_OK);
        ck_assert_int_eq(drape_pool_threads(pool), threads);
        ck_assert_int_eq(pool != NULL, threads > 1);
        for (int k = 0; k < 400; k++)
            check_loop(pool, &l, 1000 * k + k, k % MOST + k % 2);
        drape_pool_destroy(&pool);
        ck_assert_ptr_null(pool);
    }
    drape_arena_free(&arena);
    drape_context_destroy(&ctx);
}
END_TEST

/* Between two loops helpers fall asleep; the next one wakes them. A round here lasts until another thread
 * takes the other one, so that the loop would not end if none came. */
static atomic_int here;

static void meet(void *user, int64_t round)
{
    (void)user, (void)round;
    atomic_fetch_add(&here, 1);
    while (atomic_load(&here) < 2)
        sched_yield();
}

START_TEST(helpers_that_sleep_are_woken)
{
    drape_context *ctx = open_context();
    drape_arena arena = drape_arena_of(ctx);
    drape_pool *pool = NULL;
    ck_assert_int_eq(drape_pool_create(&arena, 2, &pool), DRAPE_OK);
    for (int k = 0; k < 20; k++) {
        nanosleep(&(struct timespec){.tv_nsec = 2000000}, NULL);
        atomic_store(&here, 0);
        drape_parallel(pool, 2, meet, NULL);
        ck_assert_int_eq(atomic_load(&here), 2);
    }
    drape_pool_destroy(&pool);
    drape_arena_free(&arena);
    drape_context_destroy(&ctx);
}
END_TEST

/* Helpers in the middle of a round of theirs: the caller does all others meanwhile. The first round that a
 * helper takes waits for all others to be done; a team whose rounds were dealt out beforehand would never
 * end. */
typedef struct held {
    pthread_t caller;
    atomic_int done, held;
} held;

static void hold(void *user, int64_t round)
{
    held *h = user;
    (void)round;
    if (!pthread_equal(pthread_self(), h->caller) && !atomic_exchange(&h->held, 1))
        while (atomic_load(&h->done) < MOST - 1)
            sched_yield();
    atomic_fetch_add(&h->done, 1);
}

START_TEST(the_caller_does_what_no_helper_takes)
{
    drape_context *ctx = open_context();
    drape_arena arena = drape_arena_of(ctx);
    drape_pool *pool = NULL;
    ck_assert_int_eq(drape_pool_create(&arena, 2, &pool), DRAPE_OK);
    for (int k = 0; k < 200; k++) {
        held h = {.caller = pthread_self()};
        drape_parallel(pool, MOST, hold, &h);
        ck_assert_int_eq(h.done, MOST);
    }
    drape_pool_destroy(&pool);
    drape_arena_free(&arena);
    drape_context_destroy(&ctx);
}
END_TEST

/* Two pools do not see each other, and a pool works for whatever thread calls. */
static void *loop_often(void *pool)
{
    ledger l;
    for (int k = 0; k < 400; k++) {
        memset(&l, 0, sizeof l);
        drape_parallel(pool, 7, enter, &l);
        for (int r = 0; r < 7; r++)
            if (l.times[r] != 1)
                return pool;
    }
    return NULL;
}

START_TEST(pools_work_beside_each_other)
{
    drape_context *ctx = open_context();
    drape_arena arena = drape_arena_of(ctx);
    drape_pool *pools[2];
    for (int repeat = 0; repeat < 3; repeat++) {
        pthread_t callers[2];
        for (int i = 0; i < 2; i++) {
            ck_assert_int_eq(drape_pool_create(&arena, 3, &pools[i]), DRAPE_OK);
            ck_assert_int_eq(pthread_create(&callers[i], NULL, loop_often, pools[i]), 0);
        }
        for (int i = 0; i < 2; i++) {
            void *wrong = NULL;
            ck_assert_int_eq(pthread_join(callers[i], &wrong), 0);
            ck_assert_ptr_null(wrong);
            ck_assert_ptr_null(loop_often(pools[i]));
            drape_pool_destroy(&pools[i]);
        }
    }
    drape_arena_free(&arena);
    drape_context_destroy(&ctx);
}
END_TEST

SUITE("thread_pool", every_round_is_done_once, helpers_that_sleep_are_woken,
      the_caller_does_what_no_helper_takes, pools_work_beside_each_other)
