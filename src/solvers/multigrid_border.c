/*
 * multigrid_border.c: what ranks exchange of the levels that they share: see multigrid_parts.h. Aggregates
 * are formed by each rank from its own rows, so that their functions reach into the rows of other ranks by
 * one smoothing only. A row of the next matrix belongs to the rank of its aggregate, and is the sum of
 * products P' A P of the rows of A of several ranks: each adds what its own give, and sends what belongs to
 * others.
 *
 * Rows, and lists of columns, have their numbers in the matrix of all ranks while they are exchanged.
 */
#include "solvers/multigrid_parts.h"

#include <stdlib.h>

/* ---- Numbers ---- */

static int32_t first_here(const border *b)
{
    return b->first[b->ranks->rank];
}

static int32_t number_of(const border *b, int32_t count, int32_t here)
{
    return here < count ? first_here(b) + here : b->number[here - count];
}

/* The reverse, where the numbers of copies ascend; -1: it is not here. */
static int32_t find_here(const border *b, const matrix *a, int32_t number)
{
    int32_t low = 0, high = a->columns - a->count;
    if (number >= first_here(b) && number < first_here(b) + a->count)
        return number - first_here(b);
    while (high - low > 1) {
        const int32_t middle = low + (high - low) / 2;
        *(b->number[middle] <= number ? &low : &high) = middle;
    }
    return high > low && b->number[low] == number ? a->count + low : -1;
}

/* The numbers of the first items of the ranks, of which this one has `count`. */
static void number_items(const drape_ranks *ranks, int32_t count, int32_t *first)
{
    for (int k = 0; k < ranks->count; k++) {
        int32_t there = count;
        ranks->broadcast(ranks, k, &there, sizeof there);
        first[k + 1] = first[k] + there;
    }
}

/* NULL: out of memory, on all ranks. */
static border *take_border(drape_arena *arena, const drape_ranks *ranks)
{
    border *b = drape_arena_take(arena, 1, sizeof *b);
    int32_t *first = drape_arena_take(arena, (size_t)ranks->count + 1, sizeof *first);
    if (agree(ranks, arena, b && first))
        return NULL;
    b->ranks = ranks;
    b->first = first;
    return b;
}

/* ---- Plans ---- */

/* The exchange of rows, of which border->number has the copies. */
static drape_status plan_rows(drape_arena *arena, drape_arena *scratch, border *b, const matrix *a)
{
    const size_t copies = (size_t)(a->columns - a->count);
    int32_t *rank = drape_arena_take(scratch, copies, sizeof *rank),
            *place = drape_arena_take(scratch, copies, sizeof *place);
    b->copies = drape_arena_take(arena, copies * (size_t)a->size, sizeof *b->copies);
    if (agree(b->ranks, arena, b->number && rank && place && b->copies))
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < copies; i++) {
        rank[i] = rank_of(b, b->number[i]);
        place[i] = b->number[i] - b->first[rank[i]];
    }
    b->rows = b->ranks->plan(b->ranks, arena, (int32_t)copies, rank, place,
                             (size_t)a->size * MODES * sizeof(double));
    return b->rows ? DRAPE_OK : DRAPE_E_MEMORY;
}

/* Lists the rows that have columns of copies. */
static drape_status list_border(drape_arena *arena, border *b, const matrix *a)
{
    for (int pass = 0; pass < 2; pass++) {
        b->count = 0;
        for (int32_t i = 0; i < a->count; i++) {
            int32_t k = a->start[i + 1];
            while (k > a->start[i] && a->column[k - 1] >= a->count)
                k--;
            if (k == a->start[i + 1])
                continue;
            if (pass) {
                b->row[b->count] = i;
                b->outside[b->count] = k;
            }
            b->count++;
        }
        if (pass)
            break;
        b->row = drape_arena_take(arena, (size_t)b->count, sizeof *b->row);
        b->outside = drape_arena_take(arena, (size_t)b->count, sizeof *b->outside);
        b->spread = drape_arena_take(arena, (size_t)b->count, sizeof *b->spread);
        if (!b->row || !b->outside || !b->spread)
            return DRAPE_E_MEMORY;
    }
    return DRAPE_OK;
}

/* Appends the lists of copies to those of the rows here. list->start is of columns + 1, NULL if there is no
 * memory here, like list->column. items: the plan for what else there is of each column, of at most `largest`
 * bytes; NULL: nothing is. */
