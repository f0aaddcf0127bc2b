/*
 * verlet_limit.c: the limit of strains as CS184 and Provot (1995) have it: one spring after the other, one
 * that is longer than it may be gets its longest length, by half at each end, or all of it at the end that is
 * free. A pass moves springs that it has already dealt with, so that after one the limit is not met: CS184
 * leaves it at that. Passes are repeated until no spring is longer than the slack allows, or there were
 * enough of them.
 *
 * All springs take part, of any stiffness, in the order in which CS184 makes them: by their later node.
 */
#include "base/vec3.h"
#include "integrators/verlet.h"

#include <string.h>

static bool is_spring(const drape_term *term)
{
    return term->ops->measure && term->elements.nodes == 2;
}

static int32_t later(const int32_t *node)
{
    return node[0] > node[1] ? node[0] : node[1];
}

/* Numbers of the springs of each node that is the later of a pair, as starts of a list. */
static void count_springs(const drape_model *m, int32_t *start)
{
    for (int32_t i = 0; i < m->term_count; i++) {
        const drape_elements *el = &m->terms[i].elements;
        for (int32_t e = 0; is_spring(&m->terms[i]) && e < el->count; e++)
            start[later(el->node + 2 * (size_t)e) + 1]++;
    }
    for (int32_t i = 0; i < m->node_count; i++)
        start[i + 1] += start[i];
}

static double rest_length(const drape_model *m, const int32_t *node)
{
    double d[3];
    vec3_sub(m->rest + 3 * (size_t)node[1], m->rest + 3 * (size_t)node[0], d);
    return vec3_norm(d);
}

static void place_springs(const drape_model *m, double limit, int32_t *start, drape_verlet_limit *out)
{
    for (int32_t i = 0; i < m->term_count; i++) {
        const drape_elements *el = &m->terms[i].elements;
        for (int32_t e = 0; is_spring(&m->terms[i]) && e < el->count; e++) {
            const int32_t *node = el->node + 2 * (size_t)e;
            size_t at = (size_t)start[later(node)]++;
            memcpy(out->node + 2 * at, node, 2 * sizeof *node);
            out->longest[at] = (1 + limit) * rest_length(m, node);
        }
    }
}

drape_status drape_verlet_limit_create(drape_context *ctx, const drape_model *m, double limit, int passes,
                                       double tolerance, drape_verlet_limit *out)
{
    int32_t *start = drape_alloc(ctx, (size_t)m->node_count + 1, sizeof *start);
    *out = (drape_verlet_limit){.pinned = m->pinned, .passes = passes, .slack = 1 + tolerance};
    if (!start)
        return DRAPE_E_MEMORY;
    count_springs(m, start);
    out->count = start[m->node_count];
    out->node = drape_alloc(ctx, 2 * (size_t)out->count, sizeof *out->node);
    out->longest = drape_alloc(ctx, (size_t)out->count, sizeof *out->longest);
    bool taken = out->node && out->longest;
    if (taken)
        place_springs(m, limit, start, out);
    drape_free(ctx, start);
    return taken ? DRAPE_OK : DRAPE_E_MEMORY;
}

void drape_verlet_limit_free(drape_context *ctx, drape_verlet_limit *limit)
{
    drape_free(ctx, limit->node);
    drape_free(ctx, limit->longest);
}

static void shorten(const drape_verlet_limit *l, const int32_t *node, double by, const double d[3], double *x)
{
    bool held0 = l->pinned[node[0]], held1 = l->pinned[node[1]];
    double share0 = held0 ? 0 : held1 ? 1 : 0.5, share1 = held1 ? 0 : held0 ? 1 : 0.5;
    vec3_add_scaled(share0 * by, d, x + 3 * (size_t)node[0]);
    vec3_add_scaled(-share1 * by, d, x + 3 * (size_t)node[1]);
}

/* The largest square of a length over the longest that it met. */
static double pass(const drape_verlet_limit *l, double *x)
{
    double worst = 0;
    for (int32_t i = 0; i < l->count; i++) {
        const int32_t *node = l->node + 2 * (size_t)i;
        double d[3], longest = l->longest[i];
        vec3_sub(x + 3 * (size_t)node[1], x + 3 * (size_t)node[0], d);
        double square = vec3_dot(d, d);
        if (!(square > longest * longest))
            continue;
        worst = fmax(worst, l->pinned[node[0]] && l->pinned[node[1]] ? 0 : square / (longest * longest));
        shorten(l, node, 1 - longest / sqrt(square), d, x);
    }
    return worst;
}

void drape_verlet_limit_lengths(const drape_verlet_limit *l, double *x)
{
    for (int k = 0; k < l->passes && pass(l, x) > l->slack * l->slack; k++)
        ;
}
