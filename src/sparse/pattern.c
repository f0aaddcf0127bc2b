/* pattern.c: see pattern.h. Neighbours are first counted, then listed with repeats, which are removed while
 * the lists are sorted. */
#include "sparse/pattern.h"

#include <assert.h>
#include <math.h>
#include <string.h>

/* Lists of neighbours, with repeats: entries start[j] ... start[j+1] - 1 of row. */
typedef struct neighbours {
    int64_t *start, *next;
    int32_t *row;
} neighbours;

/* Without rows, counts the neighbours of each column in start[column + 1]; else lists them at `next`. */
static void visit_couplings(const drape_coupling *couplings, int coupling_count, const int32_t *block_of_node,
                            neighbours *list)
{
    for (int c = 0; c < coupling_count; c++) {
        const int nodes = couplings[c].nodes;
        for (int32_t e = 0; e < couplings[c].count; e++)
            for (int pair = 0; pair < nodes * nodes; pair++) {
                const int32_t *node = couplings[c].node + (size_t)e * (size_t)nodes;
                const int32_t row = block_of_node[node[pair / nodes]],
                              column = block_of_node[node[pair % nodes]];
                if (pair / nodes == pair % nodes || row < 0 || column < 0)
                    continue;
                if (list->row)
                    list->row[list->next[column]++] = row;
                else
                    list->start[column + 1]++;
            }
    }
}

static drape_status list_neighbours(drape_arena *scratch, int32_t block_count, const int32_t *block_of_node,
                                    const drape_coupling *couplings, int coupling_count, neighbours *list)
{
    size_t count = (size_t)block_count;
    list->start = drape_arena_take(scratch, count + 1, sizeof *list->start);
    list->next = drape_arena_take(scratch, count, sizeof *list->next);
    if (drape_arena_status(scratch))
        return DRAPE_E_MEMORY;
    visit_couplings(couplings, coupling_count, block_of_node, list);
    for (size_t j = 0; j < count; j++) {
        list->start[j + 1] += list->start[j] + 1; /* + 1: the diagonal */
        list->next[j] = list->start[j];
    }
    list->row = drape_arena_take(scratch, (size_t)list->start[count], sizeof *list->row);
    if (!list->row)
        return DRAPE_E_MEMORY;
    for (int32_t j = 0; j < block_count; j++)
        list->row[list->next[j]++] = j;
    visit_couplings(couplings, coupling_count, block_of_node, list);
    return DRAPE_OK;
}

/* Removes repeats from each list, in place, and sorts it: column j goes to the end of the list of each of its
 * rows, by increasing j, because couplings are symmetric. next[j] becomes the number of remaining entries.
 * Returns their sum. */
static drape_status make_unique(drape_arena *scratch, neighbours *list, int32_t block_count, int64_t *total)
{
    int32_t *sorted = drape_arena_take(scratch, (size_t)list->start[block_count], sizeof *sorted);
    int32_t *last = drape_arena_take(scratch, (size_t)block_count, sizeof *last); /* 1 + column of each row */
    if (drape_arena_status(scratch))
        return DRAPE_E_MEMORY;
    *total = 0;
    memset(list->next, 0, (size_t)block_count * sizeof *list->next);
    for (int32_t j = 0; j < block_count; j++)
        for (int64_t k = list->start[j]; k < list->start[j + 1]; k++) {
            const int32_t i = list->row[k];
            if (last[i] == j + 1)
                continue;
            last[i] = j + 1;
            sorted[list->start[i] + list->next[i]++] = j;
            ++*total;
        }
    list->row = sorted;
    return DRAPE_OK;
}

static drape_status allocate(drape_arena *arena, drape_pattern *pattern, int32_t block_count, int64_t blocks)
{
    if (blocks > INT32_MAX)
        return drape_fail(arena->ctx, DRAPE_E_ARGUMENT,
                          "the Jacobian has %lld blocks of 3 x 3, at most 2147483647 are allowed",
                          (long long)blocks);
    pattern->block_count = block_count;
    pattern->n = 3 * (int64_t)block_count;
    pattern->nonzeros = 9 * blocks;
    pattern->block_start = drape_arena_take(arena, (size_t)block_count + 1, sizeof *pattern->block_start);
    pattern->block_row = drape_arena_take(arena, (size_t)blocks, sizeof *pattern->block_row);
    pattern->diagonal = drape_arena_take(arena, (size_t)block_count, sizeof *pattern->diagonal);
    pattern->column = drape_arena_take(arena, (size_t)pattern->n + 1, sizeof *pattern->column);
    return drape_arena_status(arena);
}

