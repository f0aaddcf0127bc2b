/* approx_jacobian_build.c: the parts of the approximate Jacobian that do not change with the state: pairs,
 * scalar stiffness, the coarse space, and what each pair adds to the matrix there. */
#include "nonlinear/approx_jacobian_parts.h"

#include <string.h>

/* ---- Pairs ---- */

static drape_status list_pairs(drape_approx_jacobian *s)
{
    const drape_model *m = s->model;
    for (int32_t t = 0; t < m->term_count; t++)
        s->pairs += m->terms[t].ops->pair ? m->terms[t].elements.count : 0;
    s->pair = drape_arena_take(s->arena, 2 * (size_t)s->pairs, sizeof *s->pair);
    s->h = drape_arena_take(s->arena, 6 * (size_t)s->pairs, sizeof *s->h);
    if (drape_arena_status(s->arena))
        return DRAPE_E_MEMORY;
    int32_t *to = s->pair;
    for (int32_t t = 0; t < m->term_count; t++) {
        const drape_term *term = &m->terms[t];
        int32_t ends = term->ops->pair ? 2 * term->elements.count : 0;
        for (int32_t i = 0; i < ends; i++)
            *to++ = m->free_of_node[term->elements.node[i]];
    }
    return DRAPE_OK;
}

/* ---- The coarse space ---- */

/* One of two passes over the edges of the mesh between free nodes: the first counts the neighbours of each
 * node in start[node + 2]; the second lists them from start[node + 1] on, which it advances to where the
 * list of the next node begins. */
static void pass_edges(const drape_model *m, int32_t *start, int32_t *neighbor)
{
    for (int32_t e = 0; e < m->edge_count; e++) {
        int32_t a = m->free_of_node[m->edge[2 * (size_t)e]], b = m->free_of_node[m->edge[2 * (size_t)e + 1]];
        if (a < 0 || b < 0)
            continue;
        if (neighbor) {
            neighbor[start[a + 1]++] = b;
            neighbor[start[b + 1]++] = a;
        } else {
            start[a + 2]++;
            start[b + 2]++;
        }
    }
}

static drape_status build_prolong(drape_approx_jacobian *s, drape_arena *scratch)
{
    const drape_model *m = s->model;
    int32_t *start = drape_arena_take(scratch, (size_t)s->nodes + 2, sizeof *start);
    int32_t *neighbor = drape_arena_take(scratch, 2 * (size_t)m->edge_count, sizeof *neighbor);
    if (drape_arena_status(scratch))
        return DRAPE_E_MEMORY;
    pass_edges(m, start, NULL);
    for (int32_t i = 1; i < s->nodes; i++)
        start[i + 1] += start[i];
    pass_edges(m, start, neighbor);
    const drape_graph graph = {.count = s->nodes, .start = start, .neighbor = neighbor};
    return drape_prolong_build(s->arena, &graph, drape_prolong_spacing(s->nodes), &s->coarse.prolong);
}

/* Couples the coarse functions that overlap on the model's pattern, in pairs. */
static drape_status build_coarse_pattern(drape_approx_jacobian *s, drape_arena *scratch)
{
    coarse_matrix *c = &s->coarse;
    const drape_pattern *p = &s->model->pattern;
    const drape_graph fine = {.count = p->block_count, .start = p->block_start, .neighbor = p->block_row};
    int32_t *start, *neighbor, count = 0;
    drape_status status = drape_prolong_meet(scratch, &c->prolong, &fine, &start, &neighbor);
    if (status)
        return status;
    int32_t *pairs = drape_arena_take(scratch, 2 * (size_t)start[c->prolong.coarse], sizeof *pairs);
    int32_t *own = drape_arena_take(scratch, (size_t)c->prolong.coarse, sizeof *own);
    if (drape_arena_status(scratch))
        return DRAPE_E_MEMORY;
    for (int32_t a = 0; a < c->prolong.coarse; a++) {
        own[a] = a;
        for (int32_t k = start[a]; k < start[a + 1]; k++)
            if (neighbor[k] < a) {
                pairs[2 * (size_t)count] = a;
                pairs[2 * (size_t)count++ + 1] = neighbor[k];
            }
    }
    const drape_coupling coupling = {.count = count, .nodes = 2, .node = pairs};
    return drape_pattern_build(s->arena, c->prolong.coarse, own, &coupling, 1, &c->pattern);
}

/* The scalar stiffness on the coarse space: P' C P. */
static drape_status build_coarse_scalars(drape_approx_jacobian *s)
{
    coarse_matrix *c = &s->coarse;
    const drape_prolong *p = &c->prolong;
    const drape_scalar_stiffness *f = &s->scalar;
    size_t slots = (size_t)c->pattern.block_start[c->pattern.block_count];
    c->elastic = drape_arena_take(s->arena, slots, sizeof *c->elastic);
    c->damping = drape_arena_take(s->arena, slots, sizeof *c->damping);
    c->mass = drape_arena_take(s->arena, slots, sizeof *c->mass);
    if (drape_arena_status(s->arena))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < s->nodes; i++)
        for (int32_t k = f->start[i]; k < f->start[i + 1]; k++)
            for (int32_t a = p->start[i]; a < p->start[i + 1]; a++)
                for (int32_t b = p->start[f->column[k]]; b < p->start[f->column[k] + 1]; b++) {
                    int32_t slot = drape_pattern_find(&c->pattern, p->column[a], p->column[b]);
                    double w = p->weight[a] * p->weight[b];
                    c->elastic[slot] += w * f->elastic[k];
                    if (f->damping)
                        c->damping[slot] += w * f->damping[k];
                    if (k == f->diagonal[i])
                        c->mass[slot] += w * s->model->mass[s->model->node_of_free[i]];
                }
    return DRAPE_OK;
}

