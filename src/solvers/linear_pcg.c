/*
 * pcg: conjugate gradients for a symmetric positive definite matrix, with a preconditioner that is the sum
 * of two parts: the inverses of the diagonal blocks, and the inverse of the matrix on a coarse space
 * (prolong.h), P (P'AP)^-1 P'. The matrix itself is not factored: memory and the time of an iteration grow
 * with the nonzeros, and the number of iterations hardly grows. Callers that need no exact solution ask for
 * a looser tolerance.
 *
 * A matrix that is not symmetric, or not positive definite, which the iteration notices at the latest, goes
 * to the fallback (fallback.h).
 */
#include "base/finite.h"
#include "solvers/fallback.h"
#include "solvers/pcg.h"
#include "solvers/prolong.h"

#include <math.h>
#include <string.h>

#define EXACT          1e-14 /* relative residual for callers that want all digits */
#define MAX_ITERATIONS 2000  /* a matrix that needs more goes to the fallback */
#define SYMMETRY       1e-13 /* as in linear_multifrontal.c: rounding error in mirrored entries */
/* of drape_prolong_spacing: the graph of the pattern also couples the nodes opposite an edge, so its paths
 * are shorter by this factor */
#define HOP 0.67

extern const drape_linear_ops drape_linear_pcg;

typedef struct pcg_state {
    drape_arena *arena;
    const drape_pattern *pattern;
    double *values;  /* (nonzeros) of the last factor call */
    double *inverse; /* (9 x blocks) of the diagonal blocks, row by row */
    drape_prolong prolong;
    drape_pattern coarse;
    int32_t *slot; /* the coarse block that each product of weights is added to, in the order of
                      add_galerkin */
    double *coarse_values, *coarse_b, *coarse_x;
    const drape_linear_ops *coarse_ops;
    void *coarse_solver;
    drape_pcg pcg;
    drape_fallback fallback;
    bool factored; /* by this solver or by the fallback */
} pcg_state;

/* ---- The coarse space ---- */

/* The number of products of weights that the fine block (row, column) contributes to. */
static int64_t products(const drape_prolong *p, int32_t row, int32_t column)
{
    return (int64_t)(p->start[row + 1] - p->start[row]) * (p->start[column + 1] - p->start[column]);
}

static drape_status find_slots(pcg_state *s)
{
    const drape_pattern *fine = s->pattern;
    const drape_prolong *p = &s->prolong;
    int64_t total = 0, at = 0;
    for (int32_t j = 0; j < fine->block_count; j++)
        for (int32_t k = fine->block_start[j]; k < fine->block_start[j + 1]; k++)
            total += products(p, fine->block_row[k], j);
    s->slot = drape_arena_take(s->arena, (size_t)total, sizeof *s->slot);
    if (!s->slot)
        return DRAPE_E_MEMORY;
    for (int32_t j = 0; j < fine->block_count; j++)
        for (int32_t k = fine->block_start[j]; k < fine->block_start[j + 1]; k++)
            for (int32_t a = p->start[fine->block_row[k]]; a < p->start[fine->block_row[k] + 1]; a++)
                for (int32_t b = p->start[j]; b < p->start[j + 1]; b++)
                    s->slot[at++] = drape_pattern_find(&s->coarse, p->column[a], p->column[b]);
    return DRAPE_OK;
}

/* Couples coarse functions that overlap or are adjacent. */
static drape_status build_coarse_pattern(pcg_state *s, const drape_graph *graph, drape_arena *scratch)
{
    int32_t *start, *neighbor, count = s->prolong.coarse, used = 0;
    drape_status status = drape_prolong_meet(scratch, &s->prolong, graph, &start, &neighbor);
    if (status)
        return status;
    int32_t *pairs = drape_arena_take(scratch, 2 * (size_t)start[count], sizeof *pairs);
    int32_t *own = drape_arena_take(scratch, (size_t)count, sizeof *own);
    if (drape_arena_status(scratch))
        return DRAPE_E_MEMORY;
    for (int32_t a = 0; a < count; a++) {
        own[a] = a;
        for (int32_t k = start[a]; k < start[a + 1]; k++)
            if (neighbor[k] < a) {
                pairs[2 * (size_t)used] = a;
                pairs[2 * (size_t)used++ + 1] = neighbor[k];
            }
    }
    const drape_coupling coupling = {.count = used, .nodes = 2, .node = pairs};
    return drape_pattern_build(s->arena, count, own, &coupling, 1, &s->coarse);
}

