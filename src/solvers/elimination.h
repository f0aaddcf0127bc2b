/*
 * elimination.h: the order in which a symmetric matrix of 3 x 3 blocks is eliminated, and the fill-in.
 * Columns of blocks with the same rows below them are taken together as a front (a supernode); the fronts
 * form a tree: what a front's elimination leaves on its rows is added to its parent, whose columns and rows
 * contain all of them.
 */
#ifndef DRAPE_SOLVERS_ELIMINATION_H
#define DRAPE_SOLVERS_ELIMINATION_H

#include "sparse/pattern.h"

typedef struct drape_elimination {
    int32_t n;          /* block columns */
    int32_t *order;     /* (n) the block column of the pattern that is eliminated k-th */
    int32_t *place;     /* (n) its inverse */
    int32_t count;      /* fronts, children before parents */
    int32_t *first;     /* (count + 1) the first column of each, in the order of elimination */
    int32_t *parent;    /* (count) -1: none */
    int64_t *row_start; /* (count + 1) */
    int32_t *row;       /* rows below the columns of a front, ascending, in the order of elimination */
    int32_t *in_parent; /* of each row: its number among the columns and then the rows of the parent */
    double *work;       /* (count) multiplications and additions, roughly */
} drape_elimination;

/* Errors: DRAPE_E_MEMORY. */
drape_status drape_elimination_create(drape_arena *arena, const drape_pattern *pattern, drape_elimination *e);

static inline int32_t drape_front_columns(const drape_elimination *e, int32_t front)
{
    return e->first[front + 1] - e->first[front];
}

static inline int32_t drape_front_rows(const drape_elimination *e, int32_t front)
{
    return (int32_t)(e->row_start[front + 1] - e->row_start[front]);
}

/* The number of a row among the columns and then the rows of a front that has it. */
int32_t drape_front_find(const drape_elimination *e, int32_t front, int32_t row);

#endif
