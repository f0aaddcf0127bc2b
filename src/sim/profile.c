/* profile.c: see profile.h. */
#include "sim/profile.h"

#include "base/clock.h"
#include "mesh/grid.h"
#include "solvers/linear.h"

#include <math.h>
#include <string.h>

#define BUDGET      0.02 /* [s] for the repetitions of one measurement */
#define MAX_REPEATS 200
/* Displacement of the nodes, as a share of the scene's mean edge. Edges shortened by 1e-3 would make the
 * matrix of a common scene indefinite, which is rare in a step and is handled by other code in the
 * solvers. */
#define DEFORMATION 1e-5

/* The point at which everything is evaluated, and memory for the results. */
typedef struct bench {
    drape_context *ctx;
    const drape_sim *sim;
    drape_arena arena;
    double *x, *v, *g; /* (node_count x 3) */
    double *history;   /* (measure_count); NULL if no law needs rates */
    const drape_pattern *pattern;
    double *values; /* of the Jacobian, in the pattern */
    double *b, *d;  /* (free DOFs) */
    drape_point point;
    double mass_weight;
    int32_t term; /* the one that is measured */
    const drape_linear_ops *linear;
    void *solver;
    drape_status status; /* of the last factor or solve */
} bench;

/* ---- The state ---- */

/* Evaluates as in a step of size dt from the state of the sim. */
static void set_point(bench *s, double dt)
{
    const drape_state *from = drape_sim_state(s->sim);
    const drape_model *model = s->sim->model;
    double shift = DEFORMATION * drape_model_mean_edge(model);
    uint64_t seed = 1;
    for (size_t i = 0; i < 3 * (size_t)model->node_count; i++) {
        double d = model->pinned[i / 3] ? 0 : shift * drape_grid_random(&seed);
        s->x[i] = from->x[i] + d;
        s->v[i] = from->v[i] + d / dt;
    }
    for (int64_t i = 0; i < 3 * (int64_t)model->free_count; i++)
        s->b[i] = drape_grid_random(&seed);
    if (s->history) {
        drape_system_measures(s->sim->system,
                              &(drape_point){.x = from->x, .internal = from->internal, .t = from->t},
                              s->history);
        for (int64_t i = 0; i < s->sim->model->measure_count; i++)
            s->history[i] /= -dt;
    }
    s->mass_weight = 1 / (dt * dt);
    s->point = (drape_point){.x = s->x,
                             .v = s->v,
                             .internal = from->internal,
                             .weight = 1 / dt,
                             .history = s->history,
                             .t = from->t};
}

static drape_status create(bench *s)
{
    const drape_model *model = s->sim->model;
    size_t nodes = 3 * (size_t)model->node_count, dofs = 3 * (size_t)model->free_count;
    s->x = drape_arena_take(&s->arena, nodes, sizeof *s->x);
    s->v = drape_arena_take(&s->arena, nodes, sizeof *s->v);
    s->g = drape_arena_take(&s->arena, nodes, sizeof *s->g);
    s->b = drape_arena_take(&s->arena, dofs, sizeof *s->b);
    s->d = drape_arena_take(&s->arena, dofs, sizeof *s->d);
    if (model->has_laws)
        s->history = drape_arena_take(&s->arena, (size_t)model->measure_count, sizeof *s->history);
    return drape_arena_status(&s->arena);
}

/* Takes the values of a matrix that has all pairs in contact at the point, of which a scene may begin with
 * some. */
static drape_status create_values(bench *s)
{
    bool changed;
    const drape_status status = drape_system_extend_pattern(s->sim->system, &s->point, &changed);
    if (status)
        return status;
    s->pattern = drape_system_pattern(s->sim->system);
    s->values = drape_arena_take(&s->arena, (size_t)s->pattern->nonzeros, sizeof *s->values);
    return drape_arena_status(&s->arena);
}

/* ---- Measurement ---- */

static void term_residual(bench *s)
{
    drape_system_term(s->sim->system, s->term, &s->point, NULL, s->g, NULL);
}

