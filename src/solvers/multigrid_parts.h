/* multigrid_parts.h: shared by multigrid.c, which makes the coarse matrices and applies them,
 * multigrid_build.c, which makes what does not change with the values, and multigrid_border.c, which makes
 * what ranks exchange. */
#ifndef DRAPE_SOLVERS_MULTIGRID_PARTS_H
#define DRAPE_SOLVERS_MULTIGRID_PARTS_H

#include "solvers/multigrid.h"

#include <string.h>

#define MODES      6  /* rigid motions, translations and rotations: unknowns of an aggregate */
#define MAX_LEVELS 32 /* a level usually has a few times fewer rows, whose numbers have 32 bits */

/* Symmetric, in block rows of `size` scalars. Like the columns of drape_pattern, the scalar rows of a block
 * row are each contiguous: row c begins at values + size (size start[j] + c (start[j + 1] - start[j])). */
typedef struct matrix {
    int size;                           /* 3 or MODES */
    int32_t count;                      /* block rows */
    int32_t columns;                    /* block columns: these, then the copies of rows of other ranks */
    int32_t *start, *column, *diagonal; /* columns of a row ascend. start (columns + 1): also of copies, with
                                           what this rank knows of them, or adds to them */
    const double *values;
} matrix;

/* What ranks exchange of a level that they share. Each has its own rows, all columns of these, and copies of
 * the rows of other ranks that are among these columns. */
typedef struct border {
    const drape_ranks *ranks;
    int32_t *first;         /* (ranks + 1) number of the first row of each in the matrix of all */
    int32_t *number;        /* (columns - count) of the copies */
    int32_t count;          /* rows with copies among their columns */
    int32_t *row, *outside; /* (count) these; the first block of each in the column of a copy */
    double *spread;         /* (count) what the smoother adds to their diagonal blocks, in parts of these */
    double *copies;         /* (columns - count, size) scratch */
    drape_exchange *rows;   /* items of up to size x MODES numbers: a row each */
    drape_exchange *prolongation; /* items of size x MODES: blocks of P in rows of copies */
    drape_exchange *products; /* items of MODES: rows of blocks of the next matrix in its rows of copies */
} border;

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
    border *border;              /* NULL: the level is of one process */
} level;

/* The levels from the coarsest one that ranks share on, which each of them has as a whole. */
typedef struct gathered {
    struct drape_multigrid *multigrid;
    int32_t *first_block; /* (ranks + 1) of the blocks of each rank */
    int32_t *place;       /* (blocks) where a shared block is in its row */
    double *shared;       /* (blocks, MODES x MODES) */
} gathered;

struct drape_multigrid {
    int count;
    level level[MAX_LEVELS];
    gathered whole;  /* where ranks share the levels above */
    double *dense;   /* the lower triangle of the factor L L' on the coarsest level; NULL: it is too large */
    double *product; /* a block row of A P */
    int32_t *where, *hit; /* of each coarse column in `product`, or -1; the columns in it */
};

/* The neighbours of each row, itself among them, and how near they are: for nodes, how many neighbours both
 * share; for aggregates, how many couplings are between them. */
typedef struct graph {
    int32_t count;
    int32_t *start, *neighbor, *weight;
} graph;

/* Lists of columns, ascending: column[start[i]] ... column[start[i + 1] - 1]. */
typedef struct lists {
    int32_t *start, *column;
} lists;

/* A rank that alone is out of memory must not leave the others waiting: before they exchange anything, the
 * ranks agree on whether all are `good`. Collective. */
static inline drape_status agree(const drape_ranks *ranks, const drape_arena *arena, bool good)
{
    return drape_ranks_agree_memory(ranks, arena->ctx, good);
}

/* The border of the level that a pattern describes, which ranks share. Errors: DRAPE_E_MEMORY, as below.
 * These functions are collective; the status may be of this rank only. */
drape_status drape_border_create(drape_arena *arena, const drape_pattern *pattern, level *l);

/* After the aggregates were formed: numbers them over all ranks, also those of copies, and begins the border
 * of the next level, which has them as rows. */
drape_status drape_border_number(drape_arena *arena, level *l, level *next);

/* After the prolongation has the columns of the rows here: also those of copies. Then all these columns
 * become rows and copies of the next level, and aggregates are numbered as these are. *reach: the columns of
 * A P in copies, and nothing in rows. */
drape_status drape_border_prolong(drape_arena *arena, drape_arena *scratch, level *l, level *next,
                                  lists *reach);

/* After the next matrix has its pattern. */
drape_status drape_border_finish(drape_arena *arena, drape_arena *scratch, level *l, level *next);

/* The matrix of all ranks as one, and its graph, which has the memory of *g. */
drape_status drape_border_gather(drape_arena *arena, drape_arena *scratch, const level *l, graph *g,
                                 gathered *out);

/* NULL: one process has the level. */
static inline const drape_ranks *ranks_of(const level *l)
{
    return l->border ? l->border->ranks : NULL;
}

/* The rank that has the row of a number in the matrix of all ranks. */
static inline int rank_of(const border *b, int32_t number)
{
    int low = 0, high = b->ranks->count;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        *(b->first[middle] <= number ? &low : &high) = middle;
    }
    return low;
}

/* Adds a number to an ascending list that does not have it. */
static inline int32_t insert(int32_t *list, int32_t count, int32_t value)
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
    return (size_t)a->start[a->columns] * (size_t)(a->size * a->size);
}

/* The rows of a level on all ranks. */
static inline int64_t all_rows(const level *l)
{
    return l->border ? l->border->first[l->border->ranks->count] : l->a.count;
}

#endif