static drape_status build_coarse(pcg_state *s)
{
    const drape_pattern *p = s->pattern;
    const drape_graph graph = {.count = p->block_count, .start = p->block_start, .neighbor = p->block_row};
    drape_arena scratch = drape_arena_of(s->arena->ctx);
    int spacing = (int)lround(HOP * drape_prolong_spacing(p->block_count));
    drape_status status = drape_prolong_build(s->arena, &graph, spacing < 2 ? 2 : spacing, &s->prolong);
    if (!status)
        status = build_coarse_pattern(s, &graph, &scratch);
    drape_arena_free(&scratch);
    if (!status)
        status = find_slots(s);
    if (status)
        return status;
    s->coarse_values = drape_arena_take(s->arena, (size_t)s->coarse.nonzeros, sizeof *s->coarse_values);
    s->coarse_b = drape_arena_take(s->arena, (size_t)s->coarse.n, sizeof *s->coarse_b);
    s->coarse_x = drape_arena_take(s->arena, (size_t)s->coarse.n, sizeof *s->coarse_x);
    s->coarse_ops = drape_linear_best(s->coarse.n);
    if (drape_arena_status(s->arena))
        return DRAPE_E_MEMORY;
    return s->coarse_ops->create(s->arena, &s->coarse, &s->coarse_solver);
}

/* The coarse matrix P' A P. */
static void add_galerkin(pcg_state *s)
{
    const drape_pattern *fine = s->pattern;
    const drape_prolong *p = &s->prolong;
    int64_t at = 0, stride, to_stride;
    memset(s->coarse_values, 0, (size_t)s->coarse.nonzeros * sizeof *s->coarse_values);
    for (int32_t j = 0; j < fine->block_count; j++)
        for (int32_t k = fine->block_start[j]; k < fine->block_start[j + 1]; k++) {
            const double *from = drape_pattern_at(fine, s->values, j, k, &stride);
            for (int32_t a = p->start[fine->block_row[k]]; a < p->start[fine->block_row[k] + 1]; a++)
                for (int32_t b = p->start[j]; b < p->start[j + 1]; b++) {
                    double w = p->weight[a] * p->weight[b],
                           *to = drape_pattern_at(&s->coarse, s->coarse_values, p->column[b], s->slot[at++],
                                                  &to_stride);
                    for (int c = 0; c < 3; c++)
                        for (int r = 0; r < 3; r++)
                            to[c * to_stride + r] += w * from[c * stride + r];
                }
        }
}

/* ---- The iteration ---- */

/* y = A x = A' x: each entry of y is a sum down a column. */
static void multiply(const void *owner, const double *x, double *y)
{
    const pcg_state *s = owner;
    const drape_pattern *p = s->pattern;
    for (int32_t j = 0; j < p->block_count; j++)
        for (int c = 0; c < 3; c++) {
            int64_t blocks = p->block_start[j + 1] - p->block_start[j];
            const double *a = s->values + p->column[3 * (int64_t)j + c];
            const int32_t *row = p->block_row + p->block_start[j];
            double sum = 0;
            for (int64_t k = 0; k < blocks; k++)
                for (int64_t r = 0; r < 3; r++)
                    sum += a[3 * k + r] * x[3 * (int64_t)row[k] + r];
            y[3 * (int64_t)j + c] = sum;
        }
}