drape_status drape_pattern_build(drape_arena *arena, int32_t block_count, const int32_t *block_of_node,
                                 const drape_coupling *couplings, int coupling_count, drape_pattern *pattern)
{
    neighbours list = {0};
    drape_arena scratch = drape_arena_of(arena->ctx);
    memset(pattern, 0, sizeof *pattern);
    drape_status status =
        list_neighbours(&scratch, block_count, block_of_node, couplings, coupling_count, &list);
    int64_t blocks = 0;
    if (!status)
        status = make_unique(&scratch, &list, block_count, &blocks);
    if (!status)
        status = allocate(arena, pattern, block_count, blocks);
    if (!status) {
        for (int32_t j = 0; j < pattern->block_count; j++) {
            int32_t first = pattern->block_start[j], length = (int32_t)list.next[j];
            pattern->block_start[j + 1] = first + length;
            memcpy(pattern->block_row + first, list.row + list.start[j], (size_t)length * sizeof *list.row);
            pattern->diagonal[j] = drape_pattern_find(pattern, j, j);
        }
        for (int64_t j = 0; j < pattern->n; j++)
            pattern->column[j + 1] = pattern->column[j] + 3 * (int64_t)(pattern->block_start[j / 3 + 1] -
                                                                        pattern->block_start[j / 3]);
    }
    drape_arena_free(&scratch);
    return status;
}

/* The block at (row, column) or, if the pattern does not have it, another one of that column. */
static int32_t search_column(const drape_pattern *pattern, int32_t row, int32_t column)
{
    int32_t low = pattern->block_start[column], high = pattern->block_start[column + 1];
    while (high - low > 1) {
        int32_t middle = low + (high - low) / 2;
        if (pattern->block_row[middle] <= row)
            low = middle;
        else
            high = middle;
    }
    return low;
}

int32_t drape_pattern_find(const drape_pattern *pattern, int32_t row, int32_t column)
{
    if (row < 0 || column < 0)
        return -1;
    const int32_t block = search_column(pattern, row, column);
    assert(pattern->block_row[block] == row);
    return block;
}

void drape_pattern_list_diagonal(const drape_pattern *p, const double *values, double *diagonal)
{
    for (int32_t j = 0; j < p->block_count; j++) {
        int64_t stride;
        const double *at = drape_pattern_at(p, (double *)(uintptr_t)values, j, p->diagonal[j], &stride);
        for (int c = 0; c < 3; c++)
            diagonal[3 * (int64_t)j + c] = at[c * stride + c];
    }
}

/* Copies have their diagonal from their owners, which have their whole columns. */
bool drape_pattern_is_symmetric(const drape_pattern *p, const double *values, double *diagonal)
{
    double *const from = (double *)(uintptr_t)values; /* only read */
    bool symmetric = true;
    drape_pattern_list_diagonal(p, values, diagonal);
    if (p->ranks)
        p->ranks->fetch_blocks(p->ranks, diagonal);
    for (int32_t j = 0; symmetric && j < drape_pattern_own(p) / 3; j++)
        for (int32_t k = p->diagonal[j]; symmetric && k < p->block_start[j + 1]; k++)
            symmetric =
                drape_pattern_is_mirrored(p, from, j, k, drape_pattern_find(p, j, p->block_row[k]), diagonal);
    return drape_ranks_all(p->ranks, symmetric);
}

void drape_pattern_list_rows(const drape_pattern *pattern, int64_t *row)
{
    for (int64_t j = 0; j < pattern->n; j++)
        for (int64_t k = pattern->column[j]; k < pattern->column[j + 1]; k++)
            row[k] = drape_pattern_row(pattern, j, k);
}

