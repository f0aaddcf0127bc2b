/* nonsymmetric.c: see nonsymmetric.h. */
#include "nonlinear/nonsymmetric.h"

#include "base/finite.h"
#include "base/vec3.h"
#include "solvers/linear.h"

#include <string.h>

/* Residual left by a solution, of |b|, most of which are normal forces. A sheet of 1 m, E h 300 to 1e5
 * N/m, that is thrown on a slope with friction 0.4 is 0 to 17 mm from the converged run after 0.4 s with
 * 1e-4, 2 to 41 mm with 1e-3, and 0.07 to 0.6 m, where it sticks, with A alone, for two thirds more
 * iterations. With 1e-2 flags in wind are 2 to 95 mm of 1 m from the converged run, with 1e-4 0 to 15. */
#define TOLERANCE DRAPE_LINEAR_TIGHT

drape_status drape_nonsymmetric_init(drape_arena *arena, drape_system *system, bool terms, void *owner,
                                     drape_pcg_map *multiply, drape_preconditioner *solve,
                                     drape_nonsymmetric *s)
{
    const int64_t n = 3 * (int64_t)drape_system_model(system)->free_count;
    *s = (drape_nonsymmetric){.arena = drape_arena_within(arena)};
    if (!terms && !drape_system_has_friction(system))
        return DRAPE_OK;
    s->system = system;
    s->owner = owner;
    s->multiply = multiply;
    s->solve = solve;
    s->version = -1;
    s->product = drape_arena_take(arena, (size_t)n, sizeof *s->product);
    return drape_refine_init(arena, n, &s->refine);
}

void drape_nonsymmetric_free(drape_nonsymmetric *s)
{
    drape_arena_free(&s->arena);
}

static drape_status take_pattern(drape_nonsymmetric *s)
{
    const drape_pattern *p = drape_system_pattern(s->system);
    const size_t blocks = (size_t)p->block_start[p->block_count];
    drape_arena_free(&s->arena);
    s->values = drape_arena_take(&s->arena, (size_t)p->nonzeros, sizeof *s->values);
    s->column = drape_arena_take(&s->arena, blocks, sizeof *s->column);
    s->slot = drape_arena_take(&s->arena, blocks, sizeof *s->slot);
    const drape_status status = drape_arena_status(&s->arena);
    s->version = status ? -1 : drape_system_pattern_version(s->system);
    return status;
}

static bool is_zero(const double *block, int64_t stride)
{
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            if (block[c * stride + r] != 0)
                return false;
    return true;
}

drape_status drape_nonsymmetric_update(drape_nonsymmetric *s, const drape_point *point, const double *terms)
{
    /* Contact is a part of E - A, but not while bodies leave some cloth no room: with it, cloth was still
     * in them half a second after they had parted, in one of the pinches of the tests, and in none
     * without. */
    const bool contact = s->system && drape_system_has_friction(s->system) &&
                         !drape_contact_exempts(drape_system_contact(s->system)) &&
                         drape_system_touches(s->system);
    s->acts = s->system && (contact || terms);
    if (!s->acts)
        return DRAPE_OK;
    drape_status status = s->version == drape_system_pattern_version(s->system) ? DRAPE_OK : take_pattern(s);
    s->acts = !status;
    if (status)
        return status;
    const drape_pattern *p = drape_system_pattern(s->system);
    if (contact)
        drape_system_contact_remainder(s->system, point, s->values);
    else
        memset(s->values, 0, (size_t)p->nonzeros * sizeof *s->values);
    if (terms)
        drape_pattern_add_antisymmetric(p, terms, s->values);
    s->count = 0;
    for (int32_t j = 0; j < p->block_count; j++)
        for (int32_t k = p->block_start[j]; k < p->block_start[j + 1]; k++) {
            int64_t stride;
            const double *block = drape_pattern_at(p, s->values, j, k, &stride);
            if (is_zero(block, stride))
                continue;
            s->column[s->count] = j;
            s->slot[s->count++] = k;
        }
    return DRAPE_OK;
}

/* y += factor E x */
static void add_product(const void *owner, double factor, const double *x, double *y)
{
    const drape_nonsymmetric *s = owner;
    const drape_pattern *p = drape_system_pattern(s->system);
    s->multiply(s->owner, x, s->product);
    for (int32_t b = 0; b < s->count; b++) {
        int64_t stride;
        const double *block = drape_pattern_at(p, s->values, s->column[b], s->slot[b], &stride),
                     *from = x + 3 * (size_t)s->column[b];
        double *to = s->product + 3 * (size_t)p->block_row[s->slot[b]];
        for (int c = 0; c < 3; c++)
            vec3_add_scaled(from[c], block + c * stride, to);
    }
    drape_system_project_free(s->system, s->product);
    for (int64_t i = 0; i < p->n; i++)
        y[i] += factor * s->product[i];
}

bool drape_nonsymmetric_solve(drape_nonsymmetric *s, const double *b, double *x, int *iterations)
{
    const int64_t before = s->refine.iterations;
    double work = 0;
    if (!s->acts)
        return false;
    drape_refine_reduce_product(&s->refine, s->solve, s->owner, add_product, s, b, TOLERANCE, x);
    *iterations += (int)(s->refine.iterations - before);
    for (int64_t i = 0; i < s->refine.n; i++)
        work += x[i] * b[i];
    return work > 0 && drape_all_finite(x, (size_t)s->refine.n);
}
