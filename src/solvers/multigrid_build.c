/* multigrid_build.c: the aggregates, the patterns and the memory of all levels: see multigrid.h. */
#include "solvers/multigrid_parts.h"

#include <string.h>

#define DENSE      64  /* largest number of block rows that are factored as one dense matrix */
#define STAGNATION 0.7 /* of the rows of a level: with more on the next one, that is not made */
/* of the largest weight of a row: neighbours with less are in no aggregate of its, among nodes and among
 * aggregates */
#define CLOSE_NODES      0.8
#define CLOSE_AGGREGATES 0.5

/* The neighbours of each row, itself among them, and how near they are: for nodes, how many neighbours both
 * share; for aggregates, how many couplings are between them. */
typedef struct graph {
    int32_t count;
    int32_t *start, *neighbor, *weight;
} graph;

/* ---- Aggregates ---- */

/* mark (count) is scratch. */
static void count_shared(graph *g, int32_t *mark)
{
    memset(mark, -1, (size_t)g->count * sizeof *mark);
    for (int32_t i = 0; i < g->count; i++) {
        for (int32_t k = g->start[i]; k < g->start[i + 1]; k++)
            mark[g->neighbor[k]] = i;
        for (int32_t k = g->start[i]; k < g->start[i + 1]; k++)
            for (int32_t q = g->start[g->neighbor[k]]; q < g->start[g->neighbor[k] + 1]; q++)
                g->weight[k] += mark[g->neighbor[q]] == i;
    }
}

/* Drops the neighbours whose weight is below a share of the largest one of both rows: in a mesh the nodes
 * across an edge, which bending alone couples; in a grid of aggregates those at the corners. A smoothed
 * function of the next level reaches one coupling beyond its aggregate: between wide aggregates these
 * functions interpolate badly, which slows the bending modes most. largest (count) is scratch. */
static void drop_distant(graph *g, double share, int32_t *largest)
{
    memset(largest, 0, (size_t)g->count * sizeof *largest);
    for (int32_t i = 0; i < g->count; i++)
        for (int32_t k = g->start[i]; k < g->start[i + 1]; k++)
            if (g->neighbor[k] != i && g->weight[k] > largest[i])
                largest[i] = g->weight[k];
    int32_t total = 0;
    for (int32_t i = 0, k = 0; i < g->count; i++) {
        for (; k < g->start[i + 1]; k++) {
            const int32_t j = g->neighbor[k];
            if (j == i || g->weight[k] >= share * (largest[i] < largest[j] ? largest[i] : largest[j]))
                g->neighbor[total++] = j;
        }
        g->start[i + 1] = total;
    }
}

static bool is_free(const graph *g, const int32_t *aggregate, int32_t row)
{
    for (int32_t k = g->start[row]; k < g->start[row + 1]; k++)
        if (aggregate[g->neighbor[k]] >= 0)
            return false;
    return true;
}

/* A row whose neighbours all belong to no aggregate yet forms one with them; the rest then joins that of the
 * first neighbour that had one. Returns their number. */
static int32_t form_aggregates(const graph *g, int32_t *aggregate, int32_t *joined)
{
    int32_t count = 0;
    memset(aggregate, -1, (size_t)g->count * sizeof *aggregate);
    for (int32_t i = 0; i < g->count; i++) {
        if (g->start[i + 1] - g->start[i] == 1 || !is_free(g, aggregate, i))
            continue;
        for (int32_t k = g->start[i]; k < g->start[i + 1]; k++)
            aggregate[g->neighbor[k]] = count;
        count++;
    }
    memcpy(joined, aggregate, (size_t)g->count * sizeof *joined);
    for (int32_t i = 0; i < g->count; i++)
        for (int32_t k = g->start[i]; joined[i] < 0 && k < g->start[i + 1]; k++)
            joined[i] = aggregate[g->neighbor[k]];
    memcpy(aggregate, joined, (size_t)g->count * sizeof *joined);
    return count;
}

