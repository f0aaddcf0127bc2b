/*
 * linear.h: direct and iterative solvers of A x = b for a matrix of a fixed pattern, one table of them. An
 * entry is the constant drape_linear_<name> of linear_<name>.c. Analysis happens once, in create; factor may
 * be called with new values any number of times. Where the sparsity changes, the solver is destroyed and made
 * again. The pattern is symmetric; each solver finds out itself whether the values are.
 */
#ifndef DRAPE_SOLVERS_LINEAR_H
#define DRAPE_SOLVERS_LINEAR_H

#include "base/archive.h"
#include "base/arena.h"
#include "base/registry.h"
#include "base/thread_pool.h"
#include "sparse/pattern.h"

typedef struct drape_linear_ops drape_linear_ops;

/* What a solver did. */
typedef struct drape_linear_report {
    const drape_linear_ops *row;      /* the solver: the one asked for, or the one that it picked */
    char why[96];                     /* why it was picked; "" if it was not */
    int64_t fallbacks;                /* matrices that its method could not factor */
    const drape_linear_ops *fallback; /* the solver that factored them; NULL: none did */
} drape_linear_report;

struct drape_linear_ops {
    drape_entry entry;
    /* The number of unknowns from which on it was measured to be the fastest for a positive definite matrix;
     * `auto` picks by it. 0: at no size. */
    int64_t best_from;
    /* The same for a matrix that has no Cholesky factors: fallbacks are picked by it. */
    int64_t general_from;
    /* It takes heap during a factorisation, or memory at the first matrix that needs it. If false, nothing is
     * taken from the second factorisation on. */
    bool borrows_heap;
    /* Makes the solver's state in an arena that keeps its address. pattern outlives it. Errors:
     * DRAPE_E_MEMORY, DRAPE_E_SOLVER; then *state is not set, and what was taken stays in the arena. */
    drape_status (*create)(drape_arena *arena, const drape_pattern *pattern, void **state);
    /* The threads that it may use from now on, which outlive it; the result does not depend on them. NULL: it
     * uses one thread. */
    void (*use_threads)(void *state, drape_pool *pool);
    /* Takes the values (pattern->nonzeros). DRAPE_OK, or DRAPE_RETRY_LINEAR: singular to working precision,
     * or not finite. Where it borrows heap also DRAPE_E_MEMORY, and it may be called again. */
    drape_status (*factor)(void *state, const double *values);
    /* The same, but a symmetric matrix that is not positive definite is refused with DRAPE_RETRY_LINEAR, for
     * callers that then have another matrix. NULL: it does not find out, or factors such a matrix at no extra
     * cost. */
    drape_status (*factor_definite)(void *state, const double *values);
    /* x = A^-1 b, b untouched. */
    drape_status (*solve)(void *state, const double *b, double *x);
    /* The same, but only until the residual is below the share `tolerance`, in a norm of the solver's own;
     * *iterations: how many it took. NULL: it is direct. */
    drape_status (*solve_inexact)(void *state, const double *b, double *x, double tolerance,
                                  int64_t *iterations);
    /* Writes what later factors depend on besides the values, such as pivots that are kept, into an archive
     * or, where the state was just made for the same pattern, reads it. values: those of the last factor, if
     * its factors are to stand again after a reading; NULL: factor comes before any solve. NULL: factors
     * follow from values alone. Callers use drape_linear_archive. */
    void (*archive)(void *state, drape_archive *a, const double *values);
    /* Gives back what is not of the arena, and comes before the arena's end: see drape_linear_destroy. NULL:
     * all of it is. */
    void (*destroy)(void **state);
    /* Bytes that libraries took beside the arena, factors included. NULL: none. */
    size_t (*bytes)(const void *state);
    /* NULL: it solves itself. */
    void (*report)(const void *state, drape_linear_report *report);
};

extern const drape_linear_ops *const drape_linears[]; /* NULL-ended */
extern const char *const drape_linears_names[];       /* choices of a parameter, NULL-ended */
extern const drape_registry drape_linear_registry;

/* Archives a solver; values as of archive, and NULL where its last factor failed. */
void drape_linear_archive(const drape_linear_ops *row, void *state, drape_archive *a, const double *values);

/* *state becomes NULL; it may be NULL. */
void drape_linear_destroy(const drape_linear_ops *ops, void **state);
size_t drape_linear_bytes(const drape_linear_ops *ops, const void *state);

/* The solver with the largest best_from, or general_from, that is at most n unknowns. */
const drape_linear_ops *drape_linear_best(int64_t n);
const drape_linear_ops *drape_linear_general(int64_t n);

#endif