static drape_status append_lists(drape_arena *arena, drape_arena *scratch, const level *l, lists *list,
                                 drape_exchange **items, size_t largest)
{
    const border *b = l->border;
    const int32_t count = l->a.count, columns = l->a.columns;
    int32_t(*span)[2] = drape_arena_take(scratch, (size_t)columns, sizeof *span);
    if (agree(b->ranks, arena, list->start && list->column && span))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < count; i++) {
        span[i][0] = list->start[i];
        span[i][1] = list->start[i + 1];
    }
    b->ranks->copy(b->ranks, b->rows, span, span + count, sizeof *span);
    int32_t total = list->start[count];
    for (int32_t i = count; i < columns; i++) {
        total += span[i][1] - span[i][0];
        list->start[i + 1] = total;
    }
    const int32_t more = total - list->start[count];
    int32_t *rank = drape_arena_take(scratch, (size_t)more, sizeof *rank),
            *place = drape_arena_take(scratch, (size_t)more, sizeof *place),
            *column = drape_arena_resize(arena, list->column, (size_t)total, sizeof *column), at = 0;
    if (agree(b->ranks, arena, rank && place && column))
        return DRAPE_E_MEMORY;
    list->column = column;
    for (int32_t i = count; i < columns; i++)
        for (int32_t k = span[i][0]; k < span[i][1]; k++, at++) {
            rank[at] = rank_of(b, b->number[i - count]);
            place[at] = k;
        }
    drape_exchange *x = b->ranks->plan(b->ranks, items ? arena : scratch, more, rank, place, largest);
    if (!x)
        return DRAPE_E_MEMORY;
    b->ranks->copy(b->ranks, x, column, column + list->start[count], sizeof *column);
    if (items)
        *items = x;
    return DRAPE_OK;
}

/* ---- The finest level ---- */

drape_status drape_border_create(drape_arena *arena, const drape_pattern *pattern, level *l)
{
    const int32_t copies = l->a.columns - l->a.count;
    border *b = l->border = take_border(arena, pattern->ranks);
    if (!b)
        return DRAPE_E_MEMORY;
    number_items(b->ranks, l->a.count, b->first);
    b->number = drape_arena_take(arena, (size_t)copies, sizeof *b->number);
    for (int32_t i = 0; b->number && i < copies; i++)
        b->number[i] = (int32_t)b->ranks->block[l->a.count + i];
    drape_arena scratch = drape_arena_of(arena->ctx);
    drape_status status = plan_rows(arena, &scratch, b, &l->a);
    drape_arena_free(&scratch);
    return status ? status : list_border(arena, b, &l->a);
}

/* ---- The next level ---- */

drape_status drape_border_number(drape_arena *arena, level *l, level *next)
{
    const border *b = l->border;
    next->border = take_border(arena, b->ranks);
    if (!next->border)
        return DRAPE_E_MEMORY;
    number_items(b->ranks, l->coarse, next->border->first);
    for (int32_t i = 0; i < l->a.count; i++)
        l->aggregate[i] += l->aggregate[i] < 0 ? 0 : first_here(next->border);
    b->ranks->copy(b->ranks, b->rows, l->aggregate, l->aggregate + l->a.count, sizeof *l->aggregate);
    return DRAPE_OK;
}

/* The columns of A P in the rows here that are copies elsewhere, which are those with copies among their
 * columns; then those in the copies here alone. */
static drape_status reach_of_copies(drape_arena *scratch, const level *l, lists *reach)
{
    const matrix *a = &l->a;
    int32_t total = 0, widest = 0;
    for (int32_t n = 0; n < l->border->count; n++) {
        int32_t width = 0;
        for (int32_t i = l->border->row[n], k = a->start[i]; k < a->start[i + 1]; k++)
            width += l->p_start[a->column[k] + 1] - l->p_start[a->column[k]];
        widest = width > widest ? width : widest;
        total += width;
    }
    reach->start = drape_arena_take(scratch, (size_t)a->columns + 1, sizeof *reach->start);
    reach->column = drape_arena_take(scratch, (size_t)(total + widest), sizeof *reach->column);
    for (int32_t i = 0, n = 0; reach->start && reach->column && i < a->count; i++) {
        int32_t count = 0;
        if (n < l->border->count && l->border->row[n] == i) {
            for (int32_t k = a->start[i]; k < a->start[i + 1]; k++)
                for (int32_t q = l->p_start[a->column[k]]; q < l->p_start[a->column[k] + 1]; q++)
                    count = insert(reach->column + reach->start[i], count, l->p_column[q]);
            n++;
        }
        reach->start[i + 1] = reach->start[i] + count;
    }
    return append_lists(scratch, scratch, l, reach, NULL, sizeof *reach->column);
}

