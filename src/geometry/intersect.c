/*
 * intersect.c: see intersect.h. An edge is tested against the triangles whose boxes overlap its box, found
 * in a tree of boxes. The edge p q crosses the plane of a b c if p and q are on different sides of it, and
 * meets the triangle if the line through p and q has a b, b c and c a on the same side: five signs of
 * tetrahedron volumes (equivalent to Moeller & Trumbore 1997).
 */
#include "geometry/intersect.h"

#include "base/vec3.h"
#include "geometry/bvh.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>

bool drape_intersect_edge(const double *p, const double *q, const double *a, const double *b, const double *c)
{
    const int above = drape_orient(a, b, c, p);
    if (above == 0 || above != -drape_orient(a, b, c, q))
        return false;
    /* seen along the line, no side may be clockwise if another is counterclockwise */
    return above * drape_orient(p, q, a, b) <= 0 && above * drape_orient(p, q, b, c) <= 0 &&
           above * drape_orient(p, q, c, a) <= 0;
}

/* The search for triangles that one edge crosses. */
typedef struct search {
    const drape_surface *edges, *triangles;
    int32_t edge;
    drape_intersection_visit *visit;
    void *user;
    size_t tested; /* triangles, for this edge */
} search;

static bool are_neighbours(const drape_model *model, const int32_t *edge, const int32_t *triangle)
{
    static const drape_model nothing_sewn = {.sewn = NULL};
    return drape_model_share_node(model ? model : &nothing_sewn, triangle, 3, edge, 2);
}

static void try_triangle(void *user, int32_t element)
{
    search *s = user;
    const int32_t *edge = s->edges->edge + 2 * (size_t)s->edge,
                  *triangle = s->triangles->triangle + 3 * (size_t)element;
    const double *corner[3];
    s->tested++;
    if (s->edges->x == s->triangles->x && are_neighbours(s->edges->model, edge, triangle))
        return;
    for (int a = 0; a < 3; a++)
        corner[a] = s->triangles->x + 3 * (size_t)triangle[a];
    if (drape_intersect_edge(s->edges->x + 3 * (size_t)edge[0], s->edges->x + 3 * (size_t)edge[1], corner[0],
                             corner[1], corner[2]))
        s->visit(s->user, s->edge, element);
}

drape_status drape_intersect(drape_context *ctx, const drape_surface *edges, const drape_surface *triangles,
                             drape_intersection_visit *visit, void *user)
{
    drape_arena arena = drape_arena_of(ctx);
    drape_bvh tree;
    search s = {.edges = edges, .triangles = triangles, .visit = visit, .user = user};
    if (edges->edge_count == 0 || triangles->triangle_count == 0)
        return DRAPE_OK;
    drape_status status =
        drape_bvh_build(&arena, triangles->triangle_count, 3, triangles->triangle, triangles->x, &tree);
    if (!status)
        drape_bvh_fit(&tree, triangles->x);
    for (s.edge = 0; !status && s.edge < edges->edge_count; s.edge++) {
        const drape_box box = drape_box_of(edges->edge + 2 * (size_t)s.edge, 2, edges->x, 0);
        s.tested = 1;
        drape_bvh_query(&tree, &box, try_triangle, &s);
        status = drape_check_cancel_after(ctx, 64 * s.tested);
    }
    drape_arena_free(&arena);
    return status;
}

drape_surface drape_surface_of(const drape_model *m, const double *x)
{
    return (drape_surface){.x = x,
                           .model = m,
                           .edge = m->edge,
                           .triangle = m->triangle,
                           .edge_count = m->edge_count,
                           .triangle_count = m->triangle_count};
}

/* The cloth and what was found so far. */
typedef struct counting {
    const drape_model *model;
    drape_intersections *found;
} counting;

static void count(void *user, int32_t edge, int32_t triangle)
{
    const counting *c = user;
    if (drape_model_ignores_cloth(c->model, c->model->edge[2 * (size_t)edge],
                                  c->model->triangle[3 * (size_t)triangle]))
        return;
    if (c->found->count++ > 0)
        return;
    for (int a = 0; a < 3; a++) {
        c->found->triangle[a] = c->model->triangle[3 * (size_t)triangle + (size_t)a];
        c->found->edge[a % 2] = c->model->edge[2 * (size_t)edge + (size_t)(a % 2)];
    }
}

drape_status drape_find_intersections(drape_context *ctx, const drape_model *m, const double *x,
                                      drape_intersections *found)
{
    const drape_surface cloth = drape_surface_of(m, x);
    counting c = {m, found};
    *found = (drape_intersections){.edge = {-1, -1}, .triangle = {-1, -1, -1}};
    return drape_intersect(ctx, &cloth, &cloth, count, &c);
}

