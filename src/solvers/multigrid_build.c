/* multigrid_build.c: the aggregates, the patterns and the memory of all levels: see multigrid.h. */
#include "solvers/multigrid_parts.h"

#include <string.h>

#define DENSE      64  /* largest number of block rows that are factored as one dense matrix */
#define FEW        2   /* block rows for each rank: no more are shared */
#define STAGNATION 0.7 /* of the rows of a level: with more on the next one, that is not made */
/* of the largest weight of a row: neighbours with less are in no aggregate of its, among nodes and among
 * aggregates */
#define CLOSE_NODES      0.8
#define CLOSE_AGGREGATES 0.5

/* ---- Aggregates ---- */

/* Drops the neighbours whose weight is below a share of the largest one of both rows: in a mesh the nodes
 * across an edge, which bending alone couples; in a grid of aggregates those at the corners. A smoothed
 * function of the next level reaches one coupling beyond its aggregate: between wide aggregates these
 * functions interpolate badly, which slows the bending modes most. largest (columns) is scratch. */
static void drop_distant(graph *g, double share, int32_t *largest, const border *b)
{
    memset(largest, 0, (size_t)g->count * sizeof *largest);
    for (int32_t i = 0; i < g->count; i++)
        for (int32_t k = g->start[i]; k < g->start[i + 1]; k++)
            if (g->neighbor[k] != i && g->weight[k] > largest[i])
                largest[i] = g->weight[k];
    if (b)
        b->ranks->copy(b->ranks, b->rows, largest, largest + g->count, sizeof *largest);
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
        if (g->neighbor[k] < g->count && aggregate[g->neighbor[k]] >= 0)
            return false;
    return true;
}

/* A row whose neighbours all belong to no aggregate yet forms one with them; the rest then joins that of the
 * first neighbour that had one. Returns their number. Those that are copies are in aggregates of their own
 * ranks. */
static int32_t form_aggregates(const graph *g, int32_t *aggregate, int32_t *joined)
{
    int32_t count = 0;
    memset(aggregate, -1, (size_t)g->count * sizeof *aggregate);
    for (int32_t i = 0; i < g->count; i++) {
        if (g->start[i + 1] - g->start[i] == 1 || !is_free(g, aggregate, i))
            continue;
        for (int32_t k = g->start[i]; k < g->start[i + 1]; k++)
            if (g->neighbor[k] < g->count)
                aggregate[g->neighbor[k]] = count;
        count++;
    }
    memcpy(joined, aggregate, (size_t)g->count * sizeof *joined);
    for (int32_t i = 0; i < g->count; i++)
        for (int32_t k = g->start[i]; joined[i] < 0 && k < g->start[i + 1]; k++)
            joined[i] = g->neighbor[k] < g->count ? aggregate[g->neighbor[k]] : -1;
    memcpy(aggregate, joined, (size_t)g->count * sizeof *joined);
    return count;
}

/* Aggregates are neighbours if rows in them are. Their matrix couples more of them, and aggregates of all
 * that it couples would be too large. */
