/*
 * multifrontal: factors of any regular matrix, front by front (fronts.h). A symmetric positive definite
 * matrix gets Cholesky factors (front_factors.h); any other one, L U factors with a bound on the backward
 * error of each solution (general.h), with half of the work if it is symmetric. All of them share one order
 * of elimination, one tree, and one set of tiles, and give the same bits for any number of threads. The
 * memory for Cholesky factors is taken in create, the rest for the first other matrix.
 */
#include "base/finite.h"
#include "solvers/general.h"
#include "solvers/linear.h"
#include "solvers/rounding.h"

extern const drape_linear_ops drape_linear_klu;

typedef enum have { NONE, CHOLESKY, GENERAL } have;

typedef struct multifrontal {
    drape_fronts fronts;
    drape_general general;
    int32_t *mirror;  /* (lower blocks, in the pattern's order) the transposed block of each */
    double *diagonal; /* (n) in the pattern's order */
    drape_front_factors cholesky;
    have have; /* of the last matrix */
} multifrontal;

static drape_status create(drape_arena *arena, const drape_pattern *pattern, void **state)
{
    multifrontal *s = drape_arena_take(arena, 1, sizeof *s);
    const size_t n = (size_t)pattern->n, lower = ((size_t)pattern->nonzeros / 9 + n / 3) / 2;
    if (!s)
        return DRAPE_E_MEMORY;
    drape_status status = drape_fronts_create(arena, pattern, &s->fronts);
    if (status)
        return status;
    s->general = drape_general_of(arena, &s->fronts);
    s->mirror = drape_arena_take(arena, lower, sizeof *s->mirror);
    s->diagonal = drape_arena_take(arena, n, sizeof *s->diagonal);
    if (drape_front_factors_create(arena, &s->fronts, true, &s->cholesky)) {
        drape_fronts_destroy(&s->fronts);
        return DRAPE_E_MEMORY;
    }
    int32_t *mirror = s->mirror;
    for (int32_t j = 0; j < pattern->block_count; j++)
        for (int32_t k = pattern->diagonal[j]; k < pattern->block_start[j + 1]; k++)
            *mirror++ = drape_pattern_find(pattern, j, pattern->block_row[k]);
    *state = s;
    return DRAPE_OK;
}

static void destroy(void **state)
{
    multifrontal *s = *state;
    drape_general_destroy(&s->general);
    drape_fronts_destroy(&s->fronts);
}

static void use_threads(void *state, drape_pool *pool)
{
    ((multifrontal *)state)->fronts.pool = pool;
}

static void watch(void *state, const atomic_bool *const *cancel)
{
    ((multifrontal *)state)->fronts.cancel = cancel;
}

/* ---- Class of a matrix ---- */

/* Properties checked before a matrix is factored. */
typedef struct properties {
    bool finite, positive, symmetric; /* positive: its diagonal is positive */
} properties;

static bool copy_diagonal(multifrontal *s, const double *values)
{
    const drape_pattern *p = s->fronts.pattern;
    bool positive = true;
    drape_pattern_list_diagonal(p, values, s->diagonal);
    for (int64_t i = 0; i < p->n; i++)
        positive &= s->diagonal[i] > 0;
    return positive;
}

/* Factors a symmetric matrix; not if it is singular to working precision: the ratio of the extreme pivots is
 * a lower bound of its condition number. */
static drape_status factor_cholesky(multifrontal *s)
{
    double low, high;
    const drape_status status = drape_front_factors_make(&s->cholesky);
    if (status || s->fronts.pattern->n == 0)
        return status;
    drape_front_factors_range(&s->cholesky, &low, &high);
    return (low / high) * (low / high) > DRAPE_SINGULAR ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

static drape_status factor_any(multifrontal *s, const double *values, bool definite)
{
    /* Visits the matrix column by column, as it is stored: in a well-numbered mesh a mirrored block is
     * never far from its block. */
    const drape_pattern *p = s->fronts.pattern;
    const int32_t *mirror = s->mirror;
    properties of = {.finite = drape_all_finite(values, (size_t)p->nonzeros), .symmetric = true};
    of.positive = of.finite && copy_diagonal(s, values);
    for (int32_t j = 0; of.finite && of.symmetric && j < p->block_count; j++)
        for (int32_t k = p->diagonal[j]; k < p->block_start[j + 1]; k++)
            of.symmetric &=
                drape_pattern_is_mirrored(p, (double *)(uintptr_t)values, j, k, *mirror++, s->diagonal);
    drape_status status = DRAPE_RETRY_LINEAR;
    s->have = NONE;
    if (!of.finite)
        return DRAPE_RETRY_LINEAR;
    s->fronts.values = values;
    if (of.positive && of.symmetric)
        status = factor_cholesky(s);
    if (!status)
        s->have = CHOLESKY;
    if (status != DRAPE_RETRY_LINEAR || (definite && (of.symmetric || !of.positive)))
        return status;
    status = drape_general_factor(&s->general, values, of.symmetric);
    if (!status)
        s->have = GENERAL;
    return status;
}

static drape_status factor(void *state, const double *values)
{
    return factor_any(state, values, false);
}

static drape_status factor_definite(void *state, const double *values)
{
    return factor_any(state, values, true);
}

static drape_status solve(void *state, const double *b, double *x)
{
    multifrontal *s = state;
    if (s->have == NONE)
        return DRAPE_RETRY_LINEAR;
    if (s->have == GENERAL)
        return drape_general_solve(&s->general, b, x);
    drape_front_factors_solve(&s->cholesky, b, x);
    return drape_all_finite(x, (size_t)s->fronts.pattern->n) ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

static size_t bytes(const void *state)
{
    const multifrontal *s = state;
    const drape_general *g = &s->general;
    return drape_elimination_bytes(s->fronts.shared) +
           (g->klu ? drape_linear_bytes(&drape_linear_klu, g->klu) : 0);
}

static void report(const void *state, drape_linear_report *out)
{
    const int64_t count = ((const multifrontal *)state)->general.klu_count;
    *out = (drape_linear_report){.fallbacks = count, .fallback = count > 0 ? &drape_linear_klu : NULL};
}

const drape_linear_ops drape_linear_multifrontal = {
    .entry = {.name = "multifrontal",
              .summary = "Drape's own multifrontal factorisation: Cholesky, or LU if the matrix is not "
                         "positive definite, with a bound on its error; the same bits for any number of "
                         "threads",
              .reference = "Duff & Reid 1983; Liu 1992, The multifrontal method for sparse matrix solution; "
                           "Schenk & Gaertner 2006"},
    .best_from = 100,     /* a third of klu's time at 400 unknowns */
    .borrows_heap = true, /* at the first matrix that is not positive definite */
    .create = create,
    .use_threads = use_threads,
    .watch = watch,
    .factor = factor,
    .factor_definite = factor_definite,
    .solve = solve,
    .destroy = destroy,
    .bytes = bytes,
    .report = report,
};