static void precondition(const void *owner, const double *r, double *z)
{
    const pcg_state *s = owner;
    for (int32_t j = 0; j < s->pattern->block_count; j++) {
        const double *a = s->inverse + 9 * (size_t)j, *from = r + 3 * (size_t)j;
        for (int i = 0; i < 3; i++)
            z[3 * (size_t)j + (size_t)i] =
                a[3 * i] * from[0] + a[3 * i + 1] * from[1] + a[3 * i + 2] * from[2];
    }
    drape_prolong_restrict(&s->prolong, r, s->coarse_b);
    if (s->coarse_ops->solve(s->coarse_solver, s->coarse_b, s->coarse_x) == DRAPE_OK)
        drape_prolong_add(&s->prolong, s->coarse_x, z);
}

static drape_status create(drape_arena *arena, const drape_pattern *pattern, void **state)
{
    const size_t n = (size_t)pattern->n;
    pcg_state *s = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    s->arena = arena;
    s->pattern = pattern;
    s->fallback = drape_fallback_of(arena, pattern);
    s->values = drape_arena_take(arena, (size_t)pattern->nonzeros, sizeof *s->values);
    s->inverse = drape_arena_take(arena, 3 * n, sizeof *s->inverse);
    s->pcg = drape_pcg_of(arena, pattern->n, s, multiply, precondition);
    drape_status status = drape_arena_status(arena);
    if (!status)
        status = build_coarse(s);
    if (!status)
        *state = s;
    return status;
}

static void destroy(void **state)
{
    pcg_state *s = *state;
    drape_linear_destroy(s->coarse_ops, &s->coarse_solver);
    drape_fallback_destroy(&s->fallback);
}

/* ---- Values ---- */

static bool is_symmetric(const pcg_state *s)
{
    const drape_pattern *p = s->pattern;
    for (int32_t j = 0; j < p->block_count; j++)
        for (int32_t k = p->diagonal[j]; k < p->block_start[j + 1]; k++) {
            int64_t stride, mirrored, own, other;
            int32_t i = p->block_row[k];
            const double *a = drape_pattern_at(p, s->values, j, k, &stride),
                         *b = drape_pattern_at(p, s->values, i, drape_pattern_find(p, j, i), &mirrored),
                         *d = drape_pattern_at(p, s->values, j, p->diagonal[j], &own),
                         *e = drape_pattern_at(p, s->values, i, p->diagonal[i], &other);
            for (int c = 0; c < 3; c++)
                for (int r = 0; r < 3; r++) {
                    double difference = a[c * stride + r] - b[r * mirrored + c];
                    double size = fabs(d[c * own + c] * e[r * other + r]);
                    if (difference * difference > SYMMETRY * SYMMETRY * size)
                        return false;
                }
        }
    return true;
}

/* Inverts a diagonal block by its cofactors; false if it is not positive definite. */
static bool invert(const double a[9], double *inverse)
{
    double xx = a[4] * a[8] - a[5] * a[7], xy = a[5] * a[6] - a[3] * a[8], xz = a[3] * a[7] - a[4] * a[6];
    double determinant = a[0] * xx + a[1] * xy + a[2] * xz;
    const double cofactor[9] = {xx, a[2] * a[7] - a[1] * a[8], a[1] * a[5] - a[2] * a[4],
                                xy, a[0] * a[8] - a[2] * a[6], a[2] * a[3] - a[0] * a[5],
                                xz, a[1] * a[6] - a[0] * a[7], a[0] * a[4] - a[1] * a[3]};
    for (int i = 0; i < 9; i++)
        inverse[i] = cofactor[i] / determinant;
    return a[0] > 0 && a[0] * a[4] - a[1] * a[3] > 0 && determinant > 0;
}

static bool invert_diagonal(pcg_state *s)
{
    const drape_pattern *p = s->pattern;
    bool positive = true;
    for (int32_t j = 0; positive && j < p->block_count; j++) {
        int64_t stride;
        const double *from = drape_pattern_at(p, s->values, j, p->diagonal[j], &stride);
        double a[9];
        for (int i = 0; i < 9; i++)
            a[i] = from[i % 3 * stride + i / 3];
        positive = invert(a, s->inverse + 9 * (size_t)j);
    }
    return positive;
}

