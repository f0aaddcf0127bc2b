/*
 * spectrum.c: the largest eigenvalue of A = M^-1/2 K M^-1/2 by Lanczos' recurrence, a power iteration u, A
 * u, A^2 u ... that keeps all earlier powers: the largest eigenvalue of its tridiagonal matrix T is the
 * largest Ritz value of the whole sequence (Parlett 1998, 13). The power iteration alone needs hundreds of
 * products if the fastest waves of a sheet are close together.
 *     b_j u_j+1 = A u_j - a_j u_j - b_j-1 u_j-1,  a_j = u_j . A u_j
 * Orthogonality is gradually lost; that repeats eigenvalues of T but moves none out of the spectrum.
 *
 * K u = (g(x + e u) - g(x))/e at v = 0, where no dashpot and no drag has a force; D u likewise with v. e
 * moves no node by more than 1e-6 of the shortest edge: on that scale elements are linear up to 1e-6, and
 * rounding x, which grows with the distance from the origin, is 1e-10 of the difference of the forces for
 * each edge of that distance.
 */
#include "integrators/spectrum.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define MOVE 1e-6 /* of the shortest edge */

struct drape_spectrum {
    drape_system *system;
    const drape_model *model;
    int iterations;
    size_t nodes, dofs;        /* entries of arrays of nodes, of free DOFs */
    double move;               /* [m] */
    double *root;              /* free nodes: m^-1/2 [kg^-1/2] */
    double *u, *before, *next; /* free DOFs: u_j, u_j-1, A u_j */
    double *x, *v, *g, *g0;    /* nodes */
    double *a, *b;             /* (iterations) */
};

drape_status drape_spectrum_create(drape_arena *arena, drape_system *system, int iterations,
                                   drape_spectrum **out)
{
    const drape_model *m = drape_system_model(system);
    drape_spectrum *s = *out = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    *s = (drape_spectrum){.system = system,
                          .model = m,
                          .iterations = iterations,
                          .nodes = 3 * (size_t)m->node_count,
                          .dofs = 3 * (size_t)m->free_count};
    double **const of_dofs[] = {&s->u, &s->before, &s->next},
                   **const of_nodes[] = {&s->x, &s->v, &s->g, &s->g0};
    for (int i = 0; i < 3; i++)
        *of_dofs[i] = drape_arena_take(arena, s->dofs, sizeof(double));
    for (int i = 0; i < 4; i++)
        *of_nodes[i] = drape_arena_take(arena, s->nodes, sizeof(double));
    s->root = drape_arena_take(arena, s->dofs / 3, sizeof *s->root);
    s->a = drape_arena_take(arena, (size_t)iterations, sizeof *s->a);
    s->b = drape_arena_take(arena, (size_t)iterations, sizeof *s->b);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    double shortest = m->length;
    for (int32_t e = 0; e < m->edge_count; e++)
        shortest = fmin(shortest, m->edge_length[e]);
    s->move = MOVE * shortest;
    for (int32_t f = 0; f < m->free_count; f++)
        s->root[f] = 1 / sqrt(m->mass[m->node_of_free[f]]);
    return DRAPE_OK;
}

/* Normalises u and returns its former norm. */
static double normalise(double *u, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += u[i] * u[i];
    double norm = sqrt(sum);
    if (!(norm > 0))
        return norm;
    for (size_t i = 0; i < n; i++)
        u[i] /= norm;
    return norm;
}

/* next = M^-1/2 (g(y + e M^-1/2 u) - g(y))/e, where y is s->x or s->v, whose free entries are those of
 * `from` (NULL: 0) before and after the call. */
static void product(drape_spectrum *s, const drape_state *at, double *y, const double *from)
{
    const drape_model *m = s->model;
    const drape_point point = {.x = s->x, .v = s->v, .internal = at->internal, .t = at->t, .done = true};
    double max = 0;
    for (size_t i = 0; i < s->dofs; i++)
        max = fmax(max, fabs(s->u[i]) * s->root[i / 3]);
    double e = s->move / max;
    for (size_t i = 0; i < s->dofs; i++)
        y[3 * (size_t)m->node_of_free[i / 3] + i % 3] += e * s->u[i] * s->root[i / 3];
    drape_system_force(s->system, &point, s->g);
    for (size_t i = 0; i < s->dofs; i++) {
        size_t node = 3 * (size_t)m->node_of_free[i / 3] + i % 3;
        s->next[i] = (s->g[node] - s->g0[node]) / e * s->root[i / 3];
        y[node] = from ? from[node] : 0;
    }
}

/* The number of eigenvalues of T (n x n) above z: Sturm's count of the signs in its LDL' factors. */
static int count_above(const double *a, const double *b, int n, double z)
{
    int count = 0;
    double d = 1;
    for (int j = 0; j < n; j++) {
        d = a[j] - z - (j > 0 ? b[j - 1] * b[j - 1] / d : 0);
        if (d == 0)
            d = -DBL_MIN;
        count += d > 0;
    }
    return count;
}

/* The largest eigenvalue of the matrix whose products are derivatives by y. */
static double largest(drape_spectrum *s, const drape_state *at, double *y, const double *from)
{
    const size_t dofs = s->dofs;
    int n = 0;
    /* u_0: numbers in [-1, 1) from a linear congruential generator (Knuth's MMIX). Every wave contributes
     * to them, and they are the same on every machine. */
    uint64_t seed = 1;
    for (size_t i = 0; i < s->dofs; i++) {
        seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
        s->u[i] = (double)(seed >> 11) / 4503599627370496.0 - 1;
        s->before[i] = 0;
    }
    normalise(s->u, s->dofs);
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
        if (!(s->b[n - 1] * s->b[n - 1] > DBL_EPSILON * a * a))
            break; /* b bounds the error of an eigenvalue, 1e-8 of |a|; or numbers are not finite */
    }
    /* The largest eigenvalue of T, by bisection of the interval of Gershgorin's circles. */
    double low = 0, high = 0;
    for (int j = 0; j < n; j++)
        high = fmax(high, s->a[j] + (j > 0 ? fabs(s->b[j - 1]) : 0) + (j + 1 < n ? fabs(s->b[j]) : 0));
    while (high - low > DBL_EPSILON * high) {
        double middle = 0.5 * (low + high);
        if (count_above(s->a, s->b, n, middle) > 0)
            low = middle;
        else
            high = middle;
    }
    return 0.5 * (low + high);
}

void drape_spectrum_largest(drape_spectrum *s, const drape_state *at, double *omega, double *damping)
{
    const drape_point rest = {.x = s->x, .v = s->v, .internal = at->internal, .t = at->t, .done = true};
    memcpy(s->x, at->x, s->nodes * sizeof *s->x);
    memset(s->v, 0, s->nodes * sizeof *s->v);
    drape_system_force(s->system, &rest, s->g0);
    *omega = sqrt(fmax(0, largest(s, at, s->x, at->x)));
    *damping = s->model->has_own_dissipation ? fmax(0, largest(s, at, s->v, NULL)) : 0;
}
