/* scalar.c: see scalar.h. */
#include "integrators/scalar.h"

#include <string.h>

/* Adds the Hessians at rest of the measures, with the weight w of rates. Strains are zero there, so they are k_eff dq
 * dq'. */
static void add_rest_hessians(drape_system *system, bool pairs, const double *internal, const double *at_rest,
                              double w, double *values)
{
    const drape_model *m = drape_system_model(system);
    const drape_point point = {.x = m->rest, .v = at_rest, .internal = internal, .weight = w};
    for (int32_t t = 0; t < m->term_count; t++)
        if (m->terms[t].ops->measure && (pairs || !m->terms[t].ops->pair))
            drape_system_term(system, t, &point, NULL, NULL, values);
}

static double trace_at(const drape_pattern *p, double *values, int32_t column, int32_t block)
{
    int64_t stride;
    const double *a = drape_pattern_at(p, values, column, block, &stride);
    return a[0] + a[stride + 1] + a[2 * stride + 2];
}

/* The traces of the blocks, at weight 0 and by weight; those that are zero but for the diagonal are left out. */
static drape_status pack(drape_context *ctx, double *elastic, double *damped, drape_scalar *c)
{
    const drape_pattern *p = &c->model->pattern;
    size_t rows = (size_t)p->block_count, blocks = (size_t)p->block_start[rows];
    int32_t at = 0;
    c->start = drape_alloc(ctx, rows + 1, sizeof *c->start);
    c->diagonal = drape_alloc(ctx, rows, sizeof *c->diagonal);
    c->column = drape_alloc(ctx, blocks, sizeof *c->column);
    c->elastic = drape_alloc(ctx, blocks, sizeof *c->elastic);
    c->sum = drape_alloc(ctx, blocks, sizeof *c->sum);
    if (damped)
        c->damping = drape_alloc(ctx, blocks, sizeof *c->damping);
    if (!c->start || !c->diagonal || !c->column || !c->elastic || !c->sum || (damped && !c->damping))
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

drape_status drape_scalar_build(drape_context *ctx, drape_system *system, bool pairs, drape_scalar *out)
{
    const drape_model *m = drape_system_model(system);
    size_t n = (size_t)m->pattern.nonzeros;
    drape_arena arena = drape_arena_of(ctx);
    drape_state rest;
    *out = (drape_scalar){.model = m, .n = m->free_count};
    double *values[2] = {drape_alloc(ctx, n, sizeof(double)),
                         m->has_dissipation ? drape_alloc(ctx, n, sizeof(double)) : NULL};
    drape_status status = values[0] && (values[1] || !m->has_dissipation) ? DRAPE_OK : DRAPE_E_MEMORY;
    if (!status)
        status = drape_state_create(&arena, m, &rest);
    if (!status) {
        memset(rest.v, 0, 3 * (size_t)m->node_count * sizeof *rest.v);
        for (int w = 0; w < 2; w++)
            if (values[w])
                add_rest_hessians(system, pairs, rest.internal, rest.v, w, values[w]);
        status = pack(ctx, values[0], values[1], out);
    }
    drape_arena_free(&arena);
    drape_free(ctx, values[0]);
    drape_free(ctx, values[1]);
    return status;
}

void drape_scalar_free(drape_context *ctx, drape_scalar *c)
{
    void *all[] = {c->start, c->column, c->diagonal, c->elastic, c->damping, c->sum};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        drape_free(ctx, all[i]);
    *c = (drape_scalar){0};
}

bool drape_scalar_weigh(drape_scalar *c, double weight, double mass_weight)
{
    if (weight == c->weight && mass_weight == c->mass_weight)
        return false;
    for (int32_t k = 0; k < c->start[c->n]; k++)
        c->sum[k] = c->elastic[k] + (c->damping ? weight * c->damping[k] : 0);
    for (int32_t i = 0; i < c->n; i++)
        c->sum[c->diagonal[i]] += mass_weight * c->model->mass[c->model->node_of_free[i]];
    c->weight = weight;
    c->mass_weight = mass_weight;
    return true;
}

size_t drape_scalar_bytes(const drape_scalar *c)
{
    size_t n = (size_t)c->n, blocks = (size_t)c->model->pattern.block_start[n];
    return (2 * n + 1 + blocks) * sizeof(int32_t) + (c->damping ? 3 : 2) * blocks * sizeof(double);
}