/* ---- Orientation ---- */

/* Where rounding may change the sign of the volume in doubles, it is evaluated as an exact sum: 24
 * products of three coordinates, each of which is a sum of four doubles (Shewchuk 1997, Adaptive Precision
 * Floating-Point Arithmetic and Fast Robust Geometric Predicates, sections 2.2 to 2.5). */

/* Bound of the error of the volume in doubles, relative to the product of the lengths: that of Shewchuk's
 * orient3d, 7/2 epsilon of the permanent of the magnitudes, which is at most 2/sqrt(3) of that product
 * (Carlen, Lieb & Loss 2006, An inequality of Hadamard type for permanents); rounded up to a power of 2. */
#define ROUNDING (8 * DBL_EPSILON)
/* 2^27 + 1: splits a double into two halves of its digits (Dekker 1971). */
#define SPLITTER ((double)(1 << (DBL_MANT_DIG + 1) / 2) + 1)
#define TERMS    (24 * 4) /* doubles that the volume is the exact sum of */

/* *high + *low = a + b, *high rounded. */
static void two_sum(double a, double b, double *high, double *low)
{
    const double sum = a + b, part = sum - a;
    *low = (a - (sum - part)) + (b - part);
    *high = sum;
}

/* *high + *low = a b, *high rounded. */
static void two_product(double a, double b, double *high, double *low)
{
    const double product = a * b, ca = SPLITTER * a, cb = SPLITTER * b;
    const double ah = ca - (ca - a), al = a - ah, bh = cb - (cb - b), bl = b - bh;
    *low = al * bl - (((product - ah * bh) - al * bh) - ah * bl);
    *high = product;
}

/* A sum of doubles that are not 0 and whose digits do not overlap, the smallest first: the last has the sign
 * of the sum. */
typedef struct expansion {
    double part[TERMS];
    int count;
} expansion;

static void add(expansion *sum, double term)
{
    int kept = 0;
    for (int i = 0; i < sum->count; i++) {
        double low;
        two_sum(term, sum->part[i], &term, &low);
        if (low != 0)
            sum->part[kept++] = low;
    }
    if (term != 0)
        sum->part[kept++] = term;
    sum->count = kept;
}

static void add_product(expansion *sum, double a, double b, double c)
{
    double high, low, part[2];
    if (a == 0 || b == 0 || c == 0)
        return;
    two_product(a, b, &high, &low);
    two_product(low, c, &part[0], &part[1]);
    add(sum, part[1]);
    add(sum, part[0]);
    two_product(high, c, &part[0], &part[1]);
    add(sum, part[1]);
    add(sum, part[0]);
}

/* sign p . (q x r) */
static void add_triple(expansion *sum, double sign, const double *p, const double *q, const double *r)
{
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        add_product(sum, sign * p[i], q[j], r[k]);
        add_product(sum, -sign * p[i], q[k], r[j]);
    }
}

static int sign_of(const expansion *sum)
{
    return sum->count == 0 ? 0 : sum->part[sum->count - 1] > 0 ? 1 : -1;
}

/* Whether the differences x - y are exact. */
static bool are_exact(const double *x, const double *y)
{
    double high, low[3];
    for (int k = 0; k < 3; k++)
        two_sum(x[k], -y[k], &high, &low[k]);
    return low[0] == 0 && low[1] == 0 && low[2] == 0;
}

int drape_orient(const double *a, const double *b, const double *c, const double *d)
{
    double u[3], v[3], w[3], n[3];
    vec3_sub(b, a, u);
    vec3_sub(c, a, v);
    vec3_sub(d, a, w);
    vec3_cross(u, v, n);
    const double volume = vec3_dot(n, w);
    if (fabs(volume) > ROUNDING * vec3_norm(u) * vec3_norm(v) * vec3_norm(w))
        return volume > 0 ? 1 : -1;
    for (int k = 0; k < 3;
         k++) /* points in one plane of coordinates, as of layers that begin so, need no long sums */
        if (u[k] == 0 && v[k] == 0 && w[k] == 0)
            return 0;
    /* If u = b - a, v = c - a and w = d - a are exact, the volume is u . (v x w); in general it is b . (c
     * x d) - a . (c x d) + a . (b x d) - a . (b x c). */
    expansion sum = {.count = 0};
    if (are_exact(b, a) && are_exact(c, a) && are_exact(d, a)) {
        add_triple(&sum, 1, u, v, w);
        return sign_of(&sum);
    }
    add_triple(&sum, 1, b, c, d);
    add_triple(&sum, -1, a, c, d);
    add_triple(&sum, 1, a, b, d);
    add_triple(&sum, -1, a, b, c);
    return sign_of(&sum);
}
