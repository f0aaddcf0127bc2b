/*
 * umfpack: multifrontal LU factorisation by UMFPACK (Davis 2004), for large matrices without Cholesky
 * factors. The ordering assumes a symmetric pattern: AMD, with pivots on the diagonal unless they are
 * smaller than a thousandth of the largest entry below. Ordering and analysis are done once, in create;
 * each factorisation chooses its own pivots and takes new memory from the heap for its factors.
 */
#include "solvers/library_lock.h"
#include "solvers/linear.h"

#include "base/finite.h"

#include <math.h>
#include <stdlib.h>
#include <umfpack.h>

#define MIN_RCOND 1e-15 /* smaller: singular to working precision */

typedef SuiteSparse_long index_t;

typedef struct umfpack_state {
    const drape_pattern *pattern;
    double control[UMFPACK_CONTROL], info[UMFPACK_INFO];
    void *symbolic;
    void *numeric;  /* NULL before the first and after a failed factorisation */
    index_t *index; /* (n) workspace of solve */
    double *work;   /* workspace of solve */
} umfpack_state;

_Static_assert(sizeof(index_t) == sizeof(int64_t), "the pattern's indices are passed to UMFPACK as they are");

/* int64_t may be a different type of the same size. */
static const index_t *indices(const int64_t *array)
{
    return (const index_t *)array;
}

static void destroy(void **state)
{
    umfpack_state *s = *state;
    umfpack_dl_free_numeric(&s->numeric);
    umfpack_dl_free_symbolic(&s->symbolic);
}

static void set_control(double *control)
{
    umfpack_dl_defaults(control);
    control[UMFPACK_STRATEGY] = UMFPACK_STRATEGY_SYMMETRIC;
    control[UMFPACK_ORDERING] = UMFPACK_ORDERING_AMD;
    control[UMFPACK_IRSTEP] = 0;
}

static drape_status create(drape_arena *arena, const drape_pattern *pattern, void **state)
{
    umfpack_state *s = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    s->pattern = pattern;
    set_control(s->control);
    s->index = drape_arena_take(arena, (size_t)pattern->n, sizeof *s->index);
    s->work = drape_arena_take(arena, (size_t)pattern->n, sizeof *s->work);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    index_t code = umfpack_dl_symbolic(pattern->n, pattern->n, indices(pattern->column),
                                       indices(pattern->row), NULL, &s->symbolic, s->control, s->info);
    const bool no_memory = code == UMFPACK_ERROR_out_of_memory;
    if (code != UMFPACK_OK)
        return drape_fail(arena->ctx, no_memory ? DRAPE_E_MEMORY : DRAPE_E_SOLVER,
                          "%sUMFPACK cannot analyse the %lld x %lld Jacobian: status %d",
                          no_memory ? "out of memory: " : "", (long long)pattern->n, (long long)pattern->n,
                          (int)code);
    *state = s;
    return DRAPE_OK;
}

static drape_status factor(void *state, const double *values)
{
    umfpack_state *s = state;
    const drape_pattern *p = s->pattern;
    umfpack_dl_free_numeric(&s->numeric);
    if (!drape_all_finite(values, (size_t)p->nonzeros))
        return DRAPE_RETRY_LINEAR;
    drape_library_lock();
    index_t code = umfpack_dl_numeric(indices(p->column), indices(p->row), values, s->symbolic, &s->numeric,
                                      s->control, s->info);
    drape_library_unlock();
    if (code == UMFPACK_OK && s->info[UMFPACK_RCOND] > MIN_RCOND)
        return DRAPE_OK;
    umfpack_dl_free_numeric(&s->numeric);
    return DRAPE_RETRY_LINEAR;
}

static drape_status solve(void *state, const double *b, double *x)
{
    umfpack_state *s = state;
    const drape_pattern *p = s->pattern;
    if (!s->numeric)
        return DRAPE_RETRY_LINEAR;
    drape_library_lock();
    index_t code = umfpack_dl_wsolve(UMFPACK_A, indices(p->column), indices(p->row), NULL, x, b, s->numeric,
                                     s->control, NULL, s->index, s->work);
    drape_library_unlock();
    if (code != UMFPACK_OK)
        return DRAPE_RETRY_LINEAR;
    return drape_all_finite(x, (size_t)p->n) ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

static size_t bytes(const void *state)
{
    const umfpack_state *s = state;
    double units = s->info[UMFPACK_SYMBOLIC_SIZE] + (s->numeric ? s->info[UMFPACK_NUMERIC_SIZE] : 0);
    return (size_t)(units * s->info[UMFPACK_SIZE_OF_UNIT]);
}

const drape_linear_ops drape_linear_umfpack = {
    .entry = {.name = "umfpack",
              .summary = "multifrontal LU with AMD ordering; pivots are chosen at each factorisation",
              .reference = "Davis 2004, Algorithm 832: UMFPACK V4.3"},
    .general_from = 1000, /* with OpenBLAS 0.8 of klu's time at 1 200 unknowns, half at 2 300, a quarter at
                             7 500 */
    .borrows_heap = true, /* for fronts, and for new factors */
    .create = create,
    .factor = factor,
    .solve = solve,
    .destroy = destroy,
    .bytes = bytes,
};
