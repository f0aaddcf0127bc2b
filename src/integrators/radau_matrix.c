/* radau_matrix.c: see radau_matrix.h. */
#include "integrators/radau_matrix.h"

#include "base/elementary.h"

#include <math.h>
#include <string.h>

#define VECTORS 24  /* of GMRES; without damping the residual falls by 1e8 in them */
#define LARGEST 0.5 /* residual after these: more means that GMRES does not converge */

typedef struct complex_number {
    double re, im;
} complex_number;

static complex_number product(complex_number a, complex_number b)
{
    return (complex_number){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}

static complex_number conjugate(complex_number a)
{
    return (complex_number){a.re, -a.im};
}

/* ---- Memory ---- */

static double *stiffness_of(const drape_radau_matrix *m)
{
    return m->linear->more[0];
}

/* NULL if nothing dissipates. */
static double *damping_of(const drape_radau_matrix *m)
{
    return m->linear->more[1];
}

drape_status drape_radau_matrix_create(drape_arena *arena, drape_system *system, const drape_linear_ops *ops,
                                       drape_radau_matrix *m)
{
    const drape_model *model = drape_system_model(system);
    const size_t n = 3 * (size_t)model->free_count;
    *m = (drape_radau_matrix){.system = system, .n = 3 * (int64_t)model->free_count};
    m->mass = drape_arena_take(arena, n, sizeof *m->mass);
    m->basis = drape_arena_take(arena, 2 * n, (VECTORS + 1) * sizeof *m->basis);
    m->image = drape_arena_take(arena, 2 * n, sizeof *m->image);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < n; i++)
        m->mass[i] = model->mass[model->node_of_free[i / 3]];
    return drape_system_matrix_create(arena, system, ops, model->has_dissipation ? 2 : 1, 0, &m->linear);
}

void drape_radau_matrix_destroy(drape_radau_matrix *m)
{
    drape_system_matrix_destroy(&m->linear);
}

/* ---- Matrices ---- */

drape_status drape_radau_matrix_evaluate(drape_radau_matrix *m, const drape_point *point)
{
    drape_point at = *point;
    drape_status status = drape_system_matrix_follow(m->linear, point);
    m->h = 0;
    if (status)
        return status;
    double *stiffness = stiffness_of(m), *damping = damping_of(m);
    at.weight = 0;
    drape_system_jacobian(m->system, &at, 0, 0, stiffness);
    if (damping && point->contact == DRAPE_CONTACT_GAUSS_NEWTON) {
        /* D with the upper bounds of restitution and friction, which drape_system_damping has not: what K
         * + D has more than K. */
        at.weight = 1;
        drape_system_jacobian(m->system, &at, 0, 0, damping);
        for (int64_t k = 0; k < m->linear->pattern->nonzeros; k++)
            damping[k] -= stiffness[k];
    } else if (damping)
        drape_system_damping(m->system, &at, damping);
    /* Friction and dashpots of strains that rotate are not symmetric. As in ida.c, Newton's iteration does
     * not need those parts: with Cholesky factors a run takes three quarters of the time, for as many
     * iterations. */
    drape_pattern_symmetrize(m->linear->pattern, stiffness);
    if (damping)
        drape_pattern_symmetrize(m->linear->pattern, damping);
    return DRAPE_OK;
}

drape_status drape_radau_matrix_factor(drape_radau_matrix *m, double h)
{
    const drape_pattern *p = m->linear->pattern;
    const double w = DRAPE_RADAU_GAMMA / h, *stiffness = stiffness_of(m), *damping = damping_of(m);
    double *values = m->linear->values;
    if (m->h == h)
        return DRAPE_OK;
    for (int64_t k = 0; k < p->nonzeros; k++)
        values[k] = damping ? stiffness[k] + w * damping[k] : stiffness[k];
    for (int32_t j = 0; j < p->block_count; j++) {
        int64_t stride;
        double *to = drape_pattern_at(p, values, j, p->diagonal[j], &stride);
        for (int c = 0; c < 3; c++)
            to[c * stride + c] += w * w * m->mass[3 * j + c];
    }
    drape_status status = drape_system_matrix_factor(m->linear, false);
    m->h = status ? 0 : h;
    return status;
}

