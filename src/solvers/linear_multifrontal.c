/*
 * multifrontal: factors of any regular matrix, front by front (fronts.h). A symmetric positive definite
 * matrix gets Cholesky factors (below); any other one, L U factors with a bound on the backward error of
 * each solution (general.h), with half of the work if it is symmetric. All of them share one order of
 * elimination, one tree, and one set of tiles, and give the same bits for any number of threads. The memory
 * for Cholesky factors is taken in create, the rest for the first other matrix.
 */
#include "base/finite.h"
#include "solvers/fronts.h"
#include "solvers/general.h"
#include "solvers/linear.h"
#include "solvers/rounding.h"

#include <math.h>

/* ---- Cholesky: A = L L' of a symmetric positive definite matrix, front by front ---- */

#define S DRAPE_STRIP
/* columns multiplied together: two strips of this length fit into the first-level cache */
#define CHUNK (10 * DRAPE_STRIP)

/* The columns being factored: argument of finish_strip. */
typedef struct strip_job {
    const drape_front_job *of;
    const double *inverse;
    int32_t first, width;
} strip_job;

static double *strip_of(const drape_front_job *w, int64_t strip)
{
    return drape_front_strip(w, DRAPE_LOWER, strip);
}

/* Finishes the columns being factored in one strip below their diagonal tile: subtracts the products with
 * the earlier columns, then divides by the diagonal tile. */
static void finish_strip(void *user, int64_t task)
{
    const strip_job *strips = user;
    const drape_front_job *w = strips->of;
    const int32_t diagonal = strips->first / S;
    const int64_t strip = diagonal + 1 + task;
    double *to = strip_of(w, strip) + S * strips->first;
    drape_tile_multiply(strip_of(w, strip), strip_of(w, diagonal), strips->first, strips->width, false, to);
    drape_tile_divide(strips->width, strip_of(w, diagonal) + S * strips->first, strips->inverse, to);
}

/* Computes one column of tiles of the update, over chunks of the factored columns. */
static void compute_update_column(void *user, int64_t task)
{
    const drape_front_job *w = user;
    const drape_front *f = w->f;
    const int32_t c = (int32_t)task;
    for (int32_t p = 0; p < f->columns && !drape_fronts_cancelled(w->s); p += CHUNK) {
        const int depth = f->columns - p < CHUNK ? f->columns - p : CHUNK;
        for (int32_t r = c; r < f->row_strips; r++)
            drape_tile_multiply(strip_of(w, f->column_strips + r) + S * p,
                                strip_of(w, f->column_strips + c) + S * p, depth, S, p == 0,
                                w->update[DRAPE_LOWER] + drape_front_tile_at(f, r, c));
    }
}

static bool factor_front(drape_front_job *w)
{
    drape_front_assemble(w, DRAPE_LOWER);
    const drape_front *f = w->f;
    for (int32_t first = 0; first < f->columns && !drape_fronts_cancelled(w->s); first += S) {
        const int32_t diagonal = first / S, width = f->columns - first < S ? f->columns - first : S;
        double *tile = strip_of(w, diagonal) + S * first,
               *inverse = (double *)w->user + 3 * w->s->e.first[w->index] + first;
        drape_tile_multiply(strip_of(w, diagonal), strip_of(w, diagonal), first, width, false, tile);
        if (!drape_tile_factor(width, tile, inverse))
            return false;
        strip_job strips = {.of = w, .inverse = inverse, .first = first, .width = width};
        drape_parallel(w->pool, f->column_strips + f->row_strips - diagonal - 1, finish_strip, &strips);
    }
    drape_parallel(w->pool, w->f->row_strips, compute_update_column, w);
    drape_front_extend_add(w, DRAPE_LOWER);
    return true;
}

/* The ratio of the extreme pivots is a lower bound of the condition number. */
static bool is_well_conditioned(int64_t n, const double *inverse)
{
    double low = INFINITY, high = 0;
    for (int64_t k = 0; k < n; k++) {
        low = fmin(low, inverse[k]);
        high = fmax(high, inverse[k]);
    }
    return n == 0 || (low / high) * (low / high) > DRAPE_SINGULAR;
}

/* Factors s->values; inverse (n) becomes the inverses of the diagonal of L. DRAPE_RETRY_LINEAR if the matrix
 * is not positive definite or singular to working precision, DRAPE_E_STOPPED if it was cancelled. */
static drape_status factor_cholesky(drape_fronts *s, double *inverse)
{
    drape_status status = drape_fronts_factor(s, factor_front, inverse);
    return !status && !is_well_conditioned(s->pattern->n, inverse) ? DRAPE_RETRY_LINEAR : status;
}

static void solve_tile_forward(const drape_front_tile_solve *t, void *user)
{
    const double *inverse = (const double *)user + t->at;
    for (int p = 0; p < t->width; p++) {
        t->x[p] *= inverse[p];
        for (int q = p + 1; q < t->width; q++)
            t->x[q] -= t->tile[S * p + q] * t->x[p];
    }
}

static void solve_tile_backward(const drape_front_tile_solve *t, void *user)
{
    const double *inverse = (const double *)user + t->at;
    for (int p = t->width - 1; p >= 0; p--) {
        for (int q = p + 1; q < t->width; q++)
            t->x[p] -= t->tile[S * p + q] * t->x[q];
        t->x[p] *= inverse[p];
    }
}

/* ---- Any matrix ---- */

extern const drape_linear_ops drape_linear_klu, drape_linear_multifrontal;

typedef enum factors { NONE, CHOLESKY, GENERAL } factors;

typedef struct multifrontal {
    drape_fronts fronts;
    drape_general general;
    int32_t *mirror;  /* (lower blocks, in the pattern's order) the transposed block of each */
    double *diagonal; /* (n) in the pattern's order */
    double *inverse;  /* (n) of the diagonal of the Cholesky factors */
    factors have;
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
    s->inverse = drape_arena_take(arena, n, sizeof *s->inverse);
    if (drape_arena_status(arena)) {
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
        status = factor_cholesky(&s->fronts, s->inverse);
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
    const drape_front_solver solver = {.back = DRAPE_LOWER,
                                       .forward = solve_tile_forward,
                                       .backward = solve_tile_backward,
                                       .user = s->inverse};
    drape_fronts_solve(&s->fronts, &solver, b, x);
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
    *out = (drape_linear_report){.ops = &drape_linear_multifrontal,
                                 .fallbacks = count,
                                 .fallback = count > 0 ? &drape_linear_klu : NULL};
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
