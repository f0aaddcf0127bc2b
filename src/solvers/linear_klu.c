/*
 * klu: sparse LU factorisation by KLU (Davis & Palamadai Natarajan 2010), the reference solver. AMD
 * ordering, because the pattern is symmetric; no block triangular form, because the mesh is connected. The
 * first factorisation chooses pivots; later ones keep them (refactor), which takes no memory from the heap,
 * and choose new ones where the kept pivots turn out to be too small. The factors therefore depend also on
 * the matrix that the pivots were chosen for: its values are kept, so that a checkpoint can choose the same
 * pivots again.
 */
#include "solvers/linear.h"

#include "base/finite.h"
#include "solvers/rounding.h"

#include <klu.h>
#include <string.h>

#define ORDER_AMD 0

typedef struct klu_state {
    drape_context *ctx;
    const drape_pattern *pattern;
    int64_t *row; /* (nonzeros) of the pattern */
    klu_l_common common;
    klu_l_symbolic *symbolic;
    klu_l_numeric *numeric; /* NULL before the first and after a failed factorisation */
    double *chosen_for;     /* (nonzeros) the values that the pivots were chosen for */
    bool refactored;        /* other values were factored since, with these pivots */
} klu_state;

_Static_assert(sizeof(SuiteSparse_long) == sizeof(int64_t),
               "the pattern's indices are passed to KLU as they are");

/* KLU takes index arrays without const, but does not write to them. */
static SuiteSparse_long *indices(const int64_t *array)
{
    return (SuiteSparse_long *)(uintptr_t)array;
}

static void destroy(void **state)
{
    klu_state *s = *state;
    klu_l_free_numeric(&s->numeric, &s->common);
    klu_l_free_symbolic(&s->symbolic, &s->common);
}

static drape_status create(drape_arena *arena, const drape_pattern *pattern, void **state)
{
    klu_state *s = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    s->ctx = arena->ctx;
    s->pattern = pattern;
    klu_l_defaults(&s->common);
    s->common.ordering = ORDER_AMD;
    s->common.btf = 0;
    s->chosen_for = drape_arena_take(arena, (size_t)pattern->nonzeros, sizeof *s->chosen_for);
    s->row = drape_arena_take(arena, (size_t)pattern->nonzeros, sizeof *s->row);
    if (!s->chosen_for || !s->row)
        return DRAPE_E_MEMORY;
    drape_pattern_list_rows(pattern, s->row);
    s->symbolic = klu_l_analyze(pattern->n, indices(pattern->column), indices(s->row), &s->common);
    if (!s->symbolic)
        return s->common.status == KLU_OUT_OF_MEMORY
                   ? drape_fail_memory(s->ctx, s->common.memusage)
                   : drape_fail(s->ctx, DRAPE_E_SOLVER,
                                "KLU cannot analyse the %lld x %lld Jacobian: status %d",
                                (long long)pattern->n, (long long)pattern->n, (int)s->common.status);
    *state = s;
    return DRAPE_OK;
}

/* If not, new pivots are tried first. A NaN anywhere in the factors makes rcond NaN or 0, so the
 * comparison is false. */
static bool well_conditioned(klu_state *s)
{
    return klu_l_rcond(s->symbolic, s->numeric, &s->common) && s->common.rcond > DRAPE_SINGULAR;
}

static bool refactor(klu_state *s, double *values)
{
    const drape_pattern *p = s->pattern;
    s->refactored = true;
    return s->numeric &&
           klu_l_refactor(indices(p->column), indices(s->row), values, s->symbolic, s->numeric, &s->common) &&
           s->common.status == KLU_OK && well_conditioned(s);
}

static bool factor_afresh(klu_state *s, double *values)
{
    const drape_pattern *p = s->pattern;
    klu_l_free_numeric(&s->numeric, &s->common);
    s->refactored = false;
    if (values != s->chosen_for)
        memcpy(s->chosen_for, values, (size_t)p->nonzeros * sizeof *values);
    s->numeric = klu_l_factor(indices(p->column), indices(s->row), values, s->symbolic, &s->common);
    return s->numeric && s->common.status == KLU_OK && well_conditioned(s);
}

static drape_status factor(void *state, const double *values)
{
    klu_state *s = state;
    double *v = (double *)(uintptr_t)values; /* not written either */
    if (refactor(s, v) || factor_afresh(s, v))
        return DRAPE_OK;
    const bool no_memory = s->common.status == KLU_OUT_OF_MEMORY;
    klu_l_free_numeric(&s->numeric, &s->common);
    return no_memory ? drape_fail_memory(s->ctx, s->common.memusage) : DRAPE_RETRY_LINEAR;
}

static drape_status solve(void *state, const double *b, double *x)
{
    klu_state *s = state;
    if (!s->numeric)
        return DRAPE_RETRY_LINEAR;
    for (int64_t i = 0; i < s->pattern->n; i++)
        x[i] = b[i];
    if (!klu_l_solve(s->symbolic, s->numeric, s->pattern->n, 1, x, &s->common))
        return DRAPE_RETRY_LINEAR;
    return drape_all_finite(x, (size_t)s->pattern->n) ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

/* Factors by kept pivots have other roundings than those that chose them: what was done is done again. */
static void archive(void *state, drape_archive *a, const double *values)
{
    klu_state *s = state;
    bool there = s->numeric != NULL, refactored = s->refactored;
    drape_archive_bool(a, &there);
    drape_archive_bool(a, &refactored);
    if (!there)
        return;
    drape_archive_doubles(a, s->chosen_for, (size_t)s->pattern->nonzeros);
    if (!drape_archive_has_read(a))
        return;
    if (!factor_afresh(s, s->chosen_for) ||
        (values && refactored && !refactor(s, (double *)(uintptr_t)values)))
        drape_archive_fail(a, DRAPE_E_SOLVER, "a matrix of the checkpoint has no factors by \"klu\" here");
    s->refactored = refactored;
}

static size_t bytes(const void *state)
{
    return ((const klu_state *)state)->common.memusage;
}

const drape_linear_ops drape_linear_klu = {
    .entry = {.name = "klu",
              .summary = "sparse LU with AMD ordering; pivots are kept between steps",
              .reference = "Davis & Palamadai Natarajan 2010, Algorithm 907: KLU"},
    .best_from = 1,
    .create = create,
    .factor = factor,
    .solve = solve,
    .archive = archive,
    .destroy = destroy,
    .bytes = bytes,
};
