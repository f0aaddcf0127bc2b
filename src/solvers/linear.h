/*
 * linear.h: direct and iterative solvers of A x = b for a matrix of a fixed pattern, as rows of one table. A
 * row is the constant drape_linear_<word> of linear_<word>.c. Analysis happens once, in create; factor may be
 * called with new values any number of times.
 */
#ifndef DRAPE_SOLVERS_LINEAR_H
#define DRAPE_SOLVERS_LINEAR_H

#include "sparse/pattern.h"

typedef struct drape_linear_ops {
    const char *name, *summary, *reference;
    /* Makes the solver's state. pattern outlives it. Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER. */
    drape_status (*create)(drape_context *ctx, const drape_pattern *pattern, void **state);
    /* Takes the values (pattern->nonzeros). DRAPE_OK, or DRAPE_RETRY_LINEAR: singular to working precision,
     * or not finite. */
    drape_status (*factor)(void *state, const double *values);
    /* x = A^-1 b, b untouched. */
    drape_status (*solve)(void *state, const double *b, double *x);
    void (*destroy)(void **state);
    /* Bytes that the factors take. */
    size_t (*bytes)(const void *state);
} drape_linear_ops;

extern const drape_linear_ops *const drape_linears[]; /* NULL-ended */
extern const char *const drape_linears_words[];       /* their names, NULL-ended */

#endif
