/*
 * pcg: conjugate gradients for a symmetric positive definite matrix, preconditioned by two parts that are added: the
 * inverses of its diagonal blocks, and the inverse of the matrix on a coarse space (prolong.h), P (P'AP)^-1 P'. It
 * takes no factors of the matrix itself: memory and the time of an iteration grow with the nonzeros, and
 * the number of iterations hardly grows. Callers that need no exact solution ask for fewer digits.
 *
 * A matrix that is not symmetric or not positive definite, which the iteration notices at the latest, goes to the row
 * that is the fastest for general matrices of this size, whose solver is made for the first such matrix.
 */
#include "solvers/linear.h"

#include "base/finite.h"
#include "solvers/pcg.h"
#include "solvers/prolong.h"

#include <math.h>
#include <string.h>

#define EXACT    1e-14 /* of the residual, for callers that want all digits */
#define MOST     2000  /* iterations; what needs more goes to the general row */
#define SYMMETRY 1e-13 /* as in linear_cholmod.c: round-off in mirrored entries */
#define HOP      0.67 /* the pattern's graph joins nodes across an edge, too: its paths are so much shorter */

extern const drape_linear_ops drape_linear_pcg;

typedef struct pcg_state {
    drape_context *ctx;
    const drape_pattern *pattern;
    double *values;  /* (nonzeros) of the last factor */
    double *inverse; /* (9 x blocks) of the diagonal blocks, row by row */
    drape_prolong prolong;
    drape_pattern coarse;
    int32_t *slot; /* the coarse block that each product of weights goes to, in the order of add_galerkin */
    double *coarse_values, *coarse_b, *coarse_x;
    const drape_linear_ops *coarse_row, *general_row;
    void *coarse_solver, *general; /* general NULL: before the first such matrix */
    drape_pcg pcg;
    bool by_general, factored;
    int64_t fallbacks;
} pcg_state;

static void destroy(void **state)
{
    pcg_state *s = *state;
    if (!s)
        return;
    if (s->coarse_solver)
        s->coarse_row->destroy(&s->coarse_solver);
    if (s->general)
        s->general_row->destroy(&s->general);
    drape_prolong_free(s->ctx, &s->prolong);
    drape_pattern_free(s->ctx, &s->coarse);
    void *all[] = {s->values,   s->inverse, s->slot,  s->coarse_values, s->coarse_b,
                   s->coarse_x, s->pcg.r,   s->pcg.z, s->pcg.p,         s->pcg.q};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        drape_free(s->ctx, all[i]);
    drape_free(s->ctx, s);
    *state = NULL;
}

/* ---- The coarse space ---- */

/* Products of weights that the block at (row, column) takes part in, in a fixed order. */
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
    s->slot = drape_alloc(s->ctx, (size_t)total, sizeof *s->slot);
    if (!s->slot)
        return DRAPE_E_MEMORY;
    for (int32_t j = 0; j < fine->block_count; j++)
        for (int32_t k = fine->block_start[j]; k < fine->block_start[j + 1]; k++)
            for (int32_t a = p->start[fine->block_row[k]]; a < p->start[fine->block_row[k] + 1]; a++)
                for (int32_t b = p->start[j]; b < p->start[j + 1]; b++)
                    s->slot[at++] = drape_pattern_find(&s->coarse, p->column[a], p->column[b]);
    return DRAPE_OK;
}

