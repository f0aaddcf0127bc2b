/* threads_as_ranks.h: ranks (base/ranks.h) that are threads of one process, with what the solvers need of
 * them. */
#ifndef DRAPE_TESTS_THREADS_AS_RANKS_H
#define DRAPE_TESTS_THREADS_AS_RANKS_H

#include "base/arena.h"
#include "base/ranks.h"

#include <pthread.h>
#include <string.h>

#define MOST_RANKS 8

typedef struct team {
    pthread_barrier_t barrier;
    const void *shown[MOST_RANKS][2]; /* what each rank lets the others read between two barriers */
} team;

typedef struct member {
    drape_ranks base;
    team *team;
} member;

struct drape_exchange {
    int32_t count, *rank, *place;
};

static inline team *show(const drape_ranks *ranks, const void *first, const void *second)
{
    team *t = ((const member *)ranks)->team; /* base is its first member */
    t->shown[ranks->rank][0] = first;
    t->shown[ranks->rank][1] = second;
    pthread_barrier_wait(&t->barrier);
    return t;
}

static inline void hide(team *t)
{
    pthread_barrier_wait(&t->barrier);
}

static inline void reduce(const drape_ranks *ranks, double *values, int n, bool largest)
{
    double result[16];
    team *t = show(ranks, values, NULL);
    for (int i = 0; i < n; i++) {
        result[i] = ((const double *)t->shown[0][0])[i];
        for (int k = 1; k < ranks->count; k++) {
            const double there = ((const double *)t->shown[k][0])[i];
            result[i] = !largest ? result[i] + there : there > result[i] || isnan(there) ? there : result[i];
        }
    }
    hide(t);
    memcpy(values, result, (size_t)n * sizeof *values);
}

static inline void team_sum(const drape_ranks *ranks, double *values, int n)
{
    reduce(ranks, values, n, false);
}

static inline void team_largest(const drape_ranks *ranks, double *values, int n)
{
    reduce(ranks, values, n, true);
}

static inline void team_broadcast(const drape_ranks *ranks, int from, void *bytes, int size)
{
    team *t = show(ranks, bytes, NULL);
    if (from != ranks->rank)
        memcpy(bytes, t->shown[from][0], (size_t)size);
    hide(t);
}

static inline drape_exchange *team_plan(const drape_ranks *ranks, drape_arena *arena, int32_t count,
                                        const int32_t *rank, const int32_t *place, size_t largest)
{
    drape_exchange *x = drape_arena_take(arena, 1, sizeof *x);
    const size_t size = (size_t)count * sizeof *rank;
    int32_t *copied = drape_arena_take(arena, 2, size);
    (void)largest;
    if (drape_ranks_agree(ranks, arena->ctx, x && copied ? DRAPE_OK : DRAPE_E_MEMORY))
        return NULL;
    x->count = count;
    x->rank = copied;
    x->place = copied + count;
    memcpy(x->rank, rank, size);
    memcpy(x->place, place, size);
    return x;
}

static inline void team_copy(const drape_ranks *ranks, const drape_exchange *x, const void *own, void *copies,
                             size_t size)
{
    team *t = show(ranks, own, NULL);
    for (size_t i = 0; i < (size_t)x->count; i++)
        memcpy((char *)copies + size * i, (const char *)t->shown[x->rank[i]][0] + size * (size_t)x->place[i],
               size);
    hide(t);
}

static inline void team_add(const drape_ranks *ranks, const drape_exchange *x, double *own,
                            const double *copies, int width)
{
    team *t = show(ranks, x, copies);
    for (int k = 0; k < ranks->count; k++) {
        const drape_exchange *there = t->shown[k][0];
        const double *from = t->shown[k][1];
        for (int32_t i = 0; i < there->count; i++)
            for (int c = 0; there->rank[i] == ranks->rank && c < width; c++)
                own[(int64_t)width * there->place[i] + c] += from[(int64_t)width * i + c];
    }
    hide(t);
}

static inline void team_share(const drape_ranks *ranks, void *all, const int32_t *first, size_t size)
{
    team *t = show(ranks, all, NULL);
    for (int k = 0; k < ranks->count; k++) {
        const size_t at = size * (size_t)first[k], bytes = size * (size_t)(first[k + 1] - first[k]);
        if (k != ranks->rank)
            memcpy((char *)all + at, (const char *)t->shown[k][0] + at, bytes);
    }
    hide(t);
}

static inline member member_of(team *t, int rank, int count)
{
    return (member){.base = {.rank = rank,
                             .count = count,
                             .sum = team_sum,
                             .largest = team_largest,
                             .broadcast = team_broadcast,
                             .plan = team_plan,
                             .copy = team_copy,
                             .add = team_add,
                             .share = team_share},
                    .team = t};
}

typedef struct one_rank {
    member member;
    void (*run)(const drape_ranks *ranks, void *user);
    void *user;
} one_rank;

static inline void *start_rank(void *user)
{
    one_rank *r = user;
    r->run(&r->member.base, r->user);
    return NULL;
}

/* Calls run once for each rank, at the same time; returns when all are done. */
static inline bool run_ranks(int count, void (*run)(const drape_ranks *ranks, void *user), void *user)
{
    team t;
    pthread_t thread[MOST_RANKS];
    one_rank rank[MOST_RANKS];
    if (count > MOST_RANKS || pthread_barrier_init(&t.barrier, NULL, (unsigned)count))
        return false;
    int started = 0;
    for (; started < count; started++) {
        rank[started] = (one_rank){member_of(&t, started, count), run, user};
        if (pthread_create(&thread[started], NULL, start_rank, &rank[started]))
            return false;
    }
    for (int k = 0; k < count; k++)
        pthread_join(thread[k], NULL);
    pthread_barrier_destroy(&t.barrier);
    return true;
}

#endif