drape_status drape_radau_matrix_solve(drape_radau_matrix *m, const double *b, double *x)
{
    return drape_system_matrix_solve(m->linear, b, x);
}

/* Adds the products of D with `count` vectors x (n each) to as many y. */
static void multiply_damping(const drape_radau_matrix *m, int count, const double *x, double *y)
{
    const drape_pattern *p = m->linear->pattern;
    const int64_t n = m->n;
    for (int32_t j = 0; j < p->block_count; j++)
        for (int32_t k = p->block_start[j]; k < p->block_start[j + 1]; k++) {
            int64_t stride;
            const double *d = drape_pattern_at(p, damping_of(m), j, k, &stride);
            for (int i = 0; i < count; i++) {
                const double *from = x + i * n + 3 * j;
                double *to = y + i * n + 3 * (int64_t)p->block_row[k];
                for (int r = 0; r < 3; r++)
                    to[r] += d[r] * from[0] + d[stride + r] * from[1] + d[2 * stride + r] * from[2];
            }
        }
}

void drape_radau_matrix_add_damping(const drape_radau_matrix *m, const double *x, double *y)
{
    if (damping_of(m))
        multiply_damping(m, 1, x, y);
}

/* ---- GMRES over complex numbers, in the inner product of M ---- */

static double *vector(const drape_radau_matrix *m, int j)
{
    return m->basis + 2 * m->n * j;
}

static complex_number inner(const drape_radau_matrix *m, const double *a, const double *b)
{
    const int64_t n = m->n;
    complex_number sum = {0, 0};
    for (int64_t i = 0; i < n; i++) {
        sum.re += m->mass[i] * (a[i] * b[i] + a[n + i] * b[n + i]);
        sum.im += m->mass[i] * (a[i] * b[n + i] - a[n + i] * b[i]);
    }
    return sum;
}

/* y += factor x */
static void add(const drape_radau_matrix *m, complex_number factor, const double *x, double *y)
{
    const int64_t n = m->n;
    for (int64_t i = 0; i < n; i++) {
        y[i] += factor.re * x[i] - factor.im * x[n + i];
        y[n + i] += factor.re * x[n + i] + factor.im * x[i];
    }
}

/* Makes a vector one of length 1; its length. */
static double normalise(const drape_radau_matrix *m, double *x)
{
    const double length = sqrt(inner(m, x, x).re);
    for (int64_t i = 0; i < 2 * m->n && length > 0; i++)
        x[i] /= length;
    return length;
}

/* The solution with P of both parts of b. */
static drape_status precondition(drape_radau_matrix *m, const double *b, double *x)
{
    drape_status status = drape_system_matrix_solve(m->linear, b, x);
    return status ? status : drape_system_matrix_solve(m->linear, b + m->n, x + m->n);
}

/* y = P^-1 C x, from (C - P) x. */
static drape_status apply(drape_radau_matrix *m, const double *x, double *y)
{
    const int64_t n = m->n;
    const double w = DRAPE_RADAU_GAMMA / m->h;
    const complex_number mu = {DRAPE_RADAU_ALPHA / m->h, DRAPE_RADAU_BETA / m->h}, square = product(mu, mu);
    const complex_number of_d = {mu.re - w, mu.im}, of_m = {square.re - w * w, square.im};
    double *image = m->image;
    memset(image, 0, 2 * (size_t)n * sizeof *image);
    if (damping_of(m))
        multiply_damping(m, 2, x, image);
    for (int64_t i = 0; i < n; i++) {
        const complex_number d = product(of_d, (complex_number){image[i], image[n + i]}),
                             mass = product(of_m, (complex_number){m->mass[i] * x[i], m->mass[i] * x[n + i]});
        image[i] = d.re + mass.re;
        image[n + i] = d.im + mass.im;
    }
    drape_status status = precondition(m, image, y);
    for (int64_t i = 0; i < 2 * n; i++)
        y[i] += x[i];
    return status;
}

