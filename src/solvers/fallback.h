/*
 * fallback.h: the direct solver `multifrontal`, or that of the ranks that share the matrix, to which an
 * iterative solver passes the matrices that it cannot solve, unchanged. It is created for the first such
 * matrix, because most scenes have none.
 */
#ifndef DRAPE_SOLVERS_FALLBACK_H
#define DRAPE_SOLVERS_FALLBACK_H

#include "solvers/linear.h"

typedef struct drape_fallback {
    const drape_linear_ops *ops;
    const drape_pattern *pattern;
    drape_arena arena; /* holds the solver */
    void *solver;      /* NULL before the first such matrix */
    drape_pool *pool;  /* of the solver, as in drape_linear_ops, and its flag */
    const atomic_bool *const *cancel;
    bool active;   /* the last matrix was factored here */
    int64_t count; /* matrices passed to it */
} drape_fallback;

/* The arena must stay at its address. Takes no memory. */
drape_fallback drape_fallback_of(drape_arena *arena, const drape_pattern *pattern);
void drape_fallback_destroy(drape_fallback *fallback);
void drape_fallback_use_threads(drape_fallback *fallback, drape_pool *pool);
void drape_fallback_watch(drape_fallback *fallback, const atomic_bool *const *cancel);

/* Errors: those of the solver's create and factor; after one it is not active, and may be called again. */
drape_status drape_fallback_factor(drape_fallback *fallback, const double *values);

/* Archives the state of the solver and the owner's *factored; values as in drape_linear_ops.archive. */
void drape_fallback_archive(drape_fallback *fallback, bool *factored, drape_archive *a, const double *values);

/* The owner's report; the bytes that libraries took. */
drape_linear_report drape_fallback_report(const drape_fallback *fallback, const drape_linear_ops *owner);
size_t drape_fallback_bytes(const drape_fallback *fallback);

#endif
