/*
 * elimination.c: see elimination.h. The stages: order by minimum degree (AMD) or, for larger patterns if
 * METIS is in the build, by nested dissection; elimination tree with path compression (Liu 1990, The role
 * of elimination trees in sparse factorization); postorder; the rows of each column from those of its
 * children. Finally a front is merged with its last child where one front takes less time than two, even
 * with the zeros that this adds.
 */
#define _XOPEN_SOURCE 700 /* initstate */
#include "solvers/elimination.h"

#include <amd.h>
#include <stdlib.h>
#include <string.h>
#ifdef DRAPE_METIS
#include <metis.h>
#include <pthread.h>
#include <signal.h>
#endif

#define DISSECTED 1500 /* block columns; below, nested dissection gives no less fill-in than minimum degree */

/* Workspace of the construction. */
typedef struct maker {
    drape_arena *arena, scratch;
    const drape_pattern *pattern;
    drape_elimination *e;
    int32_t *parent, *post, *head, *next, *mark, *stack; /* (n) by column; head, next: lists of children */
    int32_t **rows;                                      /* (n) by front, allocated as they are found */
    int32_t *length;                                     /* (n) number of rows by front */
} maker;

/* ---- Order and tree ---- */

#ifdef DRAPE_METIS
/* [bytes] the size of the state that rand() starts with, so that it gives the same numbers */
#define RAND_STATE 128

static pthread_mutex_t metis_mutex = PTHREAD_MUTEX_INITIALIZER; /* of the whole process, as rand() is */

static bool dissect(maker *m)
{
    const drape_pattern *p = m->pattern;
    idx_t n = p->block_count, at = 0, options[METIS_NOPTIONS];
    idx_t *start = drape_arena_take(&m->scratch, (size_t)n + 1, sizeof *start);
    idx_t *other = drape_arena_take(&m->scratch, (size_t)p->block_start[n] + 1, sizeof *other);
    if (drape_arena_status(&m->scratch))
        return false;
    for (idx_t j = 0; j < n; j++) {
        for (int32_t k = p->block_start[j]; k < p->block_start[j + 1]; k++)
            if (p->block_row[k] != j)
                other[at++] = p->block_row[k];
        start[j + 1] = at;
    }
    METIS_SetDefaultOptions(options);
    /* METIS seeds rand() and draws its cuts from it. rand() belongs to the whole process: two concurrent
     * calls would take each other's numbers and so find another order, with other bits in the results, and
     * the host's own sequence would restart. So only one thread at a time calls METIS, with a separate
     * state of rand(). A host that calls rand() from another thread meanwhile still disturbs it. METIS
     * also installs handlers of SIGTERM and SIGABRT, out of which it jumps back and fails. The thread
     * blocks both signals meanwhile and then delivers them to the handlers of before. */
    char own[RAND_STATE];
    sigset_t trapped, mask;
    struct sigaction terminate, abort;
    sigemptyset(&trapped);
    sigaddset(&trapped, SIGTERM);
    sigaddset(&trapped, SIGABRT);
    pthread_mutex_lock(&metis_mutex);
    pthread_sigmask(SIG_BLOCK, &trapped, &mask);
    sigaction(SIGTERM, NULL, &terminate);
    sigaction(SIGABRT, NULL, &abort);
    char *before = initstate(1, own, sizeof own);
    const int code = METIS_NodeND(&n, start, other, NULL, options, m->e->order, m->e->place);
    if (before)
        setstate(before);
    sigaction(SIGTERM, &terminate, NULL);
    sigaction(SIGABRT, &abort, NULL);
    pthread_sigmask(SIG_SETMASK, &mask, NULL);
    pthread_mutex_unlock(&metis_mutex);
    return code == METIS_OK;
}
_Static_assert(sizeof(idx_t) == sizeof(int32_t), "METIS orders with the pattern's integers");
#endif

static bool order(maker *m)
{
    const drape_pattern *p = m->pattern;
#ifdef DRAPE_METIS
    if (p->block_count >= DISSECTED)
        return dissect(m);
#endif
    return amd_order(p->block_count, p->block_start, p->block_row, m->e->order, NULL, NULL) >= AMD_OK;
}

static void invert(maker *m)
{
    for (int32_t k = 0; k < m->e->n; k++)
        m->e->place[m->e->order[k]] = k;
}