static void term_jacobian(bench *s)
{
    drape_system_term(s->sim->system, s->term, &s->point, NULL, NULL, s->values);
}

static void whole_residual(bench *s)
{
    drape_system_force(s->sim->system, &s->point, s->g);
}

static void whole_jacobian(bench *s)
{
    drape_system_jacobian(s->sim->system, &s->point, s->mass_weight, 0, s->values);
}

static void factor(bench *s)
{
    s->status = s->linear->factor(s->solver, s->values);
}

static void solve(bench *s)
{
    s->status = s->linear->solve(s->solver, s->b, s->d);
}

/* The shortest time of a call. The first call, which warms the caches, counts only if it is the only one. */
static double shortest(bench *s, void (*call)(bench *s))
{
    double begin = drape_clock_seconds(), best = INFINITY, now = begin;
    for (int i = 0; i < MAX_REPEATS && (i == 0 || now - begin < BUDGET); i++) {
        double start = drape_clock_seconds();
        call(s);
        now = drape_clock_seconds();
        best = fmin(best, now - start);
    }
    return best;
}

/* ---- Terms ---- */

/* The entries of the Jacobian that a term couples. seen: one mark for each block of the pattern. */
static int64_t count_nonzeros(const drape_term *term, unsigned char *seen, size_t blocks)
{
    int64_t count = 0;
    memset(seen, 0, blocks);
    for (size_t i = 0; term->block && i < drape_term_places(term); i++) {
        int32_t block = term->block[i];
        if (block >= 0 && !seen[block]) {
            seen[block] = 1;
            count += 9;
        }
    }
    return count;
}

static size_t term_bytes(const drape_term *term)
{
    const drape_elements *el = &term->elements;
    const drape_parts *p = el->parts;
    size_t bytes = (size_t)el->count *
                       ((size_t)el->nodes * sizeof *el->node + (size_t)el->rest_count * sizeof *el->rest) +
                   (size_t)el->shared_count * sizeof *el->shared;
    if (p)
        bytes += (size_t)p->count *
                     ((size_t)p->nodes * sizeof *p->node + (size_t)p->rest_count * sizeof *p->rest) +
                 (size_t)p->link_count * (3 * sizeof *p->part + sizeof *p->weight + (size_t)p->nodes) +
                 (size_t)(term->patches.count + el->count) * (size_t)el->nodes * sizeof *term->patches.node;
    if (term->block)
        bytes += drape_term_places(term) * sizeof *term->block;
    bytes += 4 * (size_t)drape_term_slider_count(term) * sizeof(double); /* in both states, too */
    bytes += 2 * (size_t)drape_term_branch_numbers(term) * sizeof(double);
    if (term->first_internal >= 0)
        bytes += 2 * (size_t)drape_term_internals(term) * sizeof(double); /* in both states */
    return bytes;
}

static drape_status measure_terms(bench *s, bool implicit, drape_profile_term *terms)
{
    const drape_model *model = s->sim->model;
    size_t blocks = (size_t)model->pattern.block_start[model->pattern.block_count];
    unsigned char *seen = drape_arena_take(&s->arena, blocks, 1);
    if (!seen)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < model->term_count; i++) {
        s->term = i;
        drape_status status = drape_check_cancel(s->ctx);
        if (status)
            return status;
        const drape_term *term = &model->terms[i];
        drape_profile_term *p = &terms[i];
        *p = (drape_profile_term){.nonzeros = count_nonzeros(term, seen, blocks), .bytes = term_bytes(term)};
        if (term->ops->law) {
            for (const drape_term *t = model->terms; t < model->terms + model->term_count; t++)
                if (t->cloth == term->cloth && t->seam < 0 && t->ops->measure)
                    p->acts_on += t->elements.count;
        } else
            p->residual_seconds = shortest(s, term_residual);
        if (implicit && term->block)
            p->jacobian_seconds = shortest(s, term_jacobian);
    }
    return DRAPE_OK;
}

/* ---- The whole step ---- */