static int compare(const void *a, const void *b)
{
    const int32_t x = *(const int32_t *)a, y = *(const int32_t *)b;
    return (x > y) - (x < y);
}

drape_status drape_border_prolong(drape_arena *arena, drape_arena *scratch, level *l, level *next,
                                  lists *reach)
{
    lists p = {l->p_start, l->p_column};
    drape_status status = append_lists(arena, scratch, l, &p, &l->border->prolongation,
                                       (size_t)l->a.size * MODES * sizeof(double));
    l->p_column = p.column;
    if (!status)
        status = reach_of_copies(scratch, l, reach);
    if (status)
        return status;
    /* The copies that the next level has: all aggregates of other ranks in these lists. Their numbers are
     * NULL if there is no memory here. */
    border *b = next->border;
    const int32_t inside = l->p_start[l->a.columns], outside = reach->start[l->a.columns];
    int32_t *number = drape_arena_take(arena, (size_t)inside + (size_t)outside, sizeof *number), count = 0,
            unique = 0;
    for (int list = 0; number && list < 2; list++)
        for (int32_t q = 0; q < (list ? outside : inside); q++) {
            const int32_t column = list ? reach->column[q] : p.column[q];
            if (rank_of(b, column) != b->ranks->rank)
                number[count++] = column;
        }
    if (number)
        qsort(number, (size_t)count, sizeof *number, compare);
    for (int32_t i = 0; i < count; i++)
        if (i == 0 || number[i] != number[unique - 1])
            number[unique++] = number[i];
    b->number = number ? drape_arena_resize(arena, number, (size_t)unique, sizeof *number) : NULL;
    next->a.columns = next->a.count + unique;
    status = plan_rows(arena, scratch, next->border, &next->a);
    if (status)
        return status;
    for (int32_t i = 0; i < l->a.columns; i++)
        if (l->aggregate[i] >= 0)
            l->aggregate[i] = find_here(next->border, &next->a, l->aggregate[i]);
    for (int32_t q = 0; q < p.start[l->a.columns]; q++)
        p.column[q] = find_here(next->border, &next->a, p.column[q]);
    for (int32_t q = 0; q < reach->start[l->a.columns]; q++)
        reach->column[q] = find_here(next->border, &next->a, reach->column[q]);
    return DRAPE_OK;
}

/* The rows of all blocks in rows of copies, of which each has a place in a row of its owner. rows: the lists
 * of columns there. */
static drape_status plan_products(drape_arena *arena, drape_arena *scratch, border *b, const level *next,
                                  const lists *rows, const int32_t *start)
{
    const matrix *a = &next->a;
    const int32_t items = MODES * (a->start[a->columns] - a->start[a->count]);
    int32_t *rank = drape_arena_take(scratch, (size_t)items, sizeof *rank),
            *place = drape_arena_take(scratch, (size_t)items, sizeof *place), at = 0;
    if (agree(b->ranks, arena, rank && place))
        return DRAPE_E_MEMORY;
    for (int32_t I = a->count; I < a->columns; I++)
        for (int32_t c = 0; c < MODES; c++)
            for (int32_t k = a->start[I]; k < a->start[I + 1]; k++, at++) {
                const int32_t J = number_of(next->border, a->count, a->column[k]);
                int32_t q = rows->start[I];
                while (rows->column[q] != J)
                    q++;
                rank[at] = rank_of(next->border, next->border->number[I - a->count]);
                place[at] = MODES * start[I] + c * (rows->start[I + 1] - rows->start[I]) + q - rows->start[I];
            }
    b->products = b->ranks->plan(b->ranks, arena, items, rank, place, MODES * sizeof(double));
    return b->products ? DRAPE_OK : DRAPE_E_MEMORY;
}

drape_status drape_border_finish(drape_arena *arena, drape_arena *scratch, level *l, level *next)
{
    const matrix *a = &next->a;
    const border *b = next->border;
    lists rows = {.start = drape_arena_take(scratch, (size_t)a->columns + 1, sizeof *rows.start),
                  .column = drape_arena_take(scratch, (size_t)a->start[a->count], sizeof *rows.column)};
    int32_t *start = drape_arena_take(scratch, (size_t)a->columns, sizeof *start);
    if (agree(b->ranks, arena, rows.start && rows.column && start))
        return DRAPE_E_MEMORY;
    memcpy(rows.start, a->start, ((size_t)a->count + 1) * sizeof *rows.start);
    memcpy(start, a->start, (size_t)a->count * sizeof *start);
    for (int32_t k = 0; k < a->start[a->count]; k++)
        rows.column[k] = number_of(b, a->count, a->column[k]);
    b->ranks->copy(b->ranks, b->rows, start, start + a->count, sizeof *start);
    drape_status status = append_lists(scratch, scratch, next, &rows, NULL, sizeof *rows.column);
    if (!status)
        status = plan_products(arena, scratch, l->border, next, &rows, start);
    return status ? status : list_border(arena, next->border, a);
}

