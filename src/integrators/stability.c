/*
 * stability.c: the largest eigenvalue of A = M^-1/2 K M^-1/2 by the power iteration u, A u, A^2 u ... in the
 * form that keeps what the powers before knew: Lanczos' recurrence, whose tridiagonal matrix T has the
 * largest Ritz value of the whole sequence as its own (Parlett 1998, 13). Power iteration alone needs
 * hundreds of products where a sheet's fastest waves lie close together.
 *     b_j u_j+1 = A u_j - a_j u_j - b_j-1 u_j-1,  a_j = u_j . A u_j
 * Orthogonality is lost in time; that repeats eigenvalues of T and moves none out of the spectrum.
 *
 * K u = (g(x + e u) - g(x))/e at v = 0, where no dashpot and no drag has a force; D u likewise by v. e moves
 * no node by more than 1e-6 of the shortest edge: elements are linear there to 1e-6, and rounding of x in
 * the forces is 1e-10 of the difference.
 */
#include "integrators/stability.h"

#include <math.h>
#include <string.h>

#define MOVE 1e-6 /* of the shortest edge */

struct drape_spectrum {
    drape_context *ctx;
    drape_system *system;
    const drape_model *model;
    int iterations;
    double move;               /* [m] */
    double *root;              /* free nodes: m^-1/2 [kg^-1/2] */
    double *u, *before, *next; /* free DOFs: u_j, u_j-1, A u_j */
    double *x, *v, *g, *g0;    /* nodes */
    double *a, *b;             /* (iterations) */
};

static double shortest_edge(const drape_model *m)
{
    double least = m->length;
    for (int32_t e = 0; e < m->edge_count; e++)
        least = fmin(least, m->edge_length[e]);
    return least;
}

void drape_spectrum_destroy(drape_spectrum **spectrum)
{
    drape_spectrum *s = *spectrum;
    if (!s)
        return;
    double *const all[] = {s->root, s->u, s->before, s->next, s->x, s->v, s->g, s->g0, s->a, s->b};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        drape_free(s->ctx, all[i]);
    drape_free(s->ctx, s);
    *spectrum = NULL;
}