/* Counts all memory of the model and the sim, by parts that add up to the whole. */
static void count_bytes(const drape_sim *sim, drape_profile *out)
{
    const drape_model *model = sim->model;
    for (int32_t c = 0; c < model->cloth_count; c++)
        out->mesh_bytes += model->cloths[c].mesh.arena.bytes;
    out->pattern_bytes = model->pattern_bytes;
    out->model_bytes = sizeof *model + model->arena.bytes - model->pattern_bytes;
    out->state_bytes = sim->state_bytes;
    out->integrator_bytes = sim->integrator_bytes;
    if (sim->chosen.integrator->bytes)
        out->integrator_bytes += sim->chosen.integrator->bytes(sim->integrator);
    out->system_bytes =
        sizeof *sim + sizeof *sim->arena + sim->arena->bytes - sim->state_bytes - sim->integrator_bytes;
}

/* The integrator's solver has no factors before the first step: a solver with the same pattern measures
 * what they will take. */
static drape_status measure_solver(bench *s, drape_profile *out)
{
    drape_status status = s->linear->create(&s->arena, s->pattern, &s->solver);
    if (status)
        return status;
    size_t before = s->arena.bytes + drape_linear_bytes(s->linear, s->solver);
    out->factor_seconds = shortest(s, factor);
    out->factor_status = s->status;
    if (!s->status) {
        out->integrator_bytes += s->arena.bytes + drape_linear_bytes(s->linear, s->solver) - before;
        out->solve_seconds = shortest(s, solve);
    }
    drape_linear_report report = {0};
    if (s->linear->report)
        s->linear->report(s->solver, &report);
    out->linear_fallback = report.fallback ? report.fallback->entry.name : "";
    drape_linear_destroy(s->linear, &s->solver);
    return DRAPE_OK;
}

static drape_status measure(bench *s, drape_profile *out)
{
    drape_status status = create(s);
    if (status)
        return status;
    set_point(s, out->dt);
    if (out->implicit)
        status = create_values(s);
    if (status)
        return status;
    status = measure_terms(s, out->implicit, out->terms);
    if (status)
        return status;
    out->residual_seconds = shortest(s, whole_residual);
    if (!out->implicit)
        return DRAPE_OK;
    out->jacobian_seconds = shortest(s, whole_jacobian);
    status = drape_check_cancel(s->ctx);
    if (status)
        return status;
    return s->sim->model->free_count > 0 ? measure_solver(s, out) : DRAPE_OK;
}

drape_status drape_profile_measure(drape_context *ctx, const drape_sim *sim, drape_profile_term *terms,
                                   drape_profile *out)
{
    const double linear = drape_chosen_integrator_value(&sim->chosen, "linear_solver", -1);
    const drape_linear_ops *entry = linear >= 0 ? drape_linears[(int)linear] : NULL;
    const int64_t n = 3 * (int64_t)sim->model->free_count;
    bench s = {.ctx = ctx,
               .arena = drape_arena_of(ctx),
               .sim = sim,
               .linear = entry && n > 0 ? drape_linear_of(NULL, (int)linear, n) : entry};
    *out = (drape_profile){.terms = terms,
                           .implicit = s.linear != NULL,
                           .linear_solver = entry ? entry->entry.name : "",
                           .linear_picked = s.linear ? s.linear->entry.name : "",
                           .linear_fallback = "",
                           .dt = drape_chosen_integrator_value(&sim->chosen, "dt", 1.0 / 60)};
    if (entry && entry->pick && n > 0)
        drape_linear_explain(n, out->linear_why);
    count_bytes(sim, out);
    drape_status status = measure(&s, out);
    drape_arena_free(&s.arena);
    return status;
}

double drape_profile_seconds(const drape_profile *p)
{
    return p->residual_seconds + p->jacobian_seconds + p->factor_seconds + p->solve_seconds;
}

size_t drape_profile_bytes(const drape_profile *p)
{
    return p->model_bytes + p->mesh_bytes + p->pattern_bytes + p->system_bytes + p->integrator_bytes +
           p->state_bytes;
}
