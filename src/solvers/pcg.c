/* pcg.c: see pcg.h. */
#include "solvers/pcg.h"

#include <string.h>

drape_pcg drape_pcg_of(drape_arena *arena, int64_t n, const void *owner, drape_pcg_map *multiply,
                       drape_pcg_map *precondition)
{
    return (drape_pcg){.n = n,
                       .owner = owner,
                       .multiply = multiply,
                       .precondition = precondition,
                       .r = drape_arena_take(arena, (size_t)n, sizeof(double)),
                       .z = drape_arena_take(arena, (size_t)n, sizeof(double)),
                       .p = drape_arena_take(arena, (size_t)n, sizeof(double)),
                       .q = drape_arena_take(arena, (size_t)n, sizeof(double))};
}

static double dot(const drape_pcg *s, const double *a, const double *b)
{
    double sum = 0;
    for (int64_t i = 0; i < s->n; i++)
        sum += a[i] * b[i];
    return drape_ranks_sum(s->ranks, sum);
}

void drape_pcg_solve(drape_pcg *s, const double *b, double *x, double tolerance, int max_iterations)
{
    const size_t bytes = (size_t)s->n * sizeof *x;
    s->iterations = 0;
    s->definite = true;
    if (x)
        memset(x, 0, bytes);
    memcpy(s->r, b, bytes);
    s->precondition(s->owner, s->r, s->z);
    memcpy(s->p, s->z, bytes);
    double size = dot(s, s->r, s->z), goal = tolerance * tolerance * size;
    s->converged = size == 0;
    while (!s->converged && s->iterations < max_iterations) {
        s->multiply(s->owner, s->p, s->q);
        double curvature = dot(s, s->p, s->q);
        if (!(curvature > 0)) {
            /* A direction without positive curvature. Before the first step x becomes the preconditioned
             * residual itself, which is a descent direction. */
            s->definite = false;
            if (s->iterations == 0 && x)
                memcpy(x, s->p, bytes);
            return;
        }
        const double a = size / curvature;
        for (int64_t i = 0; x && i < s->n; i++)
            x[i] += a * s->p[i];
        for (int64_t i = 0; i < s->n; i++)
            s->r[i] -= a * s->q[i];
        if (s->length)
            s->length[s->iterations] = a;
        s->iterations++;
        if (s->iterations == max_iterations)
            return;
        s->precondition(s->owner, s->r, s->z);
        double before = size;
        size = dot(s, s->r, s->z);
        s->converged = size <= goal;
        const double beta = size / before;
        if (s->ratio)
            s->ratio[s->iterations - 1] = beta;
        for (int64_t i = 0; i < s->n; i++)
            s->p[i] = s->z[i] + beta * s->p[i];
    }
}