/* The differences of coarse functions between the nodes of a pair; returns the number of functions. */
#define MAX_FUNCTIONS (2 * DRAPE_PROLONG_FUNCTIONS)
static int differences(const drape_approx_jacobian *s, int32_t pair, int32_t column[MAX_FUNCTIONS],
                       double difference[MAX_FUNCTIONS])
{
    const drape_prolong *p = &s->coarse.prolong;
    int count = 0;
    for (int end = 0; end < 2; end++) {
        int32_t node = s->pair[2 * (size_t)pair + (size_t)end];
        if (node < 0)
            continue;
        for (int32_t k = p->start[node]; k < p->start[node + 1]; k++) {
            int i = 0;
            while (i < count && column[i] != p->column[k])
                i++;
            if (i == count) {
                column[count] = p->column[k];
                difference[count++] = 0;
            }
            difference[i] += end ? -p->weight[k] : p->weight[k];
        }
    }
    return count;
}

/* Adds the entries of one pair to the coarse matrix, from entry `at` of the list on; returns the next entry.
 * Without store it only counts the entries. */
static int64_t add_pair(drape_approx_jacobian *s, int32_t pair, int64_t at, bool store)
{
    coarse_matrix *c = &s->coarse;
    int32_t column[MAX_FUNCTIONS];
    double difference[MAX_FUNCTIONS];
    int count = differences(s, pair, column, difference);
    for (int a = 0; a < count; a++)
        for (int b = 0; b < count; b++) {
            double w = difference[a] * difference[b];
            if (column[a] < column[b] || w == 0)
                continue;
            if (store) {
                c->slot[at] = drape_pattern_find(&c->pattern, column[a], column[b]);
                c->weight[at] = w;
            }
            at++;
        }
    return at;
}

static drape_status build_coarse_pairs(drape_approx_jacobian *s)
{
    coarse_matrix *c = &s->coarse;
    c->pair_start = drape_arena_take(s->arena, (size_t)s->pairs + 1, sizeof *c->pair_start);
    if (drape_arena_status(s->arena))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < s->pairs; i++)
        c->pair_start[i + 1] = add_pair(s, i, c->pair_start[i], false);
    size_t total = (size_t)c->pair_start[s->pairs];
    c->slot = drape_arena_take(s->arena, total, sizeof *c->slot);
    c->weight = drape_arena_take(s->arena, total, sizeof *c->weight);
    if (drape_arena_status(s->arena))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < s->pairs; i++)
        add_pair(s, i, c->pair_start[i], true);
    return DRAPE_OK;
}

static drape_status build_coarse(drape_approx_jacobian *s)
{
    coarse_matrix *c = &s->coarse;
    drape_arena scratch = drape_arena_of(s->arena->ctx);
    drape_status status = build_prolong(s, &scratch);
    if (!status)
        status = build_coarse_pattern(s, &scratch);
    drape_arena_free(&scratch);
    if (!status)
        status = build_coarse_scalars(s);
    if (!status)
        status = build_coarse_pairs(s);
    if (status)
        return status;
    size_t slots = (size_t)c->pattern.block_start[c->pattern.block_count], n = (size_t)c->pattern.n;
    c->sum = drape_arena_take(s->arena, 6 * slots, sizeof *c->sum);
    c->values = drape_arena_take(s->arena, (size_t)c->pattern.nonzeros, sizeof *c->values);
    c->b = drape_arena_take(s->arena, n, sizeof *c->b);
    c->x = drape_arena_take(s->arena, n, sizeof *c->x);
    c->linear = drape_linear_best(c->pattern.n);
    status = drape_arena_status(s->arena);
    return status ? status : c->linear->create(s->arena, &c->pattern, &c->solver);
}

/* ---- The remainder ---- */

drape_status drape_approx_jacobian_extend(drape_approx_jacobian *s)
{
    const drape_pattern *p = drape_system_pattern(s->system);
    remainder_matrix *r = &s->remainder;
    drape_arena_free(&r->arena);
    r->values = NULL;
    r->count = 0;
    r->version = drape_system_pattern_version(s->system);
    if (!drape_system_has_remainder(s->system))
        return DRAPE_OK;
    size_t lower = ((size_t)p->block_start[p->block_count] + (size_t)p->block_count) / 2;
    r->values = drape_arena_take(&r->arena, (size_t)p->nonzeros, sizeof *r->values);
    r->row = drape_arena_take(&r->arena, lower, sizeof *r->row);
    r->column = drape_arena_take(&r->arena, lower, sizeof *r->column);
    r->block = drape_arena_take(&r->arena, 9 * lower, sizeof *r->block);
    return drape_arena_status(&r->arena);
}

drape_status drape_approx_jacobian_build(drape_approx_jacobian *s)
{
    drape_status status = list_pairs(s);
    if (!status) {
        /* Of all measures that are not of pairs. */
        drape_arena scratch = drape_arena_of(s->arena->ctx);
        bool *of = drape_arena_take(&scratch, (size_t)s->model->term_count, sizeof *of);
        status = drape_arena_status(&scratch);
        for (int32_t t = 0; !status && t < s->model->term_count; t++)
            of[t] = s->model->terms[t].ops->measure && !s->model->terms[t].ops->pair;
        if (!status)
            status = drape_scalar_stiffness_build(s->arena, s->system, of, &s->scalar);
        drape_arena_free(&scratch);
    }
    if (!status)
        status = build_coarse(s);
    return status ? status : drape_approx_jacobian_extend(s);
}
