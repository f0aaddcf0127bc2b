/* prolong.c: see prolong.h. */
#include "solvers/prolong.h"
#include "base/elementary.h"

#include <limits.h>
#include <math.h>
#include <string.h>

/* share of a node's value that each averaging takes from its neighbours */
#define SMOOTH (2.0 / 3)
/* share of the largest value at a node: smaller ones are dropped, the others scaled to add up to 1 */
#define DROP     0.08
#define WIDENING 1.1 /* of the spacing: fastest at 2 500 and 10 000 nodes (bench/speed) */

int drape_prolong_spacing(int32_t nodes)
{
    int spacing = (int)lround(WIDENING * drape_pow(nodes, 1.0 / 6));
    return spacing < 2 ? 2 : spacing;
}

/* ---- Aggregates ---- */

typedef struct front {
    int32_t *distance, *queue, *aggregate; /* (nodes) */
} front;

/* Assigns to a new seed all nodes that are nearer to it than to the earlier seeds. */
static void grow(const drape_graph *g, int32_t seed, int32_t id, int spacing, front *f)
{
    int32_t head = 0, tail = 0;
    f->queue[tail++] = seed;
    f->distance[seed] = 0;
    f->aggregate[seed] = id;
    while (head < tail) {
        int32_t node = f->queue[head++];
        if (f->distance[node] >= spacing)
            continue;
        for (int32_t k = g->start[node]; k < g->start[node + 1]; k++) {
            int32_t next = g->neighbor[k];
            if (f->distance[next] <= f->distance[node] + 1)
                continue;
            f->distance[next] = f->distance[node] + 1;
            f->aggregate[next] = id;
            f->queue[tail++] = next; /* once in each call: distances only grow along the search */
        }
    }
}

/* ---- Functions ---- */

/* The values at each node, as they are smoothed. */
typedef struct table {
    int32_t *count, *column; /* (nodes), (nodes x DRAPE_PROLONG_FUNCTIONS) */
    double *value;
} table;

static void add_value(table *t, int32_t node, int32_t column, double value)
{
    int32_t *columns = t->column + (size_t)node * DRAPE_PROLONG_FUNCTIONS, k = 0;
    while (k < t->count[node] && columns[k] != column)
        k++;
    if (k == DRAPE_PROLONG_FUNCTIONS)
        return;
    if (k == t->count[node]) {
        t->count[node]++;
        columns[k] = column;
        t->value[(size_t)node * DRAPE_PROLONG_FUNCTIONS + (size_t)k] = 0;
    }
    t->value[(size_t)node * DRAPE_PROLONG_FUNCTIONS + (size_t)k] += value;
}

static void add_row(table *to, int32_t node, const table *from, int32_t other, double factor)
{
    for (int32_t k = 0; k < from->count[other]; k++) {
        size_t at = (size_t)other * DRAPE_PROLONG_FUNCTIONS + (size_t)k;
        add_value(to, node, from->column[at], factor * from->value[at]);
    }
}

static double threshold(const table *t, int32_t node)
{
    double largest = 0;
    for (int32_t k = 0; k < t->count[node]; k++)
        largest = fmax(largest, t->value[(size_t)node * DRAPE_PROLONG_FUNCTIONS + (size_t)k]);
    return DROP * largest;
}

static int32_t kept(const table *t, int32_t node, double *sum)
{
    double least = threshold(t, node);
    int32_t count = 0;
    *sum = 0;
    for (int32_t k = 0; k < t->count[node]; k++) {
        double value = t->value[(size_t)node * DRAPE_PROLONG_FUNCTIONS + (size_t)k];
        count += value > least;
        *sum += value > least ? value : 0;
    }
    return count;
}

static drape_status pack(drape_arena *arena, const table *t, drape_prolong *out)
{
    int32_t total = 0, at = 0;
    double sum;
    for (int32_t i = 0; i < out->fine; i++)
        total += kept(t, i, &sum);
    out->start = drape_arena_take(arena, (size_t)out->fine + 1, sizeof *out->start);
    out->column = drape_arena_take(arena, (size_t)total, sizeof *out->column);
    out->weight = drape_arena_take(arena, (size_t)total, sizeof *out->weight);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < out->fine; i++) {
        out->start[i] = at;
        kept(t, i, &sum);
        double least = threshold(t, i);
        for (int32_t k = 0; k < t->count[i]; k++) {
            size_t from = (size_t)i * DRAPE_PROLONG_FUNCTIONS + (size_t)k;
            if (t->value[from] <= least)
                continue;
            out->column[at] = t->column[from];
            out->weight[at++] = t->value[from] / sum;
        }
    }
    out->start[out->fine] = at;
    return DRAPE_OK;
}

/* Aggregates of radius r overlap well after r averagings. */
static void make_functions(const drape_graph *g, int spacing, const front *f, table t[2])
{
    for (int32_t i = 0; i < g->count; i++) {
        t[0].count[i] = 0;
        add_value(&t[0], i, f->aggregate[i], 1);
    }
    int steps = spacing > 3 ? spacing - 2 : 1;
    for (int s = 0; s < steps; s++) {
        const table *from = &t[0];
        table *to = &t[1];
        for (int32_t i = 0; i < g->count; i++) {
            int32_t degree = g->start[i + 1] - g->start[i];
            to->count[i] = 0;
            add_row(to, i, from, i, degree ? 1 - SMOOTH : 1);
            for (int32_t k = g->start[i]; k < g->start[i + 1]; k++)
                add_row(to, i, from, g->neighbor[k], SMOOTH / degree);
        }
        table swap = t[0];
        t[0] = t[1];
        t[1] = swap;
    }
}

