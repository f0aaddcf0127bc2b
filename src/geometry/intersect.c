/*
 * intersect.c: see intersect.h. An edge is tested against the triangles whose boxes overlap its box, found
 * in a tree of boxes. The edge p q crosses the plane of a b c if p and q are on different sides of it, and
 * meets the triangle if the line through p and q has a b, b c and c a on the same side: five signs of
 * tetrahedron volumes (equivalent to Moeller & Trumbore 1997).
 */
#include "geometry/intersect.h"

#include "geometry/bvh.h"
#include "geometry/orient.h"

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
        status = drape_check_cancel_after(ctx, 64 * s.tested); /* more where signs need long sums */
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
