/*
 * bounds.c: the bounds of a sweep, and positions that keep all of them, and lengths and bends as well as
 * these allow: each is satisfied in turn by the least move of its nodes (Mueller et al. 2007, Position based
 * dynamics), again and again. Bounds come last in an iteration, so that they are kept best.
 */
#include "untangle/workspace.h"

#include "base/list.h"

#include <stdlib.h>

#define ITERATIONS 30
#define BENDING    0.1 /* share of a change of a bend that is taken back at once */

void drape_untangle_bound(drape_untangler *u, const drape_half_space *bound)
{
    if (!drape_list_append(u->arena, &u->bounds, &u->bound_count, &u->bound_capacity, bound, sizeof *bound))
        u->out_of_memory = true;
}

/* ---- Passages ---- */

static int compare_passages(const void *a, const void *b)
{
    const drape_passage *p = a, *q = b;
    return p->point != q->point ? (p->point > q->point ? 1 : -1)
                                : (p->sheet > q->sheet) - (p->sheet < q->sheet);
}

void drape_untangle_add_passage(drape_untangler *u, int32_t point, int32_t sheet)
{
    const drape_passage new = {point, sheet};
    if (drape_list_append(u->arena, &u->passage, &u->passage_count, &u->passage_capacity, &new, sizeof new))
        u->passes[point] = true;
    else
        u->out_of_memory = true;
}

void drape_untangle_sort_passages(drape_untangler *u)
{
    if (u->passage_count > 0)
        qsort(u->passage, (size_t)u->passage_count, sizeof *u->passage, compare_passages);
}

bool drape_untangle_passes(const drape_untangler *u, int32_t point, int32_t sheet)
{
    const drape_passage key = {point, sheet};
    return u->passes[point] &&
           bsearch(&key, u->passage, (size_t)u->passage_count, sizeof key, compare_passages);
}

/* ---- Projection ---- */

/* Moves two points apart or together along the line between them, by a share of what their distance lacks. */
static void restore_length(drape_untangler *u, const int32_t pair[2], double length, double share)
{
    const int32_t a = pair[0], b = pair[1];
    const double mobility = u->mobility[a] + u->mobility[b];
    double *p = u->x + 3 * (size_t)a, *q = u->x + 3 * (size_t)b, d[3];
    if (!(mobility > 0) || !(u->moved[a] || u->moved[b]))
        return;
    vec3_sub(q, p, d);
    const double now = vec3_norm(d);
    if (!(now > 0) || now == length)
        return;
    const double move = share * (now - length) / (now * mobility);
    vec3_add_scaled(u->mobility[a] * move, d, p);
    vec3_add_scaled(-u->mobility[b] * move, d, q);
    u->moved[a] = u->moved[a] || u->mobility[a] > 0;
    u->moved[b] = u->moved[b] || u->mobility[b] > 0;
}

static void keep_bound(drape_untangler *u, const drape_half_space *bound)
{
    double lacks = bound->bound, sum = 0;
    for (int a = 0; a < 4 && bound->node[a] >= 0; a++) {
        lacks -= bound->c[a] * vec3_dot(bound->normal, u->x + 3 * (size_t)bound->node[a]);
        sum += u->mobility[bound->node[a]] * bound->c[a] * bound->c[a];
    }
    if (!(lacks > 0) || !(sum > 0))
        return;
    for (int a = 0; a < 4 && bound->node[a] >= 0; a++) {
        const int32_t i = bound->node[a];
        const double move = u->mobility[i] * bound->c[a] * lacks / sum;
        vec3_add_scaled(move, bound->normal, u->x + 3 * (size_t)i);
        u->moved[i] = u->moved[i] || move != 0;
    }
}

void drape_untangle_project(drape_untangler *u)
{
    const drape_model *m = u->model;
    for (int i = 0; i < ITERATIONS; i++) {
        for (int32_t e = 0; e < m->edge_count; e++)
            restore_length(u, m->edge + 2 * (size_t)e, u->length[e], 1);
        for (int32_t h = 0; h < u->hinge_count; h++)
            restore_length(u, u->hinge + 2 * (size_t)h, u->hinge_length[h], BENDING);
        for (int32_t b = 0; b < u->bound_count; b++)
            keep_bound(u, &u->bounds[b]);
    }
    /* No point goes farther than what was searched. */
    const double most = drape_untangle_stride(u);
    for (int32_t i = 0; i < m->node_count; i++) {
        double *x = u->x + 3 * (size_t)i, move[3];
        const double *from = u->start + 3 * (size_t)i;
        vec3_sub(x, from, move);
        const double length = vec3_norm(move);
        for (int k = 0; length > most && k < 3; k++)
            x[k] = from[k] + move[k] * (most / length);
    }
}
