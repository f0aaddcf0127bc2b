/* quasi_build.c: what of quasi.h does not change with the state: pairs, the constant scalar part, the coarse space
 * and what each pair adds to its matrix. */
#include "integrators/quasi_parts.h"

#include <string.h>

/* ---- Pairs ---- */

static bool is_pairs(const drape_term *term)
{
    return term->ops->pair != NULL;
}

static drape_status list_pairs(drape_quasi *s)
{
    const drape_model *m = s->model;
    for (int32_t t = 0; t < m->term_count; t++)
        s->pairs += is_pairs(&m->terms[t]) ? m->terms[t].elements.count : 0;
    s->pair = drape_alloc(s->ctx, 2 * (size_t)s->pairs, sizeof *s->pair);
    s->h = drape_alloc(s->ctx, 6 * (size_t)s->pairs, sizeof *s->h);
    if (!s->pair || !s->h)
        return DRAPE_E_MEMORY;
    int32_t *to = s->pair;
    for (int32_t t = 0; t < m->term_count; t++)
        for (int32_t i = 0; is_pairs(&m->terms[t]) && i < 2 * m->terms[t].elements.count; i++)
            *to++ = m->free_of_node[m->terms[t].elements.node[i]];
    return DRAPE_OK;
}

/* ---- The coarse space ---- */

/* The free nodes and the edges of the mesh between them. */
static drape_status list_edges(drape_quasi *s, int32_t **start, int32_t **neighbor)
{
    const drape_model *m = s->model;
    *start = drape_alloc(s->ctx, (size_t)s->nodes + 2, sizeof **start);
    *neighbor = drape_alloc(s->ctx, 2 * (size_t)m->edge_count, sizeof **neighbor);
    if (!*start || !*neighbor)
        return DRAPE_E_MEMORY;
    for (int fill = 0; fill < 2; fill++) {
        for (int32_t e = 0; e < m->edge_count; e++) {
            int32_t a = m->free_of_node[m->edge[2 * (size_t)e]],
                    b = m->free_of_node[m->edge[2 * (size_t)e + 1]];
            if (a < 0 || b < 0)
                continue;
            if (fill) {
                (*neighbor)[(*start)[a + 1]++] = b;
                (*neighbor)[(*start)[b + 1]++] = a;
            } else {
                (*start)[a + 2]++;
                (*start)[b + 2]++;
            }
        }
        for (int32_t i = 1; !fill && i < s->nodes; i++)
            (*start)[i + 1] += (*start)[i];
    }
    return DRAPE_OK;
}

static drape_status build_prolong(drape_quasi *s, int spacing)
{
    int32_t *start = NULL, *neighbor = NULL;
    drape_status status = list_edges(s, &start, &neighbor);
    const drape_graph graph = {.count = s->nodes, .start = start, .neighbor = neighbor};
    if (!status)
        status = drape_prolong_build(s->arena, &graph, spacing ? spacing : drape_prolong_spacing(s->nodes),
                                     &s->coarse.prolong);
    drape_free(s->ctx, start);
    drape_free(s->ctx, neighbor);
    return status;
}

/* Coarse functions that meet as pairs. */
static drape_status build_coarse_pattern(drape_quasi *s)
{
    drape_quasi_coarse *c = &s->coarse;
    const drape_pattern *p = &s->model->pattern;
    const drape_graph fine = {.count = p->block_count, .start = p->block_start, .neighbor = p->block_row};
    int32_t *start = NULL, *neighbor = NULL, *pairs = NULL, *own = NULL, count = 0;
    drape_arena scratch = drape_arena_of(s->ctx);
    drape_status status = drape_prolong_meet(&scratch, &c->prolong, &fine, &start, &neighbor);
    if (!status) {
        pairs = drape_alloc(s->ctx, 2 * (size_t)start[c->prolong.coarse], sizeof *pairs);
        own = drape_alloc(s->ctx, (size_t)c->prolong.coarse, sizeof *own);
        status = pairs && own ? DRAPE_OK : DRAPE_E_MEMORY;
    }
    for (int32_t a = 0; !status && a < c->prolong.coarse; a++) {
        own[a] = a;
        for (int32_t k = start[a]; k < start[a + 1]; k++)
            if (neighbor[k] < a) {
                pairs[2 * (size_t)count] = a;
                pairs[2 * (size_t)count++ + 1] = neighbor[k];
            }
    }
    const drape_coupling coupling = {.count = count, .nodes = 2, .node = pairs};
    if (!status)
        status = drape_pattern_build(s->arena, c->prolong.coarse, own, &coupling, 1, &c->pattern);
    drape_arena_free(&scratch);
    drape_free(s->ctx, pairs);
    drape_free(s->ctx, own);
    return status;
}