static drape_status shrink(drape_arena *scratch, const level *l, const graph *g, int32_t columns, graph *out)
{
    int32_t *at = drape_arena_take(scratch, (size_t)columns, sizeof *at); /* of the last row with each */
    *out = (graph){.count = l->coarse,
                   .start = drape_arena_take(scratch, (size_t)l->coarse + 1, sizeof *out->start),
                   .neighbor = drape_arena_take(scratch, (size_t)g->start[g->count], sizeof *out->neighbor),
                   .weight = drape_arena_take(scratch, (size_t)g->start[g->count], sizeof *out->weight)};
    if (drape_arena_status(scratch))
        return DRAPE_E_MEMORY;
    memset(at, -1, (size_t)columns * sizeof *at);
    int32_t total = 0;
    for (int32_t I = 0; I < l->coarse; I++) {
        for (int32_t n = l->member_start[I]; n < l->member_start[I + 1]; n++)
            for (int32_t k = g->start[l->member[n]]; k < g->start[l->member[n] + 1]; k++) {
                const int32_t J = l->aggregate[g->neighbor[k]];
                if (J < 0) /* a copy that its own rank finds coupled to no other */
                    continue;
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

/* One smoothing of the aggregates' functions: they reach to their neighbours. The rows here. */
static drape_status build_prolongation(drape_arena *arena, level *l)
{
    const matrix *a = &l->a;
    int32_t widest = 0, total = 0;
    for (int32_t i = 0; i < a->count; i++)
        widest = length(a, i) > widest ? (int32_t)length(a, i) : widest;
    l->p_start = drape_arena_take(arena, (size_t)a->columns + 1, sizeof *l->p_start);
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
    return DRAPE_OK;
}

/* Whether rows of copies have these: the lower triangle serves for blocks whose row and column another rank
 * has, as it does for those here. */
static bool counts(const border *b, int32_t count, int32_t I, int32_t J)
{
    if (J < count)
        return true;
    const int32_t row = b->number[I - count], column = b->number[J - count];
    return column <= row || column >= b->first[rank_of(b, row) + 1];
}

/* The columns of the coarse row I: those of the prolongation at the neighbours of all rows where function I
 * is nonzero, which the transposed prolongation gives. Of copies among these, they are in `reach`; a row of a
 * copy has what the rows here add to it. */
static int32_t meet(const level *l, const level *next, const lists *reach, const lists *rows, int32_t I,
                    int32_t *mark, int32_t *columns)
{
    const matrix *a = &l->a;
    int32_t count = 0;
    for (int32_t n = rows->start[I]; n < rows->start[I + 1]; n++) {
        const int32_t i = rows->column[n];
        if (i >= a->count) {
            for (int32_t q = reach->start[i]; I < l->coarse && q < reach->start[i + 1]; q++)
                if (mark[reach->column[q]] != I) {
                    mark[reach->column[q]] = I;
                    count = insert(columns, count, reach->column[q]);
                }
            continue;
        }
        for (int32_t k = a->start[i]; k < a->start[i + 1]; k++)
            for (int32_t q = l->p_start[a->column[k]]; q < l->p_start[a->column[k] + 1]; q++) {
                const int32_t J = l->p_column[q];
                if (mark[J] == I)
                    continue;
                mark[J] = I;
                if (I < l->coarse || counts(next->border, l->coarse, I, J))
                    count = insert(columns, count, J);
            }
    }
    return count;
}

/* The rows in which each column of the prolongation is. */
static drape_status transpose(drape_arena *scratch, const level *l, int32_t columns, lists *out)
{
    out->start = drape_arena_take(scratch, (size_t)columns + 2, sizeof *out->start);
    out->column = drape_arena_take(scratch, (size_t)l->p_start[l->a.columns], sizeof *out->column);
    if (drape_arena_status(scratch))
        return DRAPE_E_MEMORY;
    for (int32_t q = 0; q < l->p_start[l->a.columns]; q++)
        out->start[l->p_column[q] + 2]++;
    for (int32_t I = 0; I < columns; I++)
        out->start[I + 2] += out->start[I + 1];
    for (int32_t i = 0; i < l->a.columns; i++)
        for (int32_t q = l->p_start[i]; q < l->p_start[i + 1]; q++)
            out->column[out->start[l->p_column[q] + 1]++] = i;
    return DRAPE_OK;
}

static drape_status build_coarse(drape_arena *arena, drape_arena *scratch, const level *l, const lists *reach,
                                 level *next)
{
    matrix *a = &next->a;
    lists rows;
    int32_t total = 0;
    int32_t *mark = drape_arena_take(scratch, (size_t)a->columns, sizeof *mark),
            *columns = drape_arena_take(scratch, (size_t)a->columns + 1, sizeof *columns);
    a->start = drape_arena_take(arena, (size_t)a->columns + 1, sizeof *a->start);
    a->diagonal = drape_arena_take(arena, (size_t)a->count, sizeof *a->diagonal);
    if (transpose(scratch, l, a->columns, &rows) || drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    for (int pass = 0; pass < 2; pass++) {
        total = 0;
        memset(mark, -1, (size_t)a->columns * sizeof *mark);
        for (int32_t I = 0; I < a->columns; I++) {
            int32_t count = meet(l, next, reach, &rows, I, mark, columns);
            for (int32_t k = 0; pass && k < count; k++) {
                a->column[total + k] = columns[k];
                if (columns[k] == I && I < a->count)
                    a->diagonal[I] = total + k;
            }
            total += count;
            a->start[I + 1] = total;
        }
        if (!pass)
            a->column = drape_arena_take(arena, (size_t)total, sizeof *a->column);
        if (!a->column)
            return DRAPE_E_MEMORY;
    }
    return DRAPE_OK;
}

/* ---- Creation ---- */

static drape_status take_vectors(drape_arena *arena, level *l)
{
    const size_t n = scalars(&l->a), all = (size_t)l->a.columns * (size_t)l->a.size;
    l->inverse = drape_arena_take(arena, all * (size_t)l->a.size, sizeof *l->inverse);
    l->modes = drape_arena_take(arena, all * MODES, sizeof *l->modes);
    l->r = drape_arena_take(arena, n, sizeof *l->r);
    l->x = drape_arena_take(arena, all, sizeof *l->x);
    l->b = drape_arena_take(arena, all, sizeof *l->b);
    if (l->a.size == 3) /* the finest level */
        return drape_arena_status(arena);
    l->sum = drape_arena_take(arena, n, sizeof *l->sum);
    l->own = drape_arena_take(arena, nonzeros(&l->a), sizeof *l->own);
    l->a.values = l->own;
    return drape_arena_status(arena);
}

/* Aggregates, unless there would be nearly as many as rows. */
static drape_status aggregate(drape_arena *arena, drape_arena *scratch, level *l, const graph *g, bool *made)
{
    const size_t columns = (size_t)l->a.columns;
    int32_t *joined = drape_arena_take(scratch, columns, sizeof *joined);
    l->aggregate = drape_arena_take(arena, columns, sizeof *l->aggregate);
    l->member = drape_arena_take(arena, (size_t)l->a.count, sizeof *l->member);
    if (agree(ranks_of(l), arena, joined && l->aggregate && l->member))
        return DRAPE_E_MEMORY;
    l->coarse = form_aggregates(g, l->aggregate, joined);
    const double all = drape_ranks_sum(ranks_of(l), l->coarse);
    *made = all > 0 && all <= STAGNATION * (double)all_rows(l);
    l->coarse = *made ? l->coarse : 0;
    l->member_start = drape_arena_take(arena, (size_t)l->coarse + 2, sizeof *l->member_start);
    if (l->member_start && *made) {
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
    return agree(ranks_of(l), arena, l->member_start);
}

/* Makes the next coarser matrix and its graph from that of the level. */
static drape_status coarsen(drape_arena *arena, drape_arena *scratch, level *l, graph *g, level *next)
{
    lists reach = {0};
    graph smaller;
    /* The prolongation, and which rows and columns the next matrix has. */
    drape_status status = l->border ? drape_border_number(arena, l, next) : DRAPE_OK;
    if (!status)
        status = agree(ranks_of(l), arena, !build_prolongation(arena, l));
    next->a = (matrix){.size = MODES, .count = l->coarse, .columns = l->coarse};
    if (!status && l->border)
        status = drape_border_prolong(arena, scratch, l, next, &reach);
    if (!status) {
        const size_t blocks = (size_t)l->p_start[l->a.columns];
        l->p = drape_arena_take(arena, blocks * (size_t)l->a.size * MODES, sizeof *l->p);
        status = drape_arena_status(arena);
    }
    int32_t *largest = status ? NULL : drape_arena_take(scratch, (size_t)next->a.columns, sizeof *largest);
    if (!status)
        status = largest ? shrink(scratch, l, g, next->a.columns, &smaller) : DRAPE_E_MEMORY;
    if (agree(ranks_of(l), arena, !status))
        return DRAPE_E_MEMORY;
    *g = smaller;
    drop_distant(g, CLOSE_AGGREGATES, largest, next->border);
    status = agree(ranks_of(l), arena, !build_coarse(arena, scratch, l, &reach, next));
    return status || !l->border ? status : drape_border_finish(arena, scratch, l, next);
}

/* The close neighbours of each node. */
static drape_status make_graph(drape_arena *scratch, const level *l, graph *out)
{
    const matrix *a = &l->a;
    const size_t entries = (size_t)a->start[a->count], count = (size_t)a->count;
    int32_t *row = drape_arena_take(scratch, (size_t)a->columns, sizeof *row);
    *out = (graph){.count = a->count,
                   .start = drape_arena_take(scratch, count + 1, sizeof *out->start),
                   .neighbor = drape_arena_take(scratch, entries, sizeof *out->neighbor),
                   .weight = drape_arena_take(scratch, entries, sizeof *out->weight)};
    if (agree(ranks_of(l), scratch, !drape_arena_status(scratch)))
        return DRAPE_E_MEMORY;
    memcpy(out->start, a->start, (count + 1) * sizeof *out->start);
    memcpy(out->neighbor, a->column, entries * sizeof *out->neighbor);
    memset(row, -1, (size_t)a->columns * sizeof *row);
    for (int32_t i = 0; i < out->count; i++) {
        for (int32_t k = out->start[i]; k < out->start[i + 1]; k++)
            row[out->neighbor[k]] = i;
        for (int32_t k = out->start[i]; k < out->start[i + 1]; k++)
            for (int32_t q = a->start[out->neighbor[k]]; q < a->start[out->neighbor[k] + 1]; q++)
                out->weight[k] += row[a->column[q]] == i;
    }
    drop_distant(out, CLOSE_NODES, row, l->border);
    return DRAPE_OK;
}

/* Whether each rank has the level as a whole: the work on it is then done by all, which its exchanges cost no
 * less than if it is small. */
static bool is_small(const level *l)
{
    const int64_t few = FEW * (int64_t)l->border->ranks->count;
    return all_rows(l) <= (few > DENSE ? few : DENSE);
}

/* Makes the levels from the finest on, until one is small enough for a dense matrix or cannot be
 * coarsened, and the memory that they share. */
static drape_status build_levels(drape_arena *arena, drape_arena *scratch, drape_multigrid *m, graph *g)
{
    bool more = true;
    for (m->count = 1; more; m->count += more) {
        level *l = &m->level[m->count - 1];
        drape_status status = agree(ranks_of(l), arena, !take_vectors(arena, l));
        if (!status && l->border && m->count > 1 && is_small(l)) {
            status = drape_border_gather(arena, scratch, l, g, &m->whole);
            if (!status) /* the levels that each rank has as a whole */
                status = build_levels(arena, scratch, m->whole.multigrid, g);
        }
        more = !m->whole.multigrid && (l->border || l->a.count > DENSE) && m->count < MAX_LEVELS;
        if (!status && more)
            status = aggregate(arena, scratch, l, g, &more);
        if (!status && more)
            status = coarsen(arena, scratch, l, g, &l[1]);
        if (agree(ranks_of(l), arena, !status))
            return DRAPE_E_MEMORY;
    }
    /* Workspace of add_galerkin, and the dense matrix. */
    size_t widest = 0, most = 0;
    for (int k = 1; k < m->count; k++) {
        const matrix *a = &m->level[k].a;
        most = (size_t)a->columns > most ? (size_t)a->columns : most;
        for (int32_t i = 0; i < a->count; i++)
            widest = (size_t)length(a, i) > widest ? (size_t)length(a, i) : widest;
    }
    const size_t n = scalars(&m->level[m->count - 1].a);
    m->product = drape_arena_take(arena, widest * MODES * MODES, sizeof *m->product);
    m->hit = drape_arena_take(arena, widest, sizeof *m->hit);
    m->where = drape_arena_take(arena, most, sizeof *m->where);
    if (m->level[m->count - 1].a.count <= DENSE && !m->level[0].border)
        m->dense = drape_arena_take(arena, n * n, sizeof *m->dense);
    return drape_arena_status(arena);
}

drape_status drape_multigrid_create(drape_arena *arena, const drape_pattern *pattern, drape_multigrid **out)
{
    drape_multigrid *m = drape_arena_take(arena, 1, sizeof *m);
    graph g;
    if (agree(pattern->ranks, arena, m))
        return DRAPE_E_MEMORY;
    m->level[0].a = (matrix){.size = 3,
                             .count = (int32_t)(drape_pattern_own(pattern) / 3),
                             .columns = pattern->block_count,
                             .start = pattern->block_start,
                             .column = pattern->block_row,
                             .diagonal = pattern->diagonal};
    drape_arena scratch = drape_arena_of(arena->ctx);
    drape_status status = pattern->ranks ? drape_border_create(arena, pattern, &m->level[0]) : DRAPE_OK;
    status = agree(pattern->ranks, arena, !status);
    if (!status)
        status = make_graph(&scratch, &m->level[0], &g);
    if (!status)
        status = agree(pattern->ranks, arena, !build_levels(arena, &scratch, m, &g));
    drape_arena_free(&scratch);
    if (!status)
        *out = m;
    return status;
}
