/*
 * elimination.h: the order in which a symmetric matrix of 3 x 3 blocks is eliminated, and the fill-in.
 * Block columns with the same rows below them form a front (a supernode). The fronts form a tree: the
 * update that a front's elimination leaves on its rows is added to its parent, whose columns and rows
 * contain all of these rows.
 */
#ifndef DRAPE_SOLVERS_ELIMINATION_H
#define DRAPE_SOLVERS_ELIMINATION_H

#include "sparse/pattern.h"

typedef struct drape_elimination {
    int32_t n;          /* block columns */
    int32_t *order;     /* (n) the block column of the pattern that is eliminated k-th */
    int32_t *place;     /* (n) its inverse */
    int32_t count;      /* number of fronts, children before parents */
    int32_t *first;     /* (count + 1) the first column of each front, in the order of elimination */
    int32_t *parent;    /* (count) of each front; -1: none */
    int64_t *row_start; /* (count + 1) where the rows of each front begin in `row` */
    int32_t *row;       /* the rows below the columns of each front, ascending, in the order of elimination */
    int32_t *in_parent; /* for each of these rows: its index among the columns and then the rows of the
                           parent */
    double *work;       /* (count) multiplications and additions of each front, roughly */
} drape_elimination;

/* An elimination depends on the pattern alone, and finding it takes as long as several factorisations of a
 * small matrix: all solvers of a context that have equal patterns share one, which lives as long as one of
 * them. So a sim that is made again for a changed model does not order its matrix again. */
typedef struct drape_shared_elimination drape_shared_elimination;

/* Finds the one of this pattern, or makes it. Errors: DRAPE_E_MEMORY; then *out is NULL. */
drape_status drape_elimination_share(drape_context *ctx, const drape_pattern *pattern,
                                     drape_shared_elimination **out);

/* Gives it back and sets *shared to NULL, which it may be already. */
void drape_elimination_release(drape_shared_elimination **shared);

const drape_elimination *drape_elimination_of(const drape_shared_elimination *shared);
size_t drape_elimination_bytes(const drape_shared_elimination *shared);

static inline int32_t drape_front_columns(const drape_elimination *e, int32_t front)
{
    return e->first[front + 1] - e->first[front];
}

static inline int32_t drape_front_rows(const drape_elimination *e, int32_t front)
{
    return (int32_t)(e->row_start[front + 1] - e->row_start[front]);
}

/* The index of a row among the columns and then the rows of a front that contains it. */
int32_t drape_front_find(const drape_elimination *e, int32_t front, int32_t row);

#endif