static void find_parents(maker *m)
{
    const drape_pattern *p = m->pattern;
    int32_t *ancestor = m->mark;
    for (int32_t j = 0; j < m->e->n; j++) {
        const int32_t column = m->e->order[j];
        m->parent[j] = ancestor[j] = -1;
        for (int32_t k = p->block_start[column]; k < p->block_start[column + 1]; k++)
            for (int32_t i = m->e->place[p->block_row[k]], up; i != -1 && i < j; i = up) {
                up = ancestor[i];
                ancestor[i] = j;
                if (up == -1)
                    m->parent[i] = j;
            }
    }
}

/* A depth-first walk without recursion: a column is written when it has no children left. */
static void find_postorder(maker *m)
{
    int32_t written = 0;
    for (int32_t i = 0; i < m->e->n; i++)
        m->head[i] = -1;
    for (int32_t i = m->e->n - 1; i >= 0; i--)
        if (m->parent[i] >= 0) {
            m->next[i] = m->head[m->parent[i]];
            m->head[m->parent[i]] = i;
        }
    for (int32_t root = 0; root < m->e->n; root++) {
        int32_t depth = 0;
        if (m->parent[root] >= 0)
            continue;
        m->stack[depth++] = root;
        while (depth > 0) {
            const int32_t j = m->stack[depth - 1], child = m->head[j];
            if (child < 0) {
                m->post[written++] = j;
                depth--;
            } else {
                m->head[j] = m->next[child];
                m->stack[depth++] = child;
            }
        }
    }
}

/* ---- Fronts ---- */

/* Time of a front in arbitrary units: arithmetic in tiles of 4 x 4 blocks, memory traffic, overhead. */
static double cost_of(int32_t columns, int32_t rows)
{
    const double w = 3.0 * columns, r = 12.0 * ((rows + 3) / 4), d = 12.0 * ((columns + 3) / 4);
    return (w * d * d / 3 + w * d * r + w * r * r) / 12 + 0.5 * w * (d + r) + 0.75 * r * r + 400;
}

static int compare(const void *a, const void *b)
{
    int32_t x = *(const int32_t *)a, y = *(const int32_t *)b;
    return (x > y) - (x < y);
}

/* Adds a row to the `count` rows below j in m->stack, unless it is among them. Returns their number. */
static int32_t add_row(maker *m, int32_t j, int32_t row, int32_t count)
{
    if (row <= j || m->mark[row] == j)
        return count;
    m->mark[row] = j;
    m->stack[count] = row;
    return count + 1;
}

/* Ends front f: its rows are those of its first column that lie beyond its last column. It is listed as a
 * child of the column above. */
static void close_front(maker *m, int32_t f)
{
    drape_elimination *e = m->e;
    const int32_t last = e->first[f + 1] - 1;
    int32_t kept = 0;
    for (int32_t k = 0; k < m->length[f]; k++)
        if (m->rows[f][k] > last)
            m->rows[f][kept++] = m->rows[f][k];
    m->length[f] = kept;
    if (kept > 0) {
        const int32_t up = m->parent[last];
        m->next[f] = m->head[up];
        m->head[up] = f;
    }
}

/* Groups consecutive columns with the same rows below them into fronts. */
static bool find_fronts(maker *m)
{
    drape_elimination *e = m->e;
    int32_t f = -1, before = 0; /* rows of column j - 1 */
    for (int32_t j = 0; j < e->n; j++)
        m->head[j] = m->mark[j] = -1;
    for (int32_t j = 0; j < e->n; j++) {
        const bool linked = j > 0 && m->parent[j - 1] == j;
        if (f >= 0) { /* so that the column above, j or a later one, sees its rows */
            e->first[f + 1] = j;
            if (!linked)
                close_front(m, f);
        }
        /* m->stack gets the rows below j: those of column j of the matrix and those of the fronts that end
         * in children of j. */
        const drape_pattern *p = m->pattern;
        const int32_t column = m->e->order[j];
        int32_t count = 0;
        for (int32_t i = p->block_start[column]; i < p->block_start[column + 1]; i++)
            count = add_row(m, j, m->e->place[p->block_row[i]], count);
        for (int32_t n = m->head[j]; n >= 0; n = m->next[n])
            for (int32_t i = 0; i < m->length[n]; i++)
                count = add_row(m, j, m->rows[n][i], count);
        for (int32_t k = 0; linked && k < m->length[f]; k++)
            count = add_row(m, j, m->rows[f][k], count);
        if (linked && count == before - 1) {
            before = count;
            continue;
        }
        if (linked)
            close_front(m, f);
        e->first[++f] = j;
        m->rows[f] = drape_arena_take(&m->scratch, (size_t)count, sizeof **m->rows);
        if (!m->rows[f])
            return false;
        qsort(m->stack, (size_t)count, sizeof *m->stack, compare);
        memcpy(m->rows[f], m->stack, (size_t)count * sizeof **m->rows);
        m->length[f] = before = count;
    }
    if (f >= 0) {
        e->first[f + 1] = e->n;
        close_front(m, f);
    }
    e->count = f + 1;
    return true;
}