static drape_status build_coarse_pattern(pcg_state *s, const drape_graph *graph)
{
    int32_t *start = NULL, *neighbor = NULL, *pairs = NULL, *own = NULL, count = s->prolong.coarse, used = 0;
    drape_status status = drape_prolong_meet(s->ctx, &s->prolong, graph, &start, &neighbor);
    if (!status) {
        pairs = drape_alloc(s->ctx, 2 * (size_t)start[count], sizeof *pairs);
        own = drape_alloc(s->ctx, (size_t)count, sizeof *own);
        status = pairs && own ? DRAPE_OK : DRAPE_E_MEMORY;
    }
    for (int32_t a = 0; !status && a < count; a++) {
        own[a] = a;
        for (int32_t k = start[a]; k < start[a + 1]; k++)
            if (neighbor[k] < a) {
                pairs[2 * (size_t)used] = a;
                pairs[2 * (size_t)used++ + 1] = neighbor[k];
            }
    }
    const drape_coupling coupling = {.count = used, .nodes = 2, .node = pairs};
    if (!status)
        status = drape_pattern_build(s->ctx, count, own, &coupling, 1, &s->coarse);
    drape_free(s->ctx, start);
    drape_free(s->ctx, neighbor);
    drape_free(s->ctx, pairs);
    drape_free(s->ctx, own);
    return status;
}

static drape_status build_coarse(pcg_state *s)
{
    const drape_pattern *p = s->pattern;
    const drape_graph graph = {.count = p->block_count, .start = p->block_start, .neighbor = p->block_row};
    int spacing = (int)lround(HOP * drape_prolong_spacing(p->block_count));
    drape_status status = drape_prolong_build(s->ctx, &graph, spacing < 2 ? 2 : spacing, &s->prolong);
    if (!status)
        status = build_coarse_pattern(s, &graph);
    if (!status)
        status = find_slots(s);
    if (status)
        return status;
    s->coarse_values = drape_alloc(s->ctx, (size_t)s->coarse.nonzeros, sizeof *s->coarse_values);
    s->coarse_b = drape_alloc(s->ctx, (size_t)s->coarse.n, sizeof *s->coarse_b);
    s->coarse_x = drape_alloc(s->ctx, (size_t)s->coarse.n, sizeof *s->coarse_x);
    s->coarse_row = drape_linear_best(s->coarse.n);
    return s->coarse_values && s->coarse_b && s->coarse_x
               ? s->coarse_row->create(s->ctx, &s->coarse, &s->coarse_solver)
               : DRAPE_E_MEMORY;
}

/* P' A P */
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

/* y = A x = A' x: each entry is a sum down a column. */
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
    if (s->coarse_row->solve(s->coarse_solver, s->coarse_b, s->coarse_x) == DRAPE_OK)
        drape_prolong_add(&s->prolong, s->coarse_x, z);
}

static drape_status create(drape_context *ctx, const drape_pattern *pattern, void **state)
{
    pcg_state *s = drape_alloc(ctx, 1, sizeof *s);
    size_t n = (size_t)pattern->n;
    *state = s;
    if (!s)
        return DRAPE_E_MEMORY;
    s->ctx = ctx;
    s->pattern = pattern;
    s->general_row = drape_linear_general(pattern->n);
    s->values = drape_alloc(ctx, (size_t)pattern->nonzeros, sizeof *s->values);
    s->inverse = drape_alloc(ctx, 3 * n, sizeof *s->inverse);
    s->pcg = (drape_pcg){.n = pattern->n,
                         .owner = s,
                         .multiply = multiply,
                         .precondition = precondition,
                         .max_iterations = MOST,
                         .r = drape_alloc(ctx, n, sizeof(double)),
                         .z = drape_alloc(ctx, n, sizeof(double)),
                         .p = drape_alloc(ctx, n, sizeof(double)),
                         .q = drape_alloc(ctx, n, sizeof(double))};
    drape_status status = s->values && s->inverse && s->pcg.r && s->pcg.z && s->pcg.p && s->pcg.q
                              ? build_coarse(s)
                              : DRAPE_E_MEMORY;
    if (status)
        destroy(state);
    return status;
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

/* Inverts a diagonal block by its cofactors; false where it is not positive definite. */
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
    const drape_linear_ops *row = s->coarse_row;
    return (row->factor_definite ? row->factor_definite : row->factor)(s->coarse_solver, s->coarse_values);
}

