/*
 * test_thread_pool.c: loops whose tasks are shared out to threads. Every task runs once, by the function of
 * its own loop, before the loop returns, for any number of tasks and threads; helpers that sleep are woken;
 * a caller runs all tasks that no helper takes.
 */
#include "base/thread_pool.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <string.h>
#include <time.h>

#include "support/suite.h"

#define MAX_TASKS 257

/* What a loop has written: a number of its own, and the thread. */
typedef struct ledger {
    int64_t sign;
    int64_t entry[MAX_TASKS]; /* sign + task */
    pthread_t by[MAX_TASKS];
    int times[MAX_TASKS];
} ledger;

static void enter(void *user, int64_t task)
{
    ledger *l = user;
    l->entry[task] = l->sign + task;
    l->by[task] = pthread_self();
    l->times[task]++;
}

/* Another function, so that a task of one loop run by the function of another one shows. */
static void enter_twice(void *user, int64_t task)
{
    enter(user, task);
    enter(user, task);
}

static void check_loop(drape_pool *pool, ledger *l, int64_t sign, int tasks)
{
    const bool twice = sign % 2;
    memset(l, 0, sizeof *l);
    l->sign = sign;
    drape_parallel(pool, tasks, twice ? enter_twice : enter, l);
    for (int k = 0; k < MAX_TASKS; k++) {
        ck_assert_int_eq(l->times[k], k < tasks ? 1 + twice : 0);
        ck_assert_int_eq(l->entry[k], k < tasks ? sign + k : 0);
    }
}

TEST(every_task_runs_once)
{
    static ledger l;
    scoped_context *ctx = make_context();
    drape_arena arena = drape_arena_of(ctx);
    for (int threads = 1; threads <= 5; threads++) {
        drape_pool *pool = NULL;
        ck_assert_int_eq(drape_pool_create(&arena, threads, &pool), DRAPE_OK);
        ck_assert_int_eq(drape_pool_threads(pool), threads);
        ck_assert_int_eq(pool != NULL, threads > 1);
        for (int k = 0; k < 400; k++)
            check_loop(pool, &l, 1000 * k + k, k % MAX_TASKS + k % 2);
        drape_pool_destroy(&pool);
        ck_assert_ptr_null(pool);
    }
    drape_arena_free(&arena);
}

/* Between two loops the helpers fall asleep; the next loop wakes them. Each of the two tasks lasts until
 * another thread has begun the other one, so the loop would not end without a helper. */
static atomic_int here;

static void meet(void *user, int64_t task)
{
    (void)user, (void)task;
    atomic_fetch_add(&here, 1);
    while (atomic_load(&here) < 2)
        sched_yield();
}

TEST(helpers_that_sleep_are_woken)
{
    scoped_context *ctx = make_context();
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
}

/* A helper is busy with a task: the caller runs all others meanwhile. The first task that a helper takes
 * waits until all others are done; a pool that assigned tasks to threads beforehand would never end. */
typedef struct blocked {
    pthread_t caller;
    atomic_int done, blocked;
} blocked;

static void block(void *user, int64_t task)
{
    blocked *h = user;
    (void)task;
    if (!pthread_equal(pthread_self(), h->caller) && !atomic_exchange(&h->blocked, 1))
        while (atomic_load(&h->done) < MAX_TASKS - 1)
            sched_yield();
    atomic_fetch_add(&h->done, 1);
}

TEST(the_caller_does_what_no_helper_takes)
{
    scoped_context *ctx = make_context();
    drape_arena arena = drape_arena_of(ctx);
    drape_pool *pool = NULL;
    ck_assert_int_eq(drape_pool_create(&arena, 2, &pool), DRAPE_OK);
    for (int k = 0; k < 200; k++) {
        blocked h = {.caller = pthread_self()};
        drape_parallel(pool, MAX_TASKS, block, &h);
        ck_assert_int_eq(h.done, MAX_TASKS);
    }
    drape_pool_destroy(&pool);
    drape_arena_free(&arena);
}

/* Two pools do not affect each other, and a pool serves any thread that calls it. */
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

TEST(pools_work_beside_each_other)
{
    scoped_context *ctx = make_context();
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
}
