/*
 * pattern.h: the sparsity of a symmetric matrix of 3x3 blocks in compressed sparse columns (CSC) of scalars,
 * and the place of each element's blocks in it. It is built once; assembly then adds at known places.
 *
 * Block column j holds the blocks block_start[j] ... block_start[j+1] - 1, with rows ascending. Its three
 * scalar columns have equal lengths, so block k of column j starts at value 9 * block_start[j] + 3 * (k -
 * block_start[j]), and its next column is stride = 3 * (blocks in column j) values further.
 */
#ifndef DRAPE_SPARSE_PATTERN_H
#define DRAPE_SPARSE_PATTERN_H

#include <math.h>

#include "base/arena.h"
#include "base/ranks.h"

typedef struct drape_pattern {
    int32_t block_count;      /* number of block columns */
    int64_t n, nonzeros;      /* scalar sizes: n = 3 block_count */
    int32_t *block_start;     /* (block_count + 1) */
    int32_t *block_row;       /* (blocks) */
    int32_t *diagonal;        /* (block_count) number of the diagonal block of each column */
    int64_t *column;          /* (n + 1) CSC column pointers */
    const drape_ranks *ranks; /* that share the matrix, of which the columns and rows of copies here are not
                                 complete; NULL: it is all here */
} drape_pattern;

/* The number of scalars in vectors here. */
static inline int64_t drape_pattern_own(const drape_pattern *pattern)
{
    return pattern->ranks ? 3 * (int64_t)pattern->ranks->own_blocks : pattern->n;
}

/* Elements that couple all their nodes: node (count x nodes) holds numbers that block_of_node maps to block
 * columns, or to -1. */
typedef struct drape_coupling {
    int32_t count;
    int nodes;
    const int32_t *node;
} drape_coupling;

/* Relative rounding error in a_ij, to which elements contribute at most about sqrt(a_ii a_jj) each. A
 * smaller difference between mirrored entries moves the solution no more than rounding the entries does. */
#define DRAPE_PATTERN_ROUNDING 1e-13

/* Builds the union of the diagonal and all couplings. Errors: DRAPE_E_MEMORY, DRAPE_E_ARGUMENT (more than
 * 2^31 - 1 blocks). */
drape_status drape_pattern_build(drape_arena *arena, int32_t block_count, const int32_t *block_of_node,
                                 const drape_coupling *couplings, int coupling_count, drape_pattern *pattern);

/* Returns the number of the block at (row, column), or -1 if either is -1. It must be in the pattern. */
int32_t drape_pattern_find(const drape_pattern *pattern, int32_t row, int32_t column);
bool drape_pattern_has(const drape_pattern *pattern, int32_t row, int32_t column); /* both must be >= 0 */

/* Writes the block of each pair of nodes of each element, row by row: block (count x nodes x nodes); -1 if it
 * is not in the pattern. */
void drape_pattern_place(const drape_pattern *pattern, const int32_t *block_of_node,
                         const drape_coupling *coupling, int32_t *block);

/* Replaces A by (A + A')/2; a symmetric matrix keeps its bits. */
void drape_pattern_symmetrize(const drape_pattern *pattern, double *values);

/* Adds (A - A')/2 to `to` (nonzeros). */
void drape_pattern_add_antisymmetric(const drape_pattern *pattern, const double *values, double *to);

/* The largest difference of two mirrored entries, in parts of the largest entry. */
double drape_pattern_asymmetry(const drape_pattern *pattern, const double *values);

/* Writes the entries on the diagonal: diagonal (n). */
void drape_pattern_list_diagonal(const drape_pattern *pattern, const double *values, double *diagonal);

/* Whether the matrix is symmetric up to rounding errors (drape_pattern_is_mirrored). diagonal (n) becomes the
 * entries on its diagonal. Where ranks share it, whether all of it is; collective. */
bool drape_pattern_is_symmetric(const drape_pattern *pattern, const double *values, double *diagonal);

/* Writes the CSC row indices: row (nonzeros). */
void drape_pattern_list_rows(const drape_pattern *pattern, int64_t *row);

/* Returns the CSC row index of value number k, which is in scalar column j. */
static inline int64_t drape_pattern_row(const drape_pattern *pattern, int64_t j, int64_t k)
{
    const int64_t q = k - pattern->column[j];
    return 3 * (int64_t)pattern->block_row[pattern->block_start[j / 3] + q / 3] + q % 3;
}

/* Returns the first value of a block and the distance to its next column. */
static inline double *drape_pattern_at(const drape_pattern *pattern, double *values, int32_t column,
                                       int32_t block, int64_t *stride)
{
    int64_t start = pattern->block_start[column];
    *stride = 3 * (pattern->block_start[column + 1] - start);
    return values + 9 * start + 3 * (block - start);
}

/* The largest absolute value in a block. */
static inline double drape_pattern_largest(const double *block, int64_t stride)
{
    double largest = 0;
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            largest = fmax(largest, fabs(block[c * stride + r]));
    return largest;
}

/* Whether the block `block` of a column is the transpose of the block `mirrored`, up to rounding errors.
 * diagonal (n): the entries on the diagonal of the matrix. */
static inline bool drape_pattern_is_mirrored(const drape_pattern *p, double *values, int32_t column,
                                             int32_t block, int32_t mirrored, const double *diagonal)
{
    const int32_t row = p->block_row[block];
    const double *d = diagonal + 3 * (int64_t)column, *e = diagonal + 3 * (int64_t)row;
    int64_t stride, mirror_stride;
    const double *a = drape_pattern_at(p, values, column, block, &stride),
                 *b = drape_pattern_at(p, values, row, mirrored, &mirror_stride);
    bool same = true, symmetric = true;
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            same &= a[c * stride + r] == b[r * mirror_stride + c];
    for (int i = 0; !same && i < 9; i++) {
        const int c = i / 3, r = i % 3;
        const double difference = a[c * stride + r] - b[r * mirror_stride + c];
        symmetric &=
            difference * difference <= DRAPE_PATTERN_ROUNDING * DRAPE_PATTERN_ROUNDING * fabs(e[r] * d[c]);
    }
    return symmetric;
}

#endif
