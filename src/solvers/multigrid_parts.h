/* multigrid_parts.h: shared by multigrid.c, which makes the coarse matrices and applies them, and
 * multigrid_build.c, which makes what does not change with the values. */
#ifndef DRAPE_SOLVERS_MULTIGRID_PARTS_H
#define DRAPE_SOLVERS_MULTIGRID_PARTS_H

#include "solvers/multigrid.h"

#define MODES      6 /* rigid motions: unknowns of an aggregate */
#define MAX_LEVELS 20

/* Symmetric, in block rows of `size` scalars. Like the columns of drape_pattern, the scalar rows of a block
 * row are each contiguous: row c begins at values + size (size start[j] + c (start[j + 1] - start[j])). */
typedef struct matrix {
    int size;                           /* 3 or MODES */
    int32_t count;                      /* block rows */
    int32_t *start, *column, *diagonal; /* columns of a row ascend */
    const double *values;
} matrix;

typedef struct level {
    matrix a;
    double *own;     /* the values, except on the finest level */
    double *inverse; /* (count, size x size) of the diagonal blocks */
    double *modes;   /* (count, size x MODES) the rigid motions; then those of each aggregate, orthonormal */
    double *x, *b, *r, *sum;        /* (count x size); sum is NULL on the finest level */
    int32_t coarse;                 /* aggregates; 0: this is the coarsest level */
    int32_t *member_start, *member; /* the rows of each */
    int32_t *aggregate;          /* (count) of a row; -1: it is coupled to no other, and smoothed exactly */
    int32_t *p_start, *p_column; /* pattern of the prolongation, columns of a row ascend */
    double *p;                   /* its blocks, size x MODES */
} level;

struct drape_multigrid {
    int count;
    level level[MAX_LEVELS];
    double *dense;   /* the lower triangle of the factor L L' on the coarsest level; NULL: it is too large */
    double *product; /* a block row of A P */
    int32_t *where, *hit; /* of each coarse column in `product`, or -1; the columns in it */
};

static inline int64_t length(const matrix *a, int32_t row)
{
    return a->start[row + 1] - a->start[row];
}

static inline size_t scalars(const matrix *a)
{
    return (size_t)a->count * (size_t)a->size;
}

static inline size_t nonzeros(const matrix *a)
{
    return (size_t)a->start[a->count] * (size_t)(a->size * a->size);
}

#endif