drape_status drape_spectrum_create(drape_context *ctx, drape_system *system, int iterations,
                                   drape_spectrum **out)
{
    const drape_model *m = drape_system_model(system);
    size_t nodes = 3 * (size_t)m->node_count, dofs = 3 * (size_t)m->free_count, n = (size_t)iterations;
    drape_spectrum *s = drape_alloc(ctx, 1, sizeof *s);
    *out = s;
    if (!s)
        return DRAPE_E_MEMORY;
    *s = (drape_spectrum){.ctx = ctx, .system = system, .model = m, .iterations = iterations};
    s->move = MOVE * shortest_edge(m);
    struct {
        double **array;
        size_t count;
    } all[] = {{&s->root, dofs / 3}, {&s->u, dofs},  {&s->before, dofs}, {&s->next, dofs}, {&s->x, nodes},
               {&s->v, nodes},       {&s->g, nodes}, {&s->g0, nodes},    {&s->a, n},       {&s->b, n}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (!(*all[i].array = drape_alloc(ctx, all[i].count, sizeof(double)))) {
            drape_spectrum_destroy(out);
            return DRAPE_E_MEMORY;
        }
    for (int32_t f = 0; f < m->free_count; f++)
        s->root[f] = 1 / sqrt(m->mass[m->node_of_free[f]]);
    return DRAPE_OK;
}

size_t drape_spectrum_bytes(const drape_spectrum *s)
{
    size_t nodes = 3 * (size_t)s->model->node_count, dofs = 3 * (size_t)s->model->free_count;
    return (3 * dofs + dofs / 3 + 4 * nodes + 2 * (size_t)s->iterations) * sizeof(double) + sizeof *s;
}

/* Numbers in [-1, 1) from a linear congruential generator (Knuth's MMIX): every wave has a part in them, and
 * they are the same everywhere. */
static double normalise(double *u, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += u[i] * u[i];
    double norm = sqrt(sum);
    for (size_t i = 0; norm > 0 && i < n; i++)
        u[i] /= norm;
    return norm;
}

static void start(drape_spectrum *s, size_t n)
{
    uint64_t seed = 1;
    for (size_t i = 0; i < n; i++) {
        seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
        s->u[i] = (double)(seed >> 11) / 4503599627370496.0 - 1;
        s->before[i] = 0;
    }
    normalise(s->u, n);
}

/* next = M^-1/2 (g(y + e M^-1/2 u) - g(y))/e, y = x or v, which is `from` before and after. */
static void product(drape_spectrum *s, const drape_state *at, double *y, const double *from)
{
    const drape_model *m = s->model;
    const drape_point point = {.x = s->x, .v = s->v, .internal = at->internal, .t = at->t};
    double most = 0;
    for (size_t i = 0; i < 3 * (size_t)m->free_count; i++)
        most = fmax(most, fabs(s->u[i]) * s->root[i / 3]);
    double e = s->move / most;
    for (size_t i = 0; i < 3 * (size_t)m->free_count; i++)
        y[3 * (size_t)m->node_of_free[i / 3] + i % 3] += e * s->u[i] * s->root[i / 3];
    drape_system_force(s->system, &point, s->g);
    for (size_t i = 0; i < 3 * (size_t)m->free_count; i++) {
        size_t node = 3 * (size_t)m->node_of_free[i / 3] + i % 3;
        s->next[i] = (s->g[node] - s->g0[node]) / e * s->root[i / 3];
        y[node] = from ? from[node] : 0;
    }
}

/* How many eigenvalues of T (n x n) are above z: Sturm's count of the signs in its LDL' factors. */
static int count_above(const double *a, const double *b, int n, double z)
{
    int count = 0;
    double d = 1;
    for (int j = 0; j < n; j++) {
        d = a[j] - z - (j > 0 ? b[j - 1] * b[j - 1] / d : 0);
        if (d == 0)
            d = -1e-300;
        count += d > 0;
    }
    return count;
}

/* The largest eigenvalue of T, by halving the interval of Gershgorin's circles. */
static double largest_of(const double *a, const double *b, int n)
{
    double low = 0, high = 0;
    for (int j = 0; j < n; j++)
        high = fmax(high, a[j] + (j > 0 ? fabs(b[j - 1]) : 0) + (j + 1 < n ? fabs(b[j]) : 0));
    for (int k = 0; k < 60; k++) {
        double middle = 0.5 * (low + high);
        if (count_above(a, b, n, middle) > 0)
            low = middle;
        else
            high = middle;
    }
    return 0.5 * (low + high);
}

static double largest(drape_spectrum *s, const drape_state *at, double *y, const double *from)
{
    size_t dofs = 3 * (size_t)s->model->free_count;
    int n = 0;
    start(s, dofs);
    while (n < s->iterations && dofs > 0) {
        product(s, at, y, from);
        double a = 0;
        for (size_t i = 0; i < dofs; i++)
            a += s->u[i] * s->next[i];
        s->a[n] = a;
        for (size_t i = 0; i < dofs; i++)
            s->next[i] -= a * s->u[i] + (n > 0 ? s->b[n - 1] : 0) * s->before[i];
        double *spare = s->before;
        s->before = s->u;
        s->u = s->next;
        s->next = spare;
        s->b[n] = normalise(s->u, dofs);
        n++;
        if (!(s->b[n - 1] > 1e-12 * fabs(a))) /* all that u can reach is known, or nothing is a number */
            break;
    }
    return largest_of(s->a, s->b, n);
}

void drape_spectrum_largest(drape_spectrum *s, const drape_state *at, double *omega, double *damping)
{
    const drape_model *m = s->model;
    const drape_point rest = {.x = s->x, .v = s->v, .internal = at->internal, .t = at->t};
    memcpy(s->x, at->x, 3 * (size_t)m->node_count * sizeof *s->x);
    memset(s->v, 0, 3 * (size_t)m->node_count * sizeof *s->v);
    drape_system_force(s->system, &rest, s->g0);
    *omega = sqrt(fmax(0, largest(s, at, s->x, at->x)));
    *damping = m->has_dissipation ? fmax(0, largest(s, at, s->v, NULL)) : 0;
}