static void list_members(level *l)
{
    memset(l->member_start, 0, ((size_t)l->coarse + 2) * sizeof *l->member_start);
    for (int32_t i = 0; i < l->a.count; i++)
        if (l->aggregate[i] >= 0)
            l->member_start[l->aggregate[i] + 2]++;
    for (int32_t i = 0; i < l->coarse; i++)
        l->member_start[i + 2] += l->member_start[i + 1];
    for (int32_t i = 0; i < l->a.count; i++)
        if (l->aggregate[i] >= 0)
            l->member[l->member_start[l->aggregate[i] + 1]++] = i;
}

/* Aggregates are neighbours if rows in them are. Their matrix couples more of them, and aggregates of all
 * that it couples would be too large. */
static drape_status shrink(drape_arena *scratch, const level *l, const graph *g, graph *out)
{
    int32_t *at = drape_arena_take(scratch, (size_t)l->coarse, sizeof *at); /* of the last row with each */
    *out = (graph){.count = l->coarse,
                   .start = drape_arena_take(scratch, (size_t)l->coarse + 1, sizeof *out->start),
                   .neighbor = drape_arena_take(scratch, (size_t)g->start[g->count], sizeof *out->neighbor),
                   .weight = drape_arena_take(scratch, (size_t)g->start[g->count], sizeof *out->weight)};
    if (drape_arena_status(scratch))
        return DRAPE_E_MEMORY;
    memset(at, -1, (size_t)l->coarse * sizeof *at);
    int32_t total = 0;
    for (int32_t I = 0; I < l->coarse; I++) {
        for (int32_t n = l->member_start[I]; n < l->member_start[I + 1]; n++)
            for (int32_t k = g->start[l->member[n]]; k < g->start[l->member[n] + 1]; k++) {
                const int32_t J = l->aggregate[g->neighbor[k]];
                if (at[J] < out->start[I]) {
                    at[J] = total;
                    out->neighbor[total++] = J;
                }
                out->weight[at[J]]++;
            }
        out->start[I + 1] = total;
    }
    return DRAPE_OK;
}

/* ---- Patterns ---- */

/* Adds a number to an ascending list that does not have it. */
static int32_t insert(int32_t *list, int32_t count, int32_t value)
{
    int32_t at = count;
    while (at > 0 && list[at - 1] > value)
        at--;
    if (at > 0 && list[at - 1] == value)
        return count;
    memmove(list + at + 1, list + at, (size_t)(count - at) * sizeof *list);
    list[at] = value;
    return count + 1;
}

/* One smoothing of the aggregates' functions: they reach to their neighbours. */
static drape_status build_prolongation(drape_arena *arena, level *l)
{
    const matrix *a = &l->a;
    int32_t widest = 0, total = 0;
    for (int32_t i = 0; i < a->count; i++)
        widest = length(a, i) > widest ? (int32_t)length(a, i) : widest;
    l->p_start = drape_arena_take(arena, (size_t)a->count + 1, sizeof *l->p_start);
    int32_t *row = drape_arena_take(arena, (size_t)widest + 1, sizeof *row);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    for (int pass = 0; pass < 2; pass++) {
        total = 0;
        for (int32_t i = 0; i < a->count; i++) {
            int32_t count = 0;
            for (int32_t k = a->start[i]; k < a->start[i + 1]; k++)
                if (l->aggregate[a->column[k]] >= 0)
                    count = insert(row, count, l->aggregate[a->column[k]]);
            if (pass)
                memcpy(l->p_column + total, row, (size_t)count * sizeof *row);
            total += count;
            l->p_start[i + 1] = total;
        }
        if (!pass)
            l->p_column = drape_arena_take(arena, (size_t)total, sizeof *l->p_column);
        if (!l->p_column)
            return DRAPE_E_MEMORY;
    }
    drape_arena_release(arena, row);
    l->p = drape_arena_take(arena, (size_t)total * (size_t)a->size * MODES, sizeof *l->p);
    return drape_arena_status(arena);
}

/* The columns of the coarse row I: those of the prolongation at the neighbours of all rows where function I
 * is nonzero. Rows are given by the transposed prolongation. */