static drape_status factor_coarse(pcg_state *s)
{
    add_galerkin(s);
    const drape_linear_ops *ops = s->coarse_ops;
    return (ops->factor_definite ? ops->factor_definite : ops->factor)(s->coarse_solver, s->coarse_values);
}

static drape_status factor_general(pcg_state *s)
{
    drape_status status = drape_fallback_factor(&s->fallback, s->values);
    s->factored = !status;
    return status;
}

static void use_threads(void *state, drape_pool *pool)
{
    drape_fallback_use_threads(&((pcg_state *)state)->fallback, pool);
}

static void watch(void *state, const atomic_bool *const *cancel)
{
    drape_fallback_watch(&((pcg_state *)state)->fallback, cancel);
}

static drape_status factor(void *state, const double *values)
{
    pcg_state *s = state;
    s->fallback.active = s->factored = false;
    if (!drape_all_finite(values, (size_t)s->pattern->nonzeros))
        return DRAPE_RETRY_LINEAR;
    memcpy(s->values, values, (size_t)s->pattern->nonzeros * sizeof *values);
    if (!is_symmetric(s) || !invert_diagonal(s))
        return factor_general(s);
    drape_status status = factor_coarse(s);
    s->factored = !status;
    return status > 0 ? factor_general(s) : status;
}

static drape_status solve_inexact(void *state, const double *b, double *x, double tolerance,
                                  int64_t *iterations)
{
    pcg_state *s = state;
    *iterations = 0;
    if (!s->factored)
        return DRAPE_RETRY_LINEAR;
    if (!s->fallback.active) {
        drape_pcg_solve(&s->pcg, b, x, tolerance, MAX_ITERATIONS);
        *iterations = s->pcg.iterations;
        if (s->pcg.definite && s->pcg.converged && drape_all_finite(x, (size_t)s->pattern->n))
            return DRAPE_OK;
        drape_status status = factor_general(s);
        if (status)
            return status;
    }
    return s->fallback.ops->solve(s->fallback.solver, b, x);
}

static drape_status solve(void *state, const double *b, double *x)
{
    int64_t iterations;
    return solve_inexact(state, b, x, EXACT, &iterations);
}

/* The coarse matrix is archived itself: it may belong to an earlier matrix than the fallback's. */
static void archive(void *state, drape_archive *a, const double *values)
{
    pcg_state *s = state;
    const bool coarse = s->coarse_ops->archive != NULL || values;
    drape_fallback_archive(&s->fallback, &s->factored, a, values);
    if (coarse)
        drape_archive_doubles(a, s->coarse_values, (size_t)s->coarse.nonzeros);
    bool stands = values && s->factored && !s->fallback.active;
    drape_linear_archive(s->coarse_ops, s->coarse_solver, a, stands ? s->coarse_values : NULL);
    if (!drape_archive_has_read(a) || !values)
        return;
    memcpy(s->values, values, (size_t)s->pattern->nonzeros * sizeof *values);
    if (stands)
        invert_diagonal(s);
}

static size_t bytes(const void *state)
{
    const pcg_state *s = state;
    return drape_linear_bytes(s->coarse_ops, s->coarse_solver) + drape_fallback_bytes(&s->fallback);
}

static void report(const void *state, drape_linear_report *out)
{
    *out = drape_fallback_report(&((const pcg_state *)state)->fallback, &drape_linear_pcg);
}

const drape_linear_ops drape_linear_pcg = {
    .entry = {.name = "pcg",
              .summary =
                  "conjugate gradients with diagonal blocks and a coarse space, no factors of the matrix; a "
                  "matrix that is not symmetric positive definite is given to multifrontal",
              .reference = "Hestenes & Stiefel 1952; Vanek, Mandel & Brezina 1996"},
    .borrows_heap = true, /* for the solver of the coarse space, and for the fallback */
    .create = create,
    .use_threads = use_threads,
    .watch = watch,
    .factor = factor,
    .solve = solve,
    .solve_inexact = solve_inexact,
    .archive = archive,
    .destroy = destroy,
    .bytes = bytes,
    .report = report,
};
