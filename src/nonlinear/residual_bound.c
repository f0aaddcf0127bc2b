/* residual_bound.c: see residual_bound.h. */
#include "nonlinear/residual_bound.h"

#include "base/vec3.h"
#include "model/history.h"

#include <math.h>
#include <string.h>

/* ---- The forces at the start ---- */

typedef struct start {
    double load;     /* [N] sum over the free nodes of |g| */
    double rounding; /* [N] largest rounding error of a component of g */
} start;

/* Of the terms alone: contact needs a step to compare with. */
static void add_terms(drape_system *system, const drape_state *at, double *g)
{
    const drape_model *m = drape_system_model(system);
    const drape_point point = {.x = at->x, .v = at->v, .internal = at->internal, .full = true};
    memset(g, 0, 3 * (size_t)m->node_count * sizeof *g);
    for (int32_t i = 0; i < m->term_count; i++)
        drape_system_term(system, i, &point, NULL, g, NULL);
}

static drape_status measure_start(drape_system *system, start *out)
{
    const drape_model *m = drape_system_model(system);
    const size_t n = 3 * (size_t)m->node_count;
    drape_arena arena = drape_arena_of(m->ctx);
    drape_state state;
    double *g = drape_arena_take(&arena, n, sizeof *g), *shifted = drape_arena_take(&arena, n, sizeof *g);
    drape_status status = drape_state_create(&arena, m, &state);
    if (!status)
        status = drape_arena_status(&arena);
    status = drape_ranks_agree(drape_model_ranks(m), m->ctx, status);
    *out = (start){0};
    if (!status) {
        add_terms(system, &state, g);
        drape_step_equation_shift(state.x, n);
        drape_step_equation_shift(state.v, n);
        add_terms(system, &state, shifted);
        for (int32_t f = 0; f < m->free_count; f++) {
            const size_t at = 3 * (size_t)m->node_of_free[f];
            out->load += vec3_norm(g + at);
            for (size_t k = at; k < at + 3; k++)
                out->rounding = fmax(out->rounding, DRAPE_ROUNDINGS * fabs(shifted[k] - g[k]));
        }
        out->load = drape_ranks_sum(drape_model_ranks(m), out->load);
        out->rounding = drape_ranks_largest(drape_model_ranks(m), out->rounding);
    }
    drape_arena_free(&arena);
    return status;
}

/* ---- The load of a node ---- */

static double least_bending(const drape_model *m)
{
    double least = INFINITY;
    for (int32_t c = 0; c < m->cloth_count; c++) {
        const drape_material *s = &m->cloths[c].material;
        double d = isnan(s->bending_warp) ? s->flexural_rigidity : fmin(s->bending_warp, s->bending_weft);
        if (d > 0)
            least = fmin(least, d / (s->areal_density * m->length * m->length * m->length));
    }
    return least;
}

/* The gravity that is felt; where it has a history, the least of it that is not 0. */
static double least_gravity(const drape_model *m)
{
    double factor = 1;
    for (int32_t i = 0; i < m->term_count; i++)
        if (m->terms[i].ops->from_scene_gravity && m->terms[i].history)
            factor = drape_history_least(m->terms[i].history);
    return factor * vec3_norm(m->gravity);
}

static double acceleration_of(const drape_model *m, const start *at, double mass)
{
    const double gravity = least_gravity(m);
    if (gravity > 0)
        return gravity;
    double a = fmin(m->length, least_bending(m)); /* over (1 s)^2 */
    /* else the largest bound that a load allows is below the rounding error of the forces */
    if (DRAPE_MAX_LOAD_SHARE * at->load > at->rounding * drape_model_all_free(m))
        a = fmin(a, at->load / mass);
    return a;
}

/* ---- Bounds ---- */

/* What a bound on each component is in a norm over n of them, if all are at the bound. */
static double in_norm(double component, drape_norm norm, double n)
{
    return norm == DRAPE_NORM_L1 ? component * n : norm == DRAPE_NORM_L2 ? component * sqrt(n) : component;
}

double drape_residual_component(double bound, drape_norm norm, double n)
{
    return norm == DRAPE_NORM_L1 ? bound / n : norm == DRAPE_NORM_L2 ? bound / sqrt(n) : bound;
}

/* given: of a component; NAN: none */
static double bound_of(double load, double given, double rounding)
{
    double wanted = isnan(given) ? fmax(DRAPE_LOAD_SHARE * load, rounding) : given;
    return fmin(wanted, DRAPE_MAX_LOAD_SHARE * load);
}

drape_status drape_residual_bound_set(drape_step_equation *e, drape_norm norm, double given,
                                      double *tolerance)
{
    const drape_model *m = e->model;
    const double component = drape_residual_component(given, norm, e->all_dofs);
    double mass = 0;
    start at;
    *tolerance = given;
    if (e->dofs == 0)
        return DRAPE_OK;
    drape_status status = measure_start(e->system, &at);
    if (status)
        return status;
    for (int32_t f = 0; f < m->free_count; f++)
        mass += m->mass[m->node_of_free[f]];
    mass = drape_ranks_sum(e->ranks, mass);
    const double a = acceleration_of(m, &at, mass);
    const double mean = bound_of(a * mass / drape_model_all_free(m), component, at.rounding);
    double limit = INFINITY;
    for (int32_t f = 0; f < m->free_count; f++) {
        const double load = a * m->mass[m->node_of_free[f]];
        e->weight[f] = mean / bound_of(load, component, at.rounding);
        limit = fmin(limit, e->weight[f] * DRAPE_MAX_LOAD_SHARE * load);
    }
    limit = drape_ranks_least(e->ranks, limit);
    if (least_gravity(m) > 0) /* else the load is a guess, which the forces may exceed by far */
        e->max_residual = in_norm(limit, norm, e->all_dofs);
    if (mean != component)
        *tolerance = in_norm(mean, norm, e->all_dofs);
    return DRAPE_OK;
}