bool drape_pattern_has(const drape_pattern *pattern, int32_t row, int32_t column)
{
    return pattern->block_row[search_column(pattern, row, column)] == row;
}

static int32_t place_of(const drape_pattern *pattern, int32_t row, int32_t column)
{
    if (row < 0 || column < 0)
        return -1;
    const int32_t block = search_column(pattern, row, column);
    return pattern->block_row[block] == row ? block : -1;
}

void drape_pattern_place(const drape_pattern *pattern, const int32_t *block_of_node,
                         const drape_coupling *coupling, int32_t *block)
{
    for (int32_t e = 0; e < coupling->count; e++) {
        const int32_t *node = coupling->node + (size_t)e * (size_t)coupling->nodes;
        for (int a = 0; a < coupling->nodes; a++)
            for (int b = 0; b < coupling->nodes; b++)
                *block++ = place_of(pattern, block_of_node[node[a]], block_of_node[node[b]]);
    }
}

/* Symmetrizes a block and its mirror, which may be the block itself. */
static void symmetrize_block(double *a, int64_t stride, double *b, int64_t mirror_stride)
{
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++) {
            double *one = a + c * stride + r, *other = b + r * mirror_stride + c;
            *one = *other = 0.5 * (*one + *other);
        }
}

void drape_pattern_symmetrize(const drape_pattern *p, double *values)
{
    for (int32_t j = 0; j < p->block_count; j++)
        for (int32_t k = p->diagonal[j]; k < p->block_start[j + 1]; k++) {
            int64_t stride, mirror_stride;
            const int32_t i = p->block_row[k];
            double *block = drape_pattern_at(p, values, j, k, &stride);
            double *mirror = drape_pattern_at(p, values, i, drape_pattern_find(p, j, i), &mirror_stride);
            symmetrize_block(block, stride, mirror, mirror_stride);
        }
}

void drape_pattern_add_antisymmetric(const drape_pattern *p, const double *values, double *to)
{
    double *const from = (double *)(uintptr_t)values; /* only read */
    for (int32_t j = 0; j < p->block_count; j++)
        for (int32_t k = p->block_start[j]; k < p->block_start[j + 1]; k++) {
            int64_t stride, mirror_stride;
            const int32_t i = p->block_row[k];
            const double *block = drape_pattern_at(p, from, j, k, &stride),
                         *mirror = drape_pattern_at(p, from, i, drape_pattern_find(p, j, i), &mirror_stride);
            double *sum = drape_pattern_at(p, to, j, k, &stride);
            for (int c = 0; c < 3; c++)
                for (int r = 0; r < 3; r++)
                    sum[c * stride + r] += (block[c * stride + r] - mirror[r * mirror_stride + c]) / 2;
        }
}

/* On a rank, the columns of its own nodes come before those of copies of other ranks' nodes. A block is
 * complete if its row or its column is of an own node: the loop over own columns and their rows below visits
 * each of these blocks, or its mirror, once. */
double drape_pattern_asymmetry(const drape_pattern *p, const double *values)
{
    double largest = 0, difference = 0;
    for (int32_t j = 0; j < (p->ranks ? p->ranks->own_blocks : p->block_count); j++)
        for (int32_t k = p->diagonal[j]; k < p->block_start[j + 1]; k++) {
            int64_t stride, mirror_stride;
            const int32_t i = p->block_row[k];
            double *const from = (double *)(uintptr_t)values; /* only read */
            const double *block = drape_pattern_at(p, from, j, k, &stride),
                         *mirror = drape_pattern_at(p, from, i, drape_pattern_find(p, j, i), &mirror_stride);
            for (int c = 0; c < 3; c++)
                for (int r = 0; r < 3; r++) {
                    const double one = block[c * stride + r], other = mirror[r * mirror_stride + c];
                    largest = fmax(largest, fmax(fabs(one), fabs(other)));
                    difference = fmax(difference, fabs(one - other));
                }
        }
    largest = drape_ranks_largest(p->ranks, largest);
    difference = drape_ranks_largest(p->ranks, difference);
    return largest > 0 ? difference / largest : 0;
}
