/* scalar_stiffness.c: see scalar_stiffness.h. */
#include "nonlinear/scalar_stiffness.h"

#include <string.h>

/* 1 - |B|^2/(tr B)^2 of a diagonal block that C still stands for: the largest share of a second direction. */
#define MAX_SPREAD 0.02

/* Adds the Hessians of the measures at rest, with rates weighted by w. Strains are zero there, so these are
 * k_eff dq dq'. */
static void add_rest_hessians(drape_system *system, const bool *of, const double *internal,
                              const double *at_rest, double w, double *values)
{
    const drape_model *m = drape_system_model(system);
    const drape_point point = {.x = m->rest, .v = at_rest, .internal = internal, .weight = w};
    for (int32_t t = 0; t < m->term_count; t++)
        if (of[t])
            drape_system_term(system, t, &point, NULL, NULL, values);
}

static double trace_at(const drape_pattern *p, double *values, int32_t column, int32_t block)
{
    int64_t stride;
    const double *a = drape_pattern_at(p, values, column, block, &stride);
    return a[0] + a[stride + 1] + a[2 * stride + 2];
}

/* Stores the traces of the blocks, from the values at the weights 0 and 1 (NULL: no damping), without zeros
 * off the diagonal. */
static drape_status pack(drape_arena *arena, double *elastic, double *damped, drape_scalar_stiffness *c)
{
    const drape_pattern *p = &c->model->pattern;
    size_t rows = (size_t)p->block_count, blocks = (size_t)p->block_start[rows];
    int32_t at = 0;
    c->start = drape_arena_take(arena, rows + 1, sizeof *c->start);
    c->diagonal = drape_arena_take(arena, rows, sizeof *c->diagonal);
    c->column = drape_arena_take(arena, blocks, sizeof *c->column);
    c->elastic = drape_arena_take(arena, blocks, sizeof *c->elastic);
    c->sum = drape_arena_take(arena, blocks, sizeof *c->sum);
    if (damped)
        c->damping = drape_arena_take(arena, blocks, sizeof *c->damping);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    for (int32_t j = 0; j < p->block_count; j++) {
        c->start[j] = at;
        for (int32_t k = p->block_start[j]; k < p->block_start[j + 1]; k++) {
            double e = trace_at(p, elastic, j, k), d = damped ? trace_at(p, damped, j, k) - e : 0;
            if (k == p->diagonal[j])
                c->diagonal[j] = at;
            else if (e == 0 && d == 0)
                continue;
            c->column[at] = p->block_row[k];
            c->elastic[at] = e;
            if (damped)
                c->damping[at] = d;
            at++;
        }
    }
    c->start[p->block_count] = at;
    return DRAPE_OK;
}

/* Whether the gradients of the measures at each node are parallel: then each diagonal block has rank one. */
static bool is_parallel(const drape_pattern *p, double *values)
{
    for (int32_t j = 0; j < p->block_count; j++) {
        int64_t stride;
        const double *a = drape_pattern_at(p, values, j, p->diagonal[j], &stride);
        double squares = 0, trace = trace_at(p, values, j, p->diagonal[j]);
        for (int c = 0; c < 3; c++)
            for (int r = 0; r < 3; r++)
                squares += a[c * stride + r] * a[c * stride + r];
        if (trace * trace - squares > MAX_SPREAD * trace * trace)
            return false;
    }
    return true;
}

drape_status drape_scalar_stiffness_covers(drape_system *system, bool *covers)
{
    const drape_model *m = drape_system_model(system);
    const size_t n = (size_t)m->pattern.nonzeros;
    drape_arena scratch = drape_arena_of(m->ctx);
    drape_state rest;
    double *values = drape_arena_take(&scratch, n, sizeof *values);
    drape_status status = drape_state_create(&scratch, m, &rest);
    if (!status)
        status = drape_arena_status(&scratch);
    for (int32_t t = 0; !status && t < m->term_count; t++) {
        const drape_point point = {.x = m->rest, .v = rest.v, .internal = rest.internal};
        covers[t] = m->terms[t].ops->measure && !m->terms[t].ops->pair;
        if (!covers[t])
            continue;
        memset(rest.v, 0, 3 * (size_t)m->node_count * sizeof *rest.v);
        memset(values, 0, n * sizeof *values);
        drape_system_term(system, t, &point, NULL, NULL, values);
        covers[t] = is_parallel(&m->pattern, values);
    }
    drape_arena_free(&scratch);
    return status;
}

drape_status drape_scalar_stiffness_build(drape_arena *arena, drape_system *system, const bool *of,
                                          drape_scalar_stiffness *out)
{
    const drape_model *m = drape_system_model(system);
    size_t n = (size_t)m->pattern.nonzeros;
    drape_arena scratch = drape_arena_of(arena->ctx);
    drape_state rest;
    double *elastic = drape_arena_take(&scratch, n, sizeof *elastic), *damped = NULL;
    if (m->has_dissipation)
        damped = drape_arena_take(&scratch, n, sizeof *damped);
    drape_status status = drape_arena_status(&scratch);
    *out = (drape_scalar_stiffness){.model = m, .n = m->free_count};
    if (!status)
        status = drape_state_create(&scratch, m, &rest);
    if (!status) {
        memset(rest.v, 0, 3 * (size_t)m->node_count * sizeof *rest.v);
        add_rest_hessians(system, of, rest.internal, rest.v, 0, elastic);
        if (damped)
            add_rest_hessians(system, of, rest.internal, rest.v, 1, damped);
        status = pack(arena, elastic, damped, out);
    }
    drape_arena_free(&scratch);
    return status;
}

void drape_scalar_stiffness_weigh(drape_scalar_stiffness *c, double weight, double mass_weight)
{
    if (weight == c->weight && mass_weight == c->mass_weight)
        return;
    for (int32_t k = 0; k < c->start[c->n]; k++)
        c->sum[k] = c->elastic[k] + (c->damping ? weight * c->damping[k] : 0);
    for (int32_t i = 0; i < c->n; i++)
        c->sum[c->diagonal[i]] += mass_weight * c->model->mass[c->model->node_of_free[i]];
    c->weight = weight;
    c->mass_weight = mass_weight;
}
