/*
 * untangle_project.c: positions that keep all bounds, and lengths and bends as well as these allow: each is
 * satisfied in turn by the least move of its nodes (Mueller et al. 2007, Position based dynamics), again
 * and again. Bounds come last, so that they are kept best.
 */
#include "contact/untangle_parts.h"

#include "base/vec3.h"

#include <string.h>

#define ITERATIONS 30
#define BENDING    0.1 /* share of a change of a bend that is taken back at once */

/* Moves two points apart or together along the line between them, by a share of what their distance lacks. */
static void restore(drape_untangler *u, int32_t a, int32_t b, double length, double share)
{
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
            restore(u, m->edge[2 * (size_t)e], m->edge[2 * (size_t)e + 1], u->length[e], 1);
        for (int32_t h = 0; h < u->hinge_count; h++)
            restore(u, u->hinge[2 * (size_t)h], u->hinge[2 * (size_t)h + 1], u->hinge_length[h], BENDING);
        for (int32_t b = 0; b < u->bounds.count; b++)
            keep_bound(u, &u->bounds.list[b]);
    }
    /* No point goes farther than what was searched. */
    const double most = drape_untangle_stride(u);
    for (int32_t i = 0; i < u->model->node_count; i++) {
        double *x = u->x + 3 * (size_t)i, move[3];
        const double *from = u->start + 3 * (size_t)i;
        vec3_sub(x, from, move);
        const double length = vec3_norm(move);
        for (int k = 0; length > most && k < 3; k++)
            x[k] = from[k] + move[k] * (most / length);
    }
}
