/* dense: LU with partial pivoting of the full matrix by SUNDIALS: n^2 numbers, 2/3 n^3 operations. The
 * baseline that sparse solvers are measured against. */
#include "solvers/linear.h"

#include "base/finite.h"

#include <string.h>
#include <sundials/sundials_dense.h>

typedef struct dense_state {
    drape_context *ctx;
    const drape_pattern *pattern;
    double **column; /* (n) pointers to columns, as SUNDIALS has its dense matrices */
    double *values;  /* (n x n) column-major */
    sunindextype *pivot;
    bool factored;
} dense_state;

static void destroy(void **state)
{
    dense_state *s = *state;
    if (!s)
        return;
    drape_free(s->ctx, s->column);
    drape_free(s->ctx, s->values);
    drape_free(s->ctx, s->pivot);
    drape_free(s->ctx, s);
    *state = NULL;
}

static drape_status create(drape_context *ctx, const drape_pattern *pattern, void **state)
{
    size_t n = (size_t)pattern->n;
    dense_state *s = drape_alloc(ctx, 1, sizeof *s);
    *state = s;
    if (!s)
        return DRAPE_E_MEMORY;
    s->ctx = ctx;
    s->pattern = pattern;
    s->column = drape_alloc(ctx, n, sizeof *s->column);
    s->values = n <= UINT32_MAX ? drape_alloc(ctx, n * n, sizeof *s->values) : NULL;
    s->pivot = drape_alloc(ctx, n, sizeof *s->pivot);
    if (!s->column || !s->values || !s->pivot) {
        destroy(state);
        return drape_fail(ctx, DRAPE_E_MEMORY,
                          "out of memory: the dense solver needs %.3g bytes for %zu unknowns; use klu",
                          8.0 * (double)n * (double)n, n);
    }
    for (size_t j = 0; j < n; j++)
        s->column[j] = s->values + n * j;
    return DRAPE_OK;
}

static drape_status factor(void *state, const double *values)
{
    dense_state *s = state;
    const drape_pattern *p = s->pattern;
    memset(s->values, 0, (size_t)p->n * (size_t)p->n * sizeof *s->values);
    for (int64_t j = 0; j < p->n; j++)
        for (int64_t k = p->column[j]; k < p->column[j + 1]; k++)
            s->column[j][p->row[k]] = values[k];
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

static size_t bytes(const void *state)
{
    size_t n = (size_t)((const dense_state *)state)->pattern->n;
    return n * n * sizeof(double);
}

const drape_linear_ops drape_linear_dense = {
    .entry = {.name = "dense",
              .summary = "full LU with partial pivoting: the baseline, for small scenes",
              .reference = "SUNDIALS dense solver"},
    .create = create,
    .factor = factor,
    .solve = solve,
    .destroy = destroy,
    .bytes = bytes,
};