static drape_status factor_general(pcg_state *s)
{
    drape_status status = DRAPE_OK;
    s->fallbacks++;
    if (!s->general)
        status = s->general_row->create(s->ctx, s->pattern, &s->general);
    if (!status)
        status = s->general_row->factor(s->general, s->values);
    s->by_general = s->factored = !status;
    return status;
}

static drape_status factor(void *state, const double *values)
{
    pcg_state *s = state;
    s->by_general = s->factored = false;
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
    if (!s->by_general) {
        s->pcg.tolerance = tolerance;
        drape_pcg_solve(&s->pcg, b, x);
        *iterations = s->pcg.iterations;
        if (s->pcg.definite && s->pcg.converged && drape_all_finite(x, (size_t)s->pattern->n))
            return DRAPE_OK;
        drape_status status = factor_general(s);
        if (status)
            return status;
    }
    return s->general_row->solve(s->general, b, x);
}

static drape_status solve(void *state, const double *b, double *x)
{
    int64_t iterations;
    return solve_inexact(state, b, x, EXACT, &iterations);
}

/* The coarse matrix is kept as it was: it may be of an earlier matrix than that of the general row. */
static void archive(void *state, drape_archive *a, const double *values)
{
    pcg_state *s = state;
    const bool coarse = s->coarse_row->archive != NULL || values;
    drape_archive_int64(a, &s->fallbacks);
    drape_archive_bool(a, &s->by_general);
    drape_archive_bool(a, &s->factored);
    drape_linear_archive_general(s->general_row, s->ctx, s->pattern, &s->general, a,
                                 s->by_general ? values : NULL);
    if (coarse)
        drape_archive_doubles(a, s->coarse_values, (size_t)s->coarse.nonzeros);
    bool stands = values && s->factored && !s->by_general;
    drape_linear_archive(s->coarse_row, s->coarse_solver, a, stands ? s->coarse_values : NULL);
    if (!drape_archive_is_reading(a) || !values)
        return;
    memcpy(s->values, values, (size_t)s->pattern->nonzeros * sizeof *values);
    if (stands)
        invert_diagonal(s);
}

static size_t bytes(const void *state)
{
    const pcg_state *s = state;
    const drape_prolong *p = &s->prolong;
    const drape_pattern *fine = s->pattern;
    size_t products_total = 0, entries = (size_t)p->start[p->fine], n = (size_t)fine->n;
    for (int32_t j = 0; j < fine->block_count; j++)
        for (int32_t k = fine->block_start[j]; k < fine->block_start[j + 1]; k++)
            products_total += (size_t)products(p, fine->block_row[k], j);
    size_t doubles =
        (size_t)fine->nonzeros + 7 * n + entries + 2 * (size_t)s->coarse.nonzeros + 3 * (size_t)s->coarse.n;
    return sizeof *s + doubles * sizeof(double) + (products_total + entries + n / 3) * sizeof(int32_t) +
           s->coarse_row->bytes(s->coarse_solver) + (s->general ? s->general_row->bytes(s->general) : 0);
}

static void report(const void *state, drape_linear_report *out)
{
    const pcg_state *s = state;
    *out = (drape_linear_report){
        .row = &drape_linear_pcg, .fallbacks = s->fallbacks, .fallback = s->general ? s->general_row : NULL};
}

const drape_linear_ops drape_linear_pcg = {
    .entry =
        {.name = "pcg",
         .summary =
             "conjugate gradients with diagonal blocks and a coarse space, no factors of the matrix; what is "
             "not symmetric positive definite goes to umfpack or klu, by size",
         .reference = "Hestenes & Stiefel 1952; Vanek, Mandel & Brezina 1996"},
    .borrows_heap = true, /* of the rows that it has for the coarse space and for general matrices */
    .create = create,
    .factor = factor,
    .solve = solve,
    .solve_inexact = solve_inexact,
    .archive = archive,
    .destroy = destroy,
    .bytes = bytes,
    .report = report,
};