static int32_t meet(const level *l, const int32_t *start, const int32_t *row, int32_t I, int32_t *mark,
                    int32_t *columns)
{
    const matrix *a = &l->a;
    int32_t count = 0;
    for (int32_t n = start[I]; n < start[I + 1]; n++)
        for (int32_t k = a->start[row[n]]; k < a->start[row[n] + 1]; k++)
            for (int32_t q = l->p_start[a->column[k]]; q < l->p_start[a->column[k] + 1]; q++)
                if (mark[l->p_column[q]] != I) {
                    mark[l->p_column[q]] = I;
                    count = insert(columns, count, l->p_column[q]);
                }
    return count;
}

static bool transpose(drape_arena *scratch, const level *l, int32_t **start, int32_t **row)
{
    *start = drape_arena_take(scratch, (size_t)l->coarse + 2, sizeof **start);
    *row = drape_arena_take(scratch, (size_t)l->p_start[l->a.count], sizeof **row);
    if (drape_arena_status(scratch))
        return false;
    for (int32_t q = 0; q < l->p_start[l->a.count]; q++)
        (*start)[l->p_column[q] + 2]++;
    for (int32_t I = 0; I < l->coarse; I++)
        (*start)[I + 2] += (*start)[I + 1];
    for (int32_t i = 0; i < l->a.count; i++)
        for (int32_t q = l->p_start[i]; q < l->p_start[i + 1]; q++)
            (*row)[(*start)[l->p_column[q] + 1]++] = i;
    return true;
}

