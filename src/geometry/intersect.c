/*
 * intersect.c: see intersect.h. An edge is tested against the triangles whose boxes overlap its box. An edge
 * p q crosses a triangle a b c if p and q lie on different sides of its plane and the line through them has a
 * b, b c and c a on the same side: five signs of tetrahedron volumes (equivalent to Moeller & Trumbore 1997).
 */
#include "geometry/intersect.h"

#include "base/vec3.h"
#include "geometry/bvh.h"

#include <float.h>
#include <math.h>

#define ROUNDINGS 8 /* rounding errors of a volume: from its coordinates, differences, products and sums */

/* Returns six times the volume of the tetrahedron a b c d, or 0 if that is within rounding of 0: an edge that
 * lies in the plane of a triangle does not cross it. */
static double volume(const double *a, const double *b, const double *c, const double *d)
{
    double u[3], v[3], w[3], n[3], largest = 0;
    vec3_sub(b, a, u);
    vec3_sub(c, a, v);
    vec3_sub(d, a, w);
    vec3_cross(u, v, n);
    for (int k = 0; k < 3; k++)
        largest = fmax(largest, fmax(fmax(fabs(a[k]), fabs(b[k])), fmax(fabs(c[k]), fabs(d[k]))));
    double lu = vec3_norm(u), lv = vec3_norm(v), lw = vec3_norm(w), six = vec3_dot(n, w);
    double rounding = ROUNDINGS * DBL_EPSILON * (lu * lv * lw + largest * (lu * lv + lv * lw + lw * lu));
    return fabs(six) > rounding ? six : 0;
}

static bool crosses(const double *x, const int32_t *edge, const int32_t *triangle)
{
    for (int i = 0; i < 6; i++)
        if (edge[i / 3] == triangle[i % 3])
            return false;
    const double *p = x + 3 * (size_t)edge[0], *q = x + 3 * (size_t)edge[1];
    const double *a = x + 3 * (size_t)triangle[0], *b = x + 3 * (size_t)triangle[1],
                 *c = x + 3 * (size_t)triangle[2];
    double above = volume(a, b, c, p), below = volume(a, b, c, q);
    if (above == 0 || below == 0 || (above > 0) == (below > 0))
        return false;
    bool ab = volume(p, q, a, b) > 0;
    return ab == (volume(p, q, b, c) > 0) && ab == (volume(p, q, c, a) > 0);
}

/* The search for triangles that one edge crosses. */
typedef struct search {
    const drape_model *model;
    const double *x;
    const int32_t *edge;
    drape_intersections *found;
} search;

static void try_triangle(void *user, int32_t element)
{
    search *s = user;
    const int32_t *triangle = s->model->triangle + 3 * (size_t)element;
    if (!crosses(s->x, s->edge, triangle) || s->found->count++ > 0)
        return;
    for (int a = 0; a < 3; a++) {
        s->found->triangle[a] = triangle[a];
        s->found->edge[a % 2] = s->edge[a % 2];
    }
}

drape_status drape_find_intersections(drape_context *ctx, const drape_model *m, const double *x,
                                      drape_intersections *found)
{
    drape_arena arena = drape_arena_of(ctx);
    drape_bvh faces;
    search s = {.model = m, .x = x, .found = found};
    *found = (drape_intersections){.edge = {-1, -1}, .triangle = {-1, -1, -1}};
    drape_status status = drape_bvh_build(&arena, m->triangle_count, 3, m->triangle, m->rest, &faces);
    if (!status)
        drape_bvh_fit(&faces, x);
    for (int32_t e = 0; !status && e < m->edge_count; e++) {
        s.edge = m->edge + 2 * (size_t)e;
        drape_box box = drape_box_of(s.edge, 2, x, 0);
        drape_bvh_query(&faces, &box, try_triangle, &s);
    }
    drape_arena_free(&arena);
    return status;
}
