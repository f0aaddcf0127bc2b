/*
 * fronts.h: the fronts of the multifrontal method (Duff & Reid 1983; Liu 1992): how they are stored, how they
 * are assembled, and how the tree is traversed by several threads. A front is a dense matrix that consists of
 * a few columns of the matrix and all rows that fill in below them. It is assembled from the entries of its
 * columns and from the updates of its children; then its columns are factored; the Schur complement on its
 * rows is its update, which goes to its parent in the elimination tree.
 *
 * The matrix is stored in two halves: its lower triangle, and its upper triangle transposed. Both have the
 * same positions. A symmetric matrix needs the first only.
 *
 * Fronts in different branches of the tree are independent: each branch is a task for one thread, and the
 * few large fronts at the top, which join the branches, are each shared by all threads. Every sum is added
 * in an order that depends on the pattern alone, so the bits do not depend on the number of threads.
 */
#ifndef DRAPE_SOLVERS_FRONTS_H
#define DRAPE_SOLVERS_FRONTS_H

#include "base/thread_pool.h"
#include "solvers/elimination.h"
#include "solvers/tiles.h"

#include <stdatomic.h>

/* The size of a front, and where it is stored. Its panel holds its columns, its update what it passes to
 * its parent. */
typedef struct drape_front {
    int32_t columns, rows; /* scalars: factored columns, and rows below them */
    int32_t column_strips, row_strips;
    int64_t panel, update;        /* where they begin in `panels` and `updates` */
    int32_t first_child, sibling; /* -1: none */
    int32_t branch;               /* -1: at the top */
    bool odd;                     /* its depth in the tree is odd */
} drape_front;

typedef enum drape_half { DRAPE_LOWER, DRAPE_UPPER, DRAPE_HALVES } drape_half;

typedef struct drape_fronts {
    const drape_pattern *pattern;
    drape_shared_elimination *shared;
    drape_elimination e;           /* that of `shared`, which has its arrays */
    drape_front *front;            /* (e.count) */
    int32_t *branch, branch_count; /* first and last front of each branch; children come before parents */
    int32_t *top, top_count;       /* the fronts in no branch, children first */
    int32_t *source[DRAPE_HALVES]; /* (lower blocks, in the order of elimination) the block of the pattern and
                                      its mirrored block; the second is NULL until the upper half is taken */
    int32_t *target;               /* the position of each in the panel of its front */
    int32_t *target_start;         /* (e.n + 1) where each column begins in source and target */
    int32_t *in_panel, *in_update; /* (rows of all fronts) position of a row in the front's parent, counted
                                      from the beginning of a column: in the parent's panel, and in its
                                      update, there from the tile of the first strip. in_update -1: the parent
                                      factors the row */
    double *panels[DRAPE_HALVES], *updates[DRAPE_HALVES]; /* aligned for the tiles; the second may be NULL */
    int64_t panel_size, update_size;
    int32_t widest, tallest; /* of all fronts: most columns and most rows, in scalars of whole strips */
    double *work;            /* (n) the solution, in the order of elimination */
    double *left;            /* (rows of all fronts x 3) what each front passes on in a solve */
    double *scratch;         /* (branches + 1, drape_fronts_scratch) */
    bool *failed;            /* (e.count) the front has no factors */
    const double *values;    /* of the matrix that is being factored */
    drape_pool *pool;        /* NULL: one thread */
    const atomic_bool *const *cancel; /* where the address of a flag is that ends a factorisation */
} drape_fronts;

/* Orders the matrix and takes all memory for its lower half. Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER (a front
 * is too large for 32-bit positions); then there is nothing to destroy. */
drape_status drape_fronts_create(drape_arena *arena, const drape_pattern *pattern, drape_fronts *s);

/* Gives back what is not in the arena. */
void drape_fronts_destroy(drape_fronts *s);

/* Take the panels of the upper half, or its updates. Errors: DRAPE_E_MEMORY. */
drape_status drape_fronts_take_upper_panels(drape_arena *arena, drape_fronts *s);
drape_status drape_fronts_take_upper_updates(drape_arena *arena, drape_fronts *s);

/* ---- Factorisation ---- */

/* A front being factored, as seen by the tasks that share the work. */
typedef struct drape_front_job {
    drape_fronts *s;
    int32_t index;
    const drape_front *f;
    double *panel[DRAPE_HALVES], *update[DRAPE_HALVES];
    drape_pool *pool; /* NULL: one thread, in a branch */
    void *user;
} drape_front_job;

/* Clears the panel of a half and adds the entries of its columns and the updates of its children. */
void drape_front_assemble(const drape_front_job *w, drape_half half);

/* Adds to a half of the front's own update, which was written before, the rest of its children's. */
void drape_front_extend_add(const drape_front_job *w, drape_half half);

/* Factors one assembled front and computes its update; false: it has no factors. */
typedef bool drape_front_factor(drape_front_job *w);

/* Factors all fronts. DRAPE_RETRY_LINEAR if one has no factors, DRAPE_E_STOPPED if it was cancelled. */
drape_status drape_fronts_factor(drape_fronts *s, drape_front_factor *factor, void *user);
bool drape_fronts_cancelled(const drape_fronts *s);

/* A strip of the panel; the tile of the front's update at these strips of rows. */
static inline double *drape_front_strip(const drape_front_job *w, drape_half half, int64_t strip)
{
    return w->panel[half] + strip * DRAPE_STRIP * w->f->columns;
}

/* Tiles on and below the diagonal are stored, by columns of tiles. */
static inline int64_t drape_front_tile_at(const drape_front *f, int32_t row_strip, int32_t column_strip)
{
    const int64_t c = column_strip;
    return (c * f->row_strips - c * (c - 1) / 2 + row_strip - c) * DRAPE_TILE;
}

/* The number of doubles of scratch for one branch, or for the top. */
int64_t drape_fronts_scratch(const drape_fronts *s);

#endif
