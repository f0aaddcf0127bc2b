/* refine.c: see refine.h. */
#include "solvers/refine.h"

#include "solvers/rounding.h"

#include <math.h>
#include <string.h>

#define VECTORS 10 /* of a cycle */

drape_status drape_refine_create(drape_arena *arena, const drape_pattern *pattern, drape_refine *w)
{
    drape_status status = drape_refine_init(arena, drape_pattern_own(pattern), w);
    w->pattern = pattern;
    if (pattern->ranks) {
        w->input = drape_arena_take(arena, (size_t)pattern->n, sizeof *w->input);
        w->output = drape_arena_take(arena, (size_t)pattern->n, sizeof *w->output);
    }
    return status ? status : drape_arena_status(arena);
}

drape_status drape_refine_init(drape_arena *arena, int64_t unknowns, drape_refine *w)
{
    const size_t n = (size_t)unknowns;
    *w = (drape_refine){.n = unknowns};
    w->residual = drape_arena_take(arena, n, sizeof *w->residual);
    w->basis = drape_arena_take(arena, n, (VECTORS + 1) * sizeof *w->basis);
    w->correction = drape_arena_take(arena, n, VECTORS * sizeof *w->correction);
    return drape_arena_status(arena);
}

static const drape_ranks *ranks_of(const drape_refine *w)
{
    return w->pattern ? w->pattern->ranks : NULL;
}

static double dot(const drape_refine *w, const double *x, const double *y)
{
    double sum = 0;
    for (int64_t i = 0; i < w->n; i++)
        sum += x[i] * y[i];
    return drape_ranks_sum(ranks_of(w), sum);
}

static double norm(const drape_refine *w, const double *x)
{
    return sqrt(dot(w, x, x));
}

/* NaN if there is one. */
static double largest(const drape_refine *w, const double *x)
{
    double most = 0;
    for (int64_t i = 0; i < w->n; i++)
        most = fabs(x[i]) <= most ? most : fabs(x[i]);
    return drape_ranks_largest(ranks_of(w), most);
}

/* A matrix by the values of a pattern. */
typedef struct entries {
    const drape_pattern *pattern;
    const double *values;
    double *input, *output; /* of drape_refine */
} entries;

static void add_blocks(const drape_pattern *p, const double *values, double factor, const double *x,
                       double *y)
{
    for (int32_t j = 0; j < p->block_count; j++) {
        const double x0 = factor * x[3 * j], x1 = factor * x[3 * j + 1], x2 = factor * x[3 * j + 2];
        for (int32_t k = p->block_start[j]; k < p->block_start[j + 1]; k++) {
            int64_t stride;
            const double *a = drape_pattern_at(p, (double *)(uintptr_t)values, j, k, &stride);
            double *to = y + 3 * (int64_t)p->block_row[k];
            for (int r = 0; r < 3; r++)
                to[r] += a[r] * x0 + a[stride + r] * x1 + a[2 * stride + r] * x2;
        }
    }
}

static void add_product(const void *owner, double factor, const double *x, double *y)
{
    const entries *a = owner;
    const drape_pattern *p = a->pattern;
    const size_t own = (size_t)drape_pattern_own(p) * sizeof *x;
    if (!p->ranks) {
        add_blocks(p, a->values, factor, x, y);
        return;
    }
    memcpy(a->input, x, own);
    p->ranks->fetch_blocks(p->ranks, a->input);
    memcpy(a->output, y, own);
    add_blocks(p, a->values, factor, a->input, a->output);
    memcpy(y, a->output, own);
}

static void find_residual(drape_refine *w, drape_add_product *product, const void *owner, const double *b,
                          const double *x)
{
    const int64_t n = w->n;
    for (int64_t i = 0; i < n; i++)
        w->residual[i] = b[i];
    product(owner, -1, x, w->residual);
    w->error = largest(w, w->residual) / (largest(w, x) + largest(w, b));
    if (largest(w, b) == 0 && largest(w, w->residual) == 0)
        w->error = 0;
}