/* Whether front f takes less time when merged with its last child g. */
static bool is_better_merged(const maker *m, int32_t first, int32_t middle, int32_t last, int32_t g,
                             int32_t f)
{
    const int32_t w = last - first;
    return cost_of(w, m->length[f]) <=
           cost_of(middle - first, m->length[g]) + cost_of(last - middle, m->length[f]);
}

/* The fronts are pushed on a stack that overwrites their list; when a front is pushed, its last child is on
 * top. */
static void merge_fronts(maker *m)
{
    drape_elimination *e = m->e;
    int32_t top = -1;
    for (int32_t f = 0; f < e->count; f++) {
        const int32_t last = e->first[f + 1];
        int32_t first = e->first[f];
        while (top >= 0 && m->length[top] > 0 && m->rows[top][0] < last &&
               is_better_merged(m, e->first[top], first, last, top, f)) {
            first = e->first[top--];
        }
        top++;
        m->rows[top] = m->rows[f];
        m->length[top] = m->length[f];
        e->first[top] = first;
    }
    e->count = top + 1;
    e->first[e->count] = e->n;
}

/* ---- Result ---- */

int32_t drape_front_find(const drape_elimination *e, int32_t front, int32_t row)
{
    if (row < e->first[front + 1])
        return row - e->first[front];
    const int32_t *rows = e->row + e->row_start[front];
    int32_t low = 0, high = drape_front_rows(e, front);
    while (high - low > 1) {
        int32_t middle = low + (high - low) / 2;
        if (rows[middle] <= row)
            low = middle;
        else
            high = middle;
    }
    return drape_front_columns(e, front) + low;
}

static size_t row_bytes(const drape_pattern *p)
{
    return (size_t)p->block_start[p->block_count] * sizeof *p->block_row;
}

static drape_status make(maker *m)
{
    drape_elimination *e = m->e;
    const size_t n = (size_t)e->n;
    int32_t **arrays[] = {&m->parent, &m->post, &m->head, &m->next, &m->mark, &m->stack, &m->length};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        *arrays[i] = drape_arena_take(&m->scratch, n, sizeof(int32_t));
    m->rows = drape_arena_take(&m->scratch, n, sizeof *m->rows);
    e->order = drape_arena_take(m->arena, n, sizeof *e->order);
    e->place = drape_arena_take(m->arena, n, sizeof *e->place);
    e->first = drape_arena_take(m->arena, n + 1, sizeof *e->first);
    if (drape_arena_status(&m->scratch) || drape_arena_status(m->arena))
        return DRAPE_E_MEMORY;
    if (!order(m))
        return drape_fail_memory(m->arena->ctx, row_bytes(m->pattern));
    invert(m);
    find_parents(m);
    find_postorder(m);
    /* Replaces the order by the postorder of the tree, in which the columns of a front are neighbours. */
    for (int32_t k = 0; k < m->e->n; k++)
        m->stack[k] = m->e->order[m->post[k]];
    memcpy(m->e->order, m->stack, (size_t)m->e->n * sizeof *m->stack);
    invert(m);
    find_parents(m);
    if (!find_fronts(m))
        return DRAPE_E_MEMORY;
    merge_fronts(m);
    int32_t *front_of = m->mark;
    e->parent = drape_arena_take(m->arena, (size_t)e->count, sizeof *e->parent);
    e->work = drape_arena_take(m->arena, (size_t)e->count, sizeof *e->work);
    e->row_start = drape_arena_take(m->arena, (size_t)e->count + 1, sizeof *e->row_start);
    if (drape_arena_status(m->arena))
        return DRAPE_E_MEMORY;
    for (int32_t f = 0; f < e->count; f++) {
        e->row_start[f + 1] = e->row_start[f] + m->length[f];
        for (int32_t j = e->first[f]; j < e->first[f + 1]; j++)
            front_of[j] = f;
    }
    e->row = drape_arena_take(m->arena, (size_t)e->row_start[e->count], sizeof *e->row);
    e->in_parent = drape_arena_take(m->arena, (size_t)e->row_start[e->count], sizeof *e->in_parent);
    if (drape_arena_status(m->arena))
        return DRAPE_E_MEMORY;
    for (int32_t f = 0; f < e->count; f++) {
        memcpy(e->row + e->row_start[f], m->rows[f], (size_t)m->length[f] * sizeof *e->row);
        e->parent[f] = m->length[f] > 0 ? front_of[m->rows[f][0]] : -1;
        e->work[f] = cost_of(drape_front_columns(e, f), m->length[f]);
    }
    for (int32_t f = 0; f < e->count; f++)
        for (int64_t k = e->row_start[f]; k < e->row_start[f + 1]; k++)
            e->in_parent[k] = drape_front_find(e, e->parent[f], e->row[k]);
    return DRAPE_OK;
}

