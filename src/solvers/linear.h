/*
 * linear.h: direct and iterative solvers of A x = b for a matrix of a fixed pattern, as rows of one table. A
 * row is the constant drape_linear_<word> of linear_<word>.c. Analysis happens once, in create; factor may be
 * called with new values any number of times. Where the sparsity changes, the solver is destroyed and made
 * again. The pattern is symmetric; whether the values are is for the row to see: no caller says it.
 */
#ifndef DRAPE_SOLVERS_LINEAR_H
#define DRAPE_SOLVERS_LINEAR_H

#include "base/archive.h"
#include "base/arena.h"
#include "base/crew.h"
#include "sparse/pattern.h"

typedef struct drape_linear_ops drape_linear_ops;

/* What a solver has to say of itself. */
typedef struct drape_linear_report {
    const drape_linear_ops *row;      /* that solves: the one asked for, or one that it picked */
    char why[96];                     /* it was picked; "" where nothing was */
    int64_t fallbacks;                /* matrices that were not for its method */
    const drape_linear_ops *fallback; /* the row that was given them; NULL: none was */
} drape_linear_report;

struct drape_linear_ops {
    const char *name, *summary, *reference;
    /* Unknowns from which on it is measured to be the fastest for a positive definite matrix: what `auto` goes
     * by. 0: at no size. */
    int64_t best_from;
    /* The same for a matrix that has no Cholesky factors: what rows that need them fall back to. */
    int64_t general_from;
    /* The library behind it takes heap for the time of a factorisation and gives it back, or it takes what it
     * keeps at the first matrix that needs it. Else nothing is taken from the second factorisation on. */
    bool borrows_heap;
    /* Makes the solver's state in an arena that keeps its address. pattern outlives it. Errors: DRAPE_E_MEMORY,
     * DRAPE_E_SOLVER; then *state is not set, and what was taken stays in the arena. */
    drape_status (*create)(drape_arena *arena, const drape_pattern *pattern, void **state);
    /* The threads that it may use from now on, which outlive it; the result does not depend on them. NULL: it uses one. */
    void (*use_threads)(void *state, drape_crew *crew);
    /* Takes the values (pattern->nonzeros). DRAPE_OK, or DRAPE_RETRY_LINEAR: singular to working precision,
     * or not finite. Where it borrows heap also DRAPE_E_MEMORY, and it may be called again. */
    drape_status (*factor)(void *state, const double *values);
    /* The same, but a symmetric matrix that is not positive definite is refused with DRAPE_RETRY_LINEAR, for
     * callers that have another one then. NULL: it cannot tell, or it costs no more. */
    drape_status (*factor_definite)(void *state, const double *values);
    /* x = A^-1 b, b untouched. */
    drape_status (*solve)(void *state, const double *b, double *x);
    /* The same with the residual only reduced to a share `tolerance`, in a norm of the row's own; *iterations: how
     * many it took. NULL: it is direct. */
    drape_status (*solve_inexact)(void *state, const double *b, double *x, double tolerance,
                                  int64_t *iterations);
    /* What has a part in later factors besides their values, such as pivots that are kept, into an archive or, where
     * the state was just made for the same pattern, out of it. values: those of the last factor, if its factors are
     * to stand again after a reading; NULL: factor comes before any solve. NULL: factors follow from values alone.
     * Callers use drape_linear_archive. */
    void (*archive)(void *state, drape_archive *a, const double *values);
    /* Gives back what is not of the arena, and comes before the arena's end: see drape_linear_destroy. NULL: all of it is. */
    void (*destroy)(void **state);
    /* Bytes that libraries took beside the arena, factors included. NULL: none. */
    size_t (*bytes)(const void *state);
    /* NULL: it is what its name says. */
    void (*report)(const void *state, drape_linear_report *report);
};

extern const drape_linear_ops *const drape_linears[]; /* NULL-ended */
extern const char *const drape_linears_words[];       /* their names, NULL-ended */

/* Archives a solver; values as in its row, NULL where its last factor failed, too. */
void drape_linear_archive(const drape_linear_ops *row, void *state, drape_archive *a, const double *values);

/* *state becomes NULL; it may be NULL. */
void drape_linear_destroy(const drape_linear_ops *ops, void **state);
size_t drape_linear_bytes(const drape_linear_ops *ops, const void *state);

/* The row with the largest best_from, or general_from, that is not above n unknowns. */
const drape_linear_ops *drape_linear_best(int64_t n);
const drape_linear_ops *drape_linear_general(int64_t n);

#endif
