/*
 * linear.h: direct and iterative solvers of A x = b for a matrix with a fixed pattern, in one table. An
 * entry is the constant drape_linear_<name> of linear_<name>.c. Analysis happens once, in create; factor
 * may then be called with new values any number of times. If the sparsity changes, the solver is destroyed
 * and created again. The pattern is symmetric; each solver checks itself whether the values are.
 */
#ifndef DRAPE_SOLVERS_LINEAR_H
#define DRAPE_SOLVERS_LINEAR_H

#include "base/archive.h"
#include "base/arena.h"
#include "base/registry.h"
#include "base/thread_pool.h"
#include "sparse/pattern.h"

#include <stdatomic.h>

/* Residual, relative to that of the nonlinear equation, that iterations leave in a correction: as a rule, and
 * where what is left decides the motion or the error test. */
#define DRAPE_LINEAR_TOLERANCE 1e-2
#define DRAPE_LINEAR_TIGHT     1e-4

/* Unknowns of a matrix that is factored where that can be avoided: at a third of these, factors take 1.6
 * GB. */
#define DRAPE_MOST_FACTORED 1000000

typedef struct drape_linear_ops drape_linear_ops;

typedef struct drape_linear_report {
    int64_t fallbacks;                /* matrices that its own method could not factor */
    const drape_linear_ops *fallback; /* the solver that factored them; NULL: none was needed */
} drape_linear_report;

struct drape_linear_ops {
    drape_entry entry;
    /* The smallest number of unknowns for which it was measured to be the fastest solver of a positive
     * definite matrix; `auto` picks by it. 0: it is never the fastest. */
    int64_t best_from;
    /* It takes memory from the heap during a factorisation, or at the first matrix that needs it. If false,
     * it takes none from the second factorisation on. */
    bool borrows_heap;
    /* Which solver stands for this entry at a number of unknowns; an entry with it has no other function.
     * NULL: itself. */
    const drape_linear_ops *(*pick)(int64_t n);
    /* Creates the solver's state in an arena that stays at its address. The pattern must outlive it.
     * Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER; then *state is not set, and the memory taken stays in the
     * arena. */
    drape_status (*create)(drape_arena *arena, const drape_pattern *pattern, void **state);
    /* Sets the threads that it may use from now on; the pool must outlive it. The result does not depend on
     * them. NULL: it uses one thread. */
    void (*use_threads)(void *state, drape_pool *pool);
    /* Sets where the address of a flag is, or NULL, that ends a factorisation with DRAPE_E_STOPPED when it
     * becomes true; the place must outlive the solver. NULL: its factorisations cannot be cancelled. */
    void (*watch)(void *state, const atomic_bool *const *cancel);
    /* Sets the positions of the nodes (pattern->n) [m] for the next factorisation, which chooses its coarse
     * spaces by them. NULL: it has no use for them. */
    void (*set_positions)(void *state, const double *x);
    /* Factors the matrix with these values (pattern->nonzeros), which must stay as they are until the last
     * solve with it: an iterative solver keeps no copy. DRAPE_OK, or DRAPE_RETRY_LINEAR if it is
     * singular to working precision or not finite. With borrows_heap also DRAPE_E_MEMORY, after which it
     * may be called again. */
    drape_status (*factor)(void *state, const double *values);
    /* The same, but refuses a symmetric matrix that is not positive definite with DRAPE_RETRY_LINEAR, here or
     * in a solve that notices it, for callers that then use another matrix. NULL: the solver cannot tell, or
     * factors such a matrix at no extra cost. */
    drape_status (*factor_definite)(void *state, const double *values);
    /* x = A^-1 b; b is not changed. DRAPE_RETRY_LINEAR if there are no factors, or x is not finite or misses
     * the solver's bound on its error. */
    drape_status (*solve)(void *state, const double *b, double *x);
    /* The same, but only until the residual, in a norm of the solver's own, falls below `tolerance` times
     * its initial value; *iterations: how many that took. NULL: the solver is direct. */
    drape_status (*solve_inexact)(void *state, const double *b, double *x, double tolerance,
                                  int64_t *iterations);
    /* Writes what later factors depend on besides the values, such as kept pivots, to an archive or, if the
     * state was just created for the same pattern, reads it back. values: those of the last factor call, if
     * its factors must be available after reading; NULL: factor will be called before any solve. A NULL
     * function: the factors follow from the values alone. Callers use drape_linear_archive. */
    void (*archive)(void *state, drape_archive *a, const double *values);
    /* Releases what is not in the arena, before the arena is freed; callers use drape_linear_destroy. NULL:
     * everything is in the arena. */
    void (*destroy)(void **state);
    /* Bytes that were taken outside the arena, by libraries and for what is shared. NULL: none. */
    size_t (*bytes)(const void *state);
    /* NULL: it solves with its own method only. */
    void (*report)(const void *state, drape_linear_report *report);
};

extern const drape_linear_ops *const drape_linears[]; /* NULL-ended */
extern const char *const drape_linears_names[];       /* choices of a parameter, NULL-ended */
extern const char *const drape_linears_aliases[];     /* its former choices, and what they stand for */
extern const drape_registry drape_linear_registry;

/* Archives a solver; values as in `archive`, and NULL if the last factor call failed. */
void drape_linear_archive(const drape_linear_ops *ops, void *state, drape_archive *a, const double *values);

/* *state becomes NULL; it may be NULL already. */
void drape_linear_destroy(const drape_linear_ops *ops, void **state);
size_t drape_linear_bytes(const drape_linear_ops *ops, const void *state);

/* The solver that an entry of the table stands for at n unknowns; where ranks share the matrix
 * (pattern->ranks), theirs in place of direct ones. */
const drape_linear_ops *drape_linear_of(const drape_ranks *ranks, int number, int64_t n);

/* The solver with the largest best_from that is at most n; if none is, the one with the smallest. */
const drape_linear_ops *drape_linear_best(int64_t n);

/* Says why it is that one. */
enum { DRAPE_LINEAR_WHY = 96 };
void drape_linear_explain(int64_t n, char why[DRAPE_LINEAR_WHY]);

#endif
