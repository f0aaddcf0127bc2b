/* dense: LU factorisation with partial pivoting of the full matrix, by SUNDIALS: n^2 numbers, 2/3 n^3
 * operations. The baseline against which the sparse solvers are measured. */
#include "solvers/linear.h"

#include "base/finite.h"

#include <string.h>
#include <sundials/sundials_dense.h>

typedef struct dense_state {
    const drape_pattern *pattern;
    double **column; /* (n) pointers to the columns, as SUNDIALS represents its dense matrices */
    double *values;  /* (n x n) column-major */
    sunindextype *pivot;
    bool factored;
} dense_state;

static drape_status create(drape_arena *arena, const drape_pattern *pattern, void **state)
{
    const size_t n = (size_t)pattern->n;
    dense_state *s = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    s->pattern = pattern;
    s->column = drape_arena_take(arena, n, sizeof *s->column);
    s->values = n <= UINT32_MAX ? drape_arena_take(arena, n * n, sizeof *s->values) : NULL;
    s->pivot = drape_arena_take(arena, n, sizeof *s->pivot);
    if (!s->column || !s->values || !s->pivot)
        return drape_fail(arena->ctx, DRAPE_E_MEMORY,
                          "out of memory: the dense solver needs %.3g bytes for %zu unknowns; use klu",
                          8.0 * (double)n * (double)n, n);
    for (size_t j = 0; j < n; j++)
        s->column[j] = s->values + n * j;
    *state = s;
    return DRAPE_OK;
}

static drape_status factor(void *state, const double *values)
{
    dense_state *s = state;
    const drape_pattern *p = s->pattern;
    memset(s->values, 0, (size_t)p->n * (size_t)p->n * sizeof *s->values);
    for (int64_t j = 0; j < p->n; j++)
        for (int64_t k = p->column[j]; k < p->column[j + 1]; k++)
            s->column[j][drape_pattern_row(p, j, k)] = values[k];
    s->factored = drape_all_finite(values, (size_t)p->nonzeros) &&
                  SUNDlsMat_denseGETRF(s->column, p->n, p->n, s->pivot) == 0;
    return s->factored ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

static drape_status solve(void *state, const double *b, double *x)
{
    dense_state *s = state;
    if (!s->factored)
        return DRAPE_RETRY_LINEAR;
    memcpy(x, b, (size_t)s->pattern->n * sizeof *x);
    SUNDlsMat_denseGETRS(s->column, s->pattern->n, s->pivot, x);
    return drape_all_finite(x, (size_t)s->pattern->n) ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

const drape_linear_ops drape_linear_dense = {
    .entry = {.name = "dense",
              .summary = "full LU with partial pivoting: the baseline, for small scenes",
              .reference = "SUNDIALS dense solver"},
    .create = create,
    .factor = factor,
    .solve = solve,
};