/* One cycle of GMRES: corrects x until the residual is expected to be below `target`. */
static void correct(drape_refine *w, drape_preconditioner *apply, void *factors, drape_add_product *product,
                    const void *owner, double target, double *x)
{
    const int64_t n = w->n;
    double h[VECTORS][VECTORS + 1] = {{0}}, c[VECTORS], s[VECTORS], g[VECTORS + 1] = {0};
    int j = 0;
    g[0] = norm(w, w->residual);
    for (int64_t k = 0; k < n; k++)
        w->basis[k] = w->residual[k] / g[0];
    for (; j < VECTORS && fabs(g[j]) > target; j++) {
        double *v = w->basis + (j + 1) * n, *z = w->correction + j * n, *column = h[j];
        apply(factors, w->basis + j * n, z);
        for (int64_t k = 0; k < n; k++)
            v[k] = 0;
        product(owner, 1, z, v);
        /* The new vector becomes orthogonal to the others and of length 1 (modified Gram-Schmidt). */
        for (int i = 0; i <= j; i++) {
            const double *u = w->basis + i * n;
            column[i] = dot(w, u, v);
            for (int64_t k = 0; k < n; k++)
                v[k] -= column[i] * u[k];
        }
        column[j + 1] = norm(w, v);
        for (int64_t k = 0; k < n && column[j + 1] > 0; k++)
            v[k] /= column[j + 1];
        /* The earlier rotations of its column of the Hessenberg matrix, and one that makes it triangular. */
        for (int i = 0; i < j; i++) {
            const double kept = column[i];
            column[i] = c[i] * kept + s[i] * column[i + 1];
            column[i + 1] = c[i] * column[i + 1] - s[i] * kept;
        }
        const double length = sqrt(column[j] * column[j] + column[j + 1] * column[j + 1]);
        c[j] = length > 0 ? column[j] / length : 1;
        s[j] = length > 0 ? column[j + 1] / length : 0;
        column[j] = length;
        g[j + 1] = -s[j] * g[j];
        g[j] *= c[j];
    }
    w->iterations += j;
    /* The combination of the corrections with the least residual. */
    for (int a = j - 1; a >= 0; a--) {
        for (int i = a + 1; i < j; i++)
            g[a] -= h[i][a] * g[i];
        g[a] = h[a][a] != 0 ? g[a] / h[a][a] : 0;
        for (int64_t k = 0; k < n; k++)
            x[k] += g[a] * w->correction[a * n + k];
    }
}

drape_status drape_refine_solve(drape_refine *w, drape_preconditioner *apply, void *factors,
                                const double *values, const double *b, double *x)
{
    const int64_t n = w->n;
    const entries a = {w->pattern, values, w->input, w->output};
    double before = INFINITY;
    apply(factors, b, x);
    find_residual(w, add_product, &a, b, x);
    w->first_error = w->error;
    while (w->error > DRAPE_EXACT && w->error < before / 2) {
        const double size = largest(w, x) + largest(w, b);
        before = w->error;
        correct(w, apply, factors, add_product, &a, 0.1 * DRAPE_EXACT * size * sqrt((double)n), x);
        find_residual(w, add_product, &a, b, x);
    }
    /* the two triangles of a matrix that counts as symmetric may differ by this part */
    return w->error <= DRAPE_PATTERN_ROUNDING ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

void drape_refine_reduce_product(drape_refine *w, drape_preconditioner *apply, void *factors,
                                 drape_add_product *product, const void *owner, const double *b,
                                 double tolerance, double *x)
{
    const double target = tolerance * norm(w, b);
    apply(factors, b, x);
    find_residual(w, product, owner, b, x);
    if (norm(w, w->residual) > target)
        correct(w, apply, factors, product, owner, target, x);
}

void drape_refine_reduce(drape_refine *w, drape_preconditioner *apply, void *factors, const double *values,
                         const double *b, double tolerance, double *x)
{
    const entries a = {w->pattern, values, w->input, w->output};
    drape_refine_reduce_product(w, apply, factors, add_product, &a, b, tolerance, x);
}