/* The scalar part on the coarse space: P' C P. */
static drape_status build_coarse_scalars(drape_quasi *s)
{
    drape_quasi_coarse *c = &s->coarse;
    const drape_prolong *p = &c->prolong;
    const drape_scalar *f = &s->scalar;
    size_t slots = (size_t)c->pattern.block_start[c->pattern.block_count];
    c->elastic = drape_alloc(s->ctx, slots, sizeof *c->elastic);
    c->damping = drape_alloc(s->ctx, slots, sizeof *c->damping);
    c->mass = drape_alloc(s->ctx, slots, sizeof *c->mass);
    if (!c->elastic || !c->damping || !c->mass)
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

/* The coarse functions' differences along one pair; returns how many are not zero. */
#define MOST_ALONG 64
static int differences(const drape_quasi *s, int32_t pair, int32_t column[MOST_ALONG],
                       double difference[MOST_ALONG])
{
    const drape_prolong *p = &s->coarse.prolong;
    int count = 0;
    for (int end = 0; end < 2; end++) {
        int32_t node = s->pair[2 * (size_t)pair + (size_t)end];
        for (int32_t k = node < 0 ? 0 : p->start[node]; node >= 0 && k < p->start[node + 1]; k++) {
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

/* What one pair adds: to NULL, only counts. */
static int64_t add_pair(drape_quasi *s, int32_t pair, int64_t at, bool store)
{
    drape_quasi_coarse *c = &s->coarse;
    int32_t column[MOST_ALONG];
    double difference[MOST_ALONG];
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

static drape_status build_coarse_pairs(drape_quasi *s)
{
    drape_quasi_coarse *c = &s->coarse;
    c->pair_start = drape_alloc(s->ctx, (size_t)s->pairs + 1, sizeof *c->pair_start);
    if (!c->pair_start)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < s->pairs; i++)
        c->pair_start[i + 1] = add_pair(s, i, c->pair_start[i], false);
    size_t total = (size_t)c->pair_start[s->pairs];
    c->slot = drape_alloc(s->ctx, total, sizeof *c->slot);
    c->weight = drape_alloc(s->ctx, total, sizeof *c->weight);
    if (!c->slot || !c->weight)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < s->pairs; i++)
        add_pair(s, i, c->pair_start[i], true);
    return DRAPE_OK;
}

static drape_status build_coarse(drape_quasi *s, int spacing)
{
    drape_quasi_coarse *c = &s->coarse;
    drape_status status = build_prolong(s, spacing);
    if (!status)
        status = build_coarse_pattern(s);
    if (!status)
        status = build_coarse_scalars(s);
    if (!status)
        status = build_coarse_pairs(s);
    if (status)
        return status;
    size_t slots = (size_t)c->pattern.block_start[c->pattern.block_count], n = (size_t)c->pattern.n;
    c->sum = drape_alloc(s->ctx, 6 * slots, sizeof *c->sum);
    c->values = drape_alloc(s->ctx, (size_t)c->pattern.nonzeros, sizeof *c->values);
    c->b = drape_alloc(s->ctx, n, sizeof *c->b);
    c->x = drape_alloc(s->ctx, n, sizeof *c->x);
    c->row = drape_linear_best(c->pattern.n);
    return c->sum && c->values && c->b && c->x ? c->row->create(s->arena, &c->pattern, &c->solver)
                                               : DRAPE_E_MEMORY;
}

/* ---- The remainder ---- */

void drape_quasi_free_room(drape_quasi *s)
{
    drape_quasi_remainder *r = &s->remainder;
    drape_free(s->ctx, r->values);
    drape_free(s->ctx, r->row);
    drape_free(s->ctx, r->column);
    drape_free(s->ctx, r->block);
    *r = (drape_quasi_remainder){0};
}

drape_status drape_quasi_make_room(drape_quasi *s)
{
    const drape_pattern *p = drape_system_pattern(s->system);
    drape_quasi_remainder *r = &s->remainder;
    drape_quasi_free_room(s);
    if (!drape_system_has_remainder(s->system))
        return DRAPE_OK;
    size_t lower = ((size_t)p->block_start[p->block_count] + (size_t)p->block_count) / 2;
    r->values = drape_alloc(s->ctx, (size_t)p->nonzeros, sizeof *r->values);
    r->row = drape_alloc(s->ctx, lower, sizeof *r->row);
    r->column = drape_alloc(s->ctx, lower, sizeof *r->column);
    r->block = drape_alloc(s->ctx, 9 * lower, sizeof *r->block);
    return r->values && r->row && r->column && r->block ? DRAPE_OK : DRAPE_E_MEMORY;
}

drape_status drape_quasi_build(drape_quasi *s, int spacing)
{
    drape_status status = list_pairs(s);
    if (!status)
        status = drape_scalar_build(s->ctx, s->system, false, &s->scalar);
    if (!status)
        status = build_coarse(s, spacing);
    return status ? status : drape_quasi_make_room(s);
}