/* The rotation [c' s; -s c], with a complex c and a real s, of two components. */
static void rotate(complex_number c, double s, complex_number *x, complex_number *y)
{
    const complex_number up = product(conjugate(c), *x), down = product(c, *y);
    const complex_number from = *x;
    *x = (complex_number){up.re + s * y->re, up.im + s * y->im};
    *y = (complex_number){down.re - s * from.re, down.im - s * from.im};
}

drape_status drape_radau_matrix_solve_complex(drape_radau_matrix *m, const double *b, double tolerance,
                                              double *x)
{
    complex_number h[VECTORS][VECTORS + 1], c[VECTORS], g[VECTORS + 1] = {{0, 0}};
    double s[VECTORS];
    drape_status status = precondition(m, b, vector(m, 0));
    const double first = status ? 0 : normalise(m, vector(m, 0));
    memset(x, 0, 2 * (size_t)m->n * sizeof *x);
    if (status || first == 0)
        return status;
    g[0].re = first;
    double left = first;
    int count = 0;
    while (count < VECTORS && left > tolerance * first) {
        const int j = count;
        double *next = vector(m, j + 1);
        status = apply(m, vector(m, j), next);
        if (status)
            return status;
        for (int i = 0; i <= j; i++) {
            h[j][i] = inner(m, vector(m, i), next);
            add(m, (complex_number){-h[j][i].re, -h[j][i].im}, vector(m, i), next);
        }
        h[j][j + 1] = (complex_number){normalise(m, next), 0};
        for (int i = 0; i < j; i++)
            rotate(c[i], s[i], &h[j][i], &h[j][i + 1]);
        const double length = drape_hypot(drape_hypot(h[j][j].re, h[j][j].im), h[j][j + 1].re);
        if (!(length > 0))
            return DRAPE_RETRY_LINEAR;
        c[j] = (complex_number){h[j][j].re / length, h[j][j].im / length};
        s[j] = h[j][j + 1].re / length;
        rotate(c[j], s[j], &h[j][j], &h[j][j + 1]);
        rotate(c[j], s[j], &g[j], &g[j + 1]);
        left = drape_hypot(g[j + 1].re, g[j + 1].im);
        count++;
    }
    if (!(left <= LARGEST * first))
        return DRAPE_RETRY_LINEAR;
    /* x is the combination of the basis with the least residual: the Hessenberg matrix, by columns, is
     * triangular, g is rotated. */
    for (int j = count - 1; j >= 0; j--) {
        for (int i = j + 1; i < count; i++) {
            const complex_number known = product(h[i][j], g[i]);
            g[j].re -= known.re;
            g[j].im -= known.im;
        }
        const complex_number by = h[j][j], q = product(g[j], conjugate(by));
        const double size = by.re * by.re + by.im * by.im;
        g[j] = (complex_number){q.re / size, q.im / size};
        add(m, g[j], vector(m, j), x);
    }
    return DRAPE_OK;
}

/* ---- For the integrator ---- */

void drape_radau_matrix_archive(drape_radau_matrix *m, drape_archive *a)
{
    if (drape_archive_has_read(a))
        drape_archive_note(a, drape_system_matrix_renew(m->linear));
    drape_archive_double(a, &m->h);
    if (!drape_archive_good(a))
        return;
    for (int k = 0; k < m->linear->more_count; k++)
        if (!m->linear->more[k]) /* memory was out in the last attempt */
            drape_archive_note(a, DRAPE_E_MEMORY);
    if (!drape_archive_good(a))
        return;
    for (int k = 0; k < m->linear->more_count; k++)
        drape_archive_doubles(a, m->linear->more[k], (size_t)m->linear->pattern->nonzeros);
    drape_system_matrix_archive(m->linear, a, m->h > 0);
}

size_t drape_radau_matrix_bytes(const drape_radau_matrix *m)
{
    return drape_system_matrix_bytes(m->linear);
}