static drape_status build_coarse(drape_arena *arena, drape_arena *scratch, const level *l, matrix *out)
{
    int32_t *start, *row, total = 0;
    int32_t *mark = drape_arena_take(scratch, (size_t)l->coarse, sizeof *mark),
            *columns = drape_arena_take(scratch, (size_t)l->coarse + 1, sizeof *columns);
    *out = (matrix){.size = MODES,
                    .count = l->coarse,
                    .start = drape_arena_take(arena, (size_t)l->coarse + 1, sizeof *out->start),
                    .diagonal = drape_arena_take(arena, (size_t)l->coarse, sizeof *out->diagonal)};
    if (!transpose(scratch, l, &start, &row) || drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    for (int pass = 0; pass < 2; pass++) {
        total = 0;
        memset(mark, -1, (size_t)l->coarse * sizeof *mark);
        for (int32_t I = 0; I < l->coarse; I++) {
            int32_t count = meet(l, start, row, I, mark, columns);
            for (int32_t k = 0; pass && k < count; k++) {
                out->column[total + k] = columns[k];
                if (columns[k] == I)
                    out->diagonal[I] = total + k;
            }
            total += count;
            out->start[I + 1] = total;
        }
        if (!pass)
            out->column = drape_arena_take(arena, (size_t)total, sizeof *out->column);
        if (!out->column)
            return DRAPE_E_MEMORY;
    }
    return DRAPE_OK;
}

/* ---- Creation ---- */

static drape_status take_vectors(drape_arena *arena, level *l, bool finest)
{
    const size_t n = scalars(&l->a);
    l->inverse = drape_arena_take(arena, n * (size_t)l->a.size, sizeof *l->inverse);
    l->modes = drape_arena_take(arena, n * MODES, sizeof *l->modes);
    l->r = drape_arena_take(arena, n, sizeof *l->r);
    l->x = drape_arena_take(arena, n, sizeof *l->x);
    l->b = drape_arena_take(arena, n, sizeof *l->b);
    if (finest)
        return drape_arena_status(arena);
    l->sum = drape_arena_take(arena, n, sizeof *l->sum);
    l->own = drape_arena_take(arena, nonzeros(&l->a), sizeof *l->own);
    l->a.values = l->own;
    return drape_arena_status(arena);
}

/* Makes the next coarser matrix and its graph from that of the level, which stays the coarsest one if there
 * is none. */
static drape_status coarsen(drape_arena *arena, drape_arena *scratch, level *l, graph *g, matrix *next)
{
    int32_t *joined = drape_arena_take(scratch, (size_t)l->a.count, sizeof *joined);
    l->aggregate = drape_arena_take(arena, (size_t)l->a.count, sizeof *l->aggregate);
    l->member = drape_arena_take(arena, (size_t)l->a.count, sizeof *l->member);
    if (!joined || !l->aggregate || !l->member)
        return DRAPE_E_MEMORY;
    l->coarse = form_aggregates(g, l->aggregate, joined);
    if (l->coarse > STAGNATION * l->a.count)
        l->coarse = 0;
    l->member_start = drape_arena_take(arena, (size_t)l->coarse + 2, sizeof *l->member_start);
    if (!l->member_start)
        return DRAPE_E_MEMORY;
    if (l->coarse == 0)
        return DRAPE_OK;
    list_members(l);
    graph smaller;
    drape_status status = shrink(scratch, l, g, &smaller);
    *g = smaller;
    if (!status)
        drop_distant(g, CLOSE_AGGREGATES, joined);
    if (!status)
        status = build_prolongation(arena, l);
    return status ? status : build_coarse(arena, scratch, l, next);
}

/* The close neighbours of each node. */
static drape_status make_graph(drape_arena *scratch, const matrix *a, graph *out)
{
    const size_t entries = (size_t)a->start[a->count], count = (size_t)a->count;
    int32_t *row = drape_arena_take(scratch, count, sizeof *row);
    *out = (graph){.count = a->count,
                   .start = drape_arena_take(scratch, count + 1, sizeof *out->start),
                   .neighbor = drape_arena_take(scratch, entries, sizeof *out->neighbor),
                   .weight = drape_arena_take(scratch, entries, sizeof *out->weight)};
    if (drape_arena_status(scratch))
        return DRAPE_E_MEMORY;
    memcpy(out->start, a->start, (count + 1) * sizeof *out->start);
    memcpy(out->neighbor, a->column, entries * sizeof *out->neighbor);
    count_shared(out, row);
    drop_distant(out, CLOSE_NODES, row);
    return DRAPE_OK;
}

/* Makes the levels from the finest on, until one is small enough for a dense matrix or cannot be
 * coarsened. */
static drape_status build_levels(drape_arena *arena, drape_arena *scratch, drape_multigrid *m)
{
    graph g;
    if (make_graph(scratch, &m->level[0].a, &g))
        return DRAPE_E_MEMORY;
    for (m->count = 1;; m->count++) {
        level *l = &m->level[m->count - 1];
        drape_status status = take_vectors(arena, l, m->count == 1);
        if (status || l->a.count <= DENSE || m->count == MAX_LEVELS)
            return status;
        status = coarsen(arena, scratch, l, &g, &l[1].a);
        if (status || l->coarse == 0)
            return status;
    }
}

/* Workspace of add_galerkin, and the dense matrix. */
static drape_status take_shared(drape_arena *arena, drape_multigrid *m)
{
    size_t widest = 0, most = 0;
    for (int k = 1; k < m->count; k++) {
        const matrix *a = &m->level[k].a;
        most = (size_t)a->count > most ? (size_t)a->count : most;
        for (int32_t i = 0; i < a->count; i++)
            widest = (size_t)length(a, i) > widest ? (size_t)length(a, i) : widest;
    }
    const size_t n = scalars(&m->level[m->count - 1].a);
    m->product = drape_arena_take(arena, widest * MODES * MODES, sizeof *m->product);
    m->hit = drape_arena_take(arena, widest, sizeof *m->hit);
    m->where = drape_arena_take(arena, most, sizeof *m->where);
    if (m->level[m->count - 1].a.count <= DENSE)
        m->dense = drape_arena_take(arena, n * n, sizeof *m->dense);
    return drape_arena_status(arena);
}

drape_status drape_multigrid_create(drape_arena *arena, const drape_pattern *pattern, drape_multigrid **out)
{
    drape_multigrid *m = drape_arena_take(arena, 1, sizeof *m);
    if (!m)
        return DRAPE_E_MEMORY;
    m->level[0].a = (matrix){.size = 3,
                             .count = pattern->block_count,
                             .start = pattern->block_start,
                             .column = pattern->block_row,
                             .diagonal = pattern->diagonal};
    drape_arena scratch = drape_arena_of(arena->ctx);
    drape_status status = build_levels(arena, &scratch, m);
    drape_arena_free(&scratch);
    if (!status)
        status = take_shared(arena, m);
    if (!status)
        *out = m;
    return status;
}