drape_status drape_prolong_build(drape_arena *arena, const drape_graph *g, int spacing, drape_prolong *out)
{
    const size_t nodes = (size_t)g->count;
    drape_arena scratch = drape_arena_of(arena->ctx);
    front f = {.distance = drape_arena_take(&scratch, nodes, sizeof *f.distance),
               .queue = drape_arena_take(&scratch, nodes, sizeof *f.queue),
               .aggregate = drape_arena_take(&scratch, nodes, sizeof *f.aggregate)};
    table t[2];
    for (int i = 0; i < 2; i++)
        t[i] =
            (table){.count = drape_arena_take(&scratch, nodes, sizeof *t->count),
                    .column = drape_arena_take(&scratch, nodes * DRAPE_PROLONG_FUNCTIONS, sizeof *t->column),
                    .value = drape_arena_take(&scratch, nodes * DRAPE_PROLONG_FUNCTIONS, sizeof *t->value)};
    *out = (drape_prolong){.fine = g->count};
    drape_status status = drape_arena_status(&scratch);
    if (!status) {
        /* Each next node that is `spacing` or more edges away from all seeds becomes one. */
        for (int32_t i = 0; i < g->count; i++)
            f.distance[i] = INT_MAX;
        for (int32_t i = 0; i < g->count; i++)
            if (f.distance[i] >= spacing)
                grow(g, i, out->coarse++, spacing, &f);
        make_functions(g, spacing, &f, t);
        status = pack(arena, &t[0], out);
    }
    drape_arena_free(&scratch);
    return status;
}

/* ---- Restriction and prolongation ---- */

void drape_prolong_restrict(const drape_prolong *p, const double *fine, double *coarse)
{
    memset(coarse, 0, 3 * (size_t)p->coarse * sizeof *coarse);
    for (int32_t i = 0; i < p->fine; i++)
        for (int32_t k = p->start[i]; k < p->start[i + 1]; k++)
            for (int c = 0; c < 3; c++)
                coarse[3 * (size_t)p->column[k] + (size_t)c] +=
                    p->weight[k] * fine[3 * (size_t)i + (size_t)c];
}

void drape_prolong_add(const drape_prolong *p, const double *coarse, double *fine)
{
    for (int32_t i = 0; i < p->fine; i++)
        for (int32_t k = p->start[i]; k < p->start[i + 1]; k++)
            for (int c = 0; c < 3; c++)
                fine[3 * (size_t)i + (size_t)c] +=
                    p->weight[k] * coarse[3 * (size_t)p->column[k] + (size_t)c];
}

/* ---- Coupled functions ---- */

/* The functions at one node that function a has not been coupled to yet (mark[b] != a), and marks them. to
 * NULL: only counts them. */
static int32_t meet_at(const drape_prolong *p, int32_t node, int32_t a, int32_t *mark, int32_t *to)
{
    int32_t count = 0;
    for (int32_t k = p->start[node]; k < p->start[node + 1]; k++) {
        int32_t b = p->column[k];
        if (mark[b] == a)
            continue;
        mark[b] = a;
        if (to)
            to[count] = b;
        count++;
    }
    return count;
}

static int32_t meet_row(const drape_prolong *p, const drape_graph *g, const int32_t *start,
                        const int32_t *node, int32_t a, int32_t *mark, int32_t *to)
{
    int32_t count = 0;
    for (int32_t n = start[a]; n < start[a + 1]; n++) {
        int32_t i = node[n];
        count += meet_at(p, i, a, mark, to ? to + count : NULL);
        for (int32_t k = g->start[i]; k < g->start[i + 1]; k++)
            count += meet_at(p, g->neighbor[k], a, mark, to ? to + count : NULL);
    }
    return count;
}

drape_status drape_prolong_meet(drape_arena *arena, const drape_prolong *p, const drape_graph *g,
                                int32_t **out_start, int32_t **out_neighbor)
{
    int32_t *start, *node, *mark = drape_arena_take(arena, (size_t)p->coarse, sizeof *mark);
    int32_t *rows = drape_arena_take(arena, (size_t)p->coarse + 1, sizeof *rows);
    /* The nodes at which each coarse function is nonzero: node[start[a]] ... node[start[a + 1] - 1]. */
    size_t total = (size_t)p->start[p->fine];
    start = drape_arena_take(arena, (size_t)p->coarse + 2, sizeof *start);
    node = drape_arena_take(arena, total, sizeof *node);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    for (size_t k = 0; k < total; k++)
        start[p->column[k] + 2]++;
    for (int32_t a = 1; a < p->coarse; a++)
        start[a + 1] += start[a];
    for (int32_t i = 0; i < p->fine; i++)
        for (int32_t k = p->start[i]; k < p->start[i + 1]; k++)
            node[start[p->column[k] + 1]++] = i;
    memset(mark, -1, (size_t)p->coarse * sizeof *mark);
    for (int32_t a = 0; a < p->coarse; a++)
        rows[a + 1] = rows[a] + meet_row(p, g, start, node, a, mark, NULL);
    int32_t *columns = drape_arena_take(arena, (size_t)rows[p->coarse], sizeof *columns);
    if (!columns)
        return DRAPE_E_MEMORY;
    memset(mark, -1, (size_t)p->coarse * sizeof *mark);
    for (int32_t a = 0; a < p->coarse; a++)
        meet_row(p, g, start, node, a, mark, columns + rows[a]);
    *out_start = rows;
    *out_neighbor = columns;
    return DRAPE_OK;
}