/* ---- The levels that each rank has as a whole ---- */

/* Where the lists of the rows of all ranks begin, and memory for them; first (ranks + 1): where those of each
 * rank do; NULL: there is no memory here. The status is that of all ranks. */
static drape_status share_lengths(drape_arena *arena, const border *b, const int32_t *start, int32_t count,
                                  int32_t **all, int32_t *first, int32_t **column)
{
    const int32_t rows = b->first[b->ranks->count];
    int32_t *sum = *all = drape_arena_take(arena, (size_t)rows + 1, sizeof *sum);
    if (agree(b->ranks, arena, first && sum))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < count; i++)
        sum[first_here(b) + i + 1] = start[i + 1] - start[i];
    b->ranks->share(b->ranks, sum + 1, b->first, sizeof *sum);
    for (int32_t i = 0; i < rows; i++)
        sum[i + 1] += sum[i];
    for (int k = 0; k <= b->ranks->count; k++)
        first[k] = sum[b->first[k]];
    *column = drape_arena_take(arena, (size_t)sum[rows], sizeof **column);
    return agree(b->ranks, arena, *column);
}

static void share_columns(const border *b, int32_t count, const int32_t *column, const int32_t *first,
                          int32_t *all)
{
    int32_t *here = all + first[b->ranks->rank];
    for (int32_t k = 0; k < first[b->ranks->rank + 1] - first[b->ranks->rank]; k++)
        here[k] = number_of(b, count, column[k]);
    b->ranks->share(b->ranks, all, first, sizeof *all);
}

static drape_status gather_matrix(drape_arena *arena, drape_arena *scratch, const level *l, gathered *out)
{
    const border *b = l->border;
    matrix *a = &out->multigrid->level[0].a;
    int32_t *column = NULL;
    *a = (matrix){.size = MODES, .count = (int32_t)all_rows(l), .columns = (int32_t)all_rows(l)};
    a->diagonal = drape_arena_take(arena, (size_t)a->count, sizeof *a->diagonal);
    out->first_block = drape_arena_take(arena, (size_t)b->ranks->count + 1, sizeof *out->first_block);
    if (share_lengths(arena, b, l->a.start, l->a.count, &a->start, out->first_block, &a->column))
        return DRAPE_E_MEMORY;
    const size_t blocks = (size_t)a->start[a->count];
    column = drape_arena_take(scratch, blocks, sizeof *column);
    out->place = drape_arena_take(arena, blocks, sizeof *out->place);
    out->shared = drape_arena_take(arena, blocks * MODES * MODES, sizeof *out->shared);
    if (agree(b->ranks, arena, a->diagonal && column && out->place && out->shared))
        return DRAPE_E_MEMORY;
    share_columns(b, l->a.count, l->a.column, out->first_block, column);
    /* Sorts each row; place: where its columns were moved to. */
    int32_t *place = out->place;
    for (int32_t i = 0; i < a->count; i++)
        for (int32_t k = a->start[i]; k < a->start[i + 1]; k++) {
            place[k] = 0;
            for (int32_t q = a->start[i]; q < a->start[i + 1]; q++)
                place[k] += column[q] < column[k];
            a->column[a->start[i] + place[k]] = column[k];
            if (column[k] == i)
                a->diagonal[i] = a->start[i] + place[k];
        }
    return DRAPE_OK;
}

drape_status drape_border_gather(drape_arena *arena, drape_arena *scratch, const level *l, graph *g,
                                 gathered *out)
{
    out->multigrid = drape_arena_take(arena, 1, sizeof *out->multigrid);
    if (agree(l->border->ranks, arena, out->multigrid))
        return DRAPE_E_MEMORY;
    const drape_status status = gather_matrix(arena, scratch, l, out);
    /* The graph without weights, which have served. */
    if (status)
        return status;
    const border *b = l->border;
    graph all = {.count = (int32_t)all_rows(l)};
    int32_t *first = drape_arena_take(scratch, (size_t)b->ranks->count + 1, sizeof *first);
    if (share_lengths(scratch, b, g->start, g->count, &all.start, first, &all.neighbor))
        return DRAPE_E_MEMORY;
    share_columns(b, g->count, g->neighbor, first, all.neighbor);
    *g = all;
    return DRAPE_OK;
}