/* ---- Sharing ---- */

struct drape_shared_elimination {
    drape_elimination e;
    drape_arena arena;                /* of its arrays and the next two */
    int32_t *block_start, *block_row; /* of its pattern, which need not live as long */
    int64_t users;
    drape_shared_elimination *next; /* of the same context */
};

static size_t start_bytes(const drape_pattern *p)
{
    return ((size_t)p->block_count + 1) * sizeof *p->block_start;
}

static drape_status make_shared(drape_shared_elimination *shared, const drape_pattern *pattern)
{
    maker m = {.arena = &shared->arena,
               .scratch = drape_arena_of(shared->arena.ctx),
               .pattern = pattern,
               .e = &shared->e};
    shared->e.n = pattern->block_count;
    shared->block_start = drape_arena_take(&shared->arena, start_bytes(pattern), 1);
    shared->block_row = drape_arena_take(&shared->arena, row_bytes(pattern), 1);
    if (drape_arena_status(&shared->arena))
        return DRAPE_E_MEMORY;
    memcpy(shared->block_start, pattern->block_start, start_bytes(pattern));
    memcpy(shared->block_row, pattern->block_row, row_bytes(pattern));
    const drape_status status = make(&m);
    drape_arena_free(&m.scratch);
    return status;
}

drape_status drape_elimination_share(drape_context *ctx, const drape_pattern *pattern,
                                     drape_shared_elimination **out)
{
    drape_shared_elimination *shared = ctx->eliminations;
    *out = NULL;
    while (shared && !(shared->e.n == pattern->block_count &&
                       memcmp(shared->block_start, pattern->block_start, start_bytes(pattern)) == 0 &&
                       memcmp(shared->block_row, pattern->block_row, row_bytes(pattern)) == 0))
        shared = shared->next;
    if (shared) {
        shared->users++;
        *out = shared;
        return DRAPE_OK;
    }
    if (!(shared = drape_alloc(ctx, 1, sizeof *shared)))
        return DRAPE_E_MEMORY;
    *shared = (drape_shared_elimination){.arena = drape_arena_of(ctx), .users = 1};
    const drape_status status = make_shared(shared, pattern);
    if (status) {
        drape_arena_free(&shared->arena);
        drape_free(ctx, shared);
        return status;
    }
    shared->next = ctx->eliminations;
    ctx->eliminations = *out = shared;
    return DRAPE_OK;
}

void drape_elimination_release(drape_shared_elimination **out)
{
    drape_shared_elimination *shared = *out;
    *out = NULL;
    if (!shared || --shared->users > 0)
        return;
    drape_context *ctx = shared->arena.ctx;
    drape_shared_elimination **at = &ctx->eliminations;
    while (*at != shared)
        at = &(*at)->next;
    *at = shared->next;
    drape_arena_free(&shared->arena);
    drape_free(ctx, shared);
}

const drape_elimination *drape_elimination_of(const drape_shared_elimination *shared)
{
    return &shared->e;
}

size_t drape_elimination_bytes(const drape_shared_elimination *shared)
{
    return sizeof *shared + shared->arena.bytes;
}
