/* search.c: see search.h. */
#include "contact/search.h"

#include <math.h>
#include <string.h>

/* ---- Making and freeing ---- */

static void count_features(const drape_model *m, int32_t *points, int32_t *segments, int32_t *triangles)
{
    *points = *segments = *triangles = 0;
    for (int32_t i = 0; i < m->collider_count; i++) {
        const drape_collider *c = &m->colliders[i];
        *points += c->shape.point_count;
        *segments += c->shape.segment_count;
        *triangles += c->ops->smooth ? 0 : c->shape.triangle_count;
    }
}

static void list_collider(drape_search *s, int32_t collider, int32_t first, int32_t *segments,
                          int32_t *triangles)
{
    const drape_collider *c = &s->model->colliders[collider];
    if (c->shape.point_count > 0)
        memcpy(s->rest + 3 * (size_t)first, c->shape.point,
               3 * (size_t)c->shape.point_count * sizeof *s->rest);
    for (int32_t p = 0; p < c->shape.point_count; p++)
        s->point_collider[first - s->model->node_count + p] = collider;
    for (int32_t k = 0; k < 2 * c->shape.segment_count; k++)
        s->segment[2 * (size_t)*segments + (size_t)k] = c->shape.segment[k] + first;
    for (int32_t k = 0; k < c->shape.segment_count; k++)
        s->segment_collider[*segments + k] = collider;
    *segments += c->shape.segment_count;
    for (int32_t k = 0; !c->ops->smooth && k < 3 * c->shape.triangle_count; k++)
        s->triangle[3 * (size_t)*triangles + (size_t)k] = c->shape.triangle[k] + first;
    for (int32_t k = 0; !c->ops->smooth && k < c->shape.triangle_count; k++)
        s->triangle_collider[*triangles + k] = collider;
    *triangles += c->ops->smooth ? 0 : c->shape.triangle_count;
}

static void list_features(drape_search *s)
{
    int32_t first = s->model->node_count, segments = 0, triangles = 0;
    memcpy(s->rest, s->model->rest, 3 * (size_t)first * sizeof *s->rest);
    for (int32_t i = 0; i < s->model->collider_count; i++) {
        list_collider(s, i, first, &segments, &triangles);
        first += s->model->colliders[i].shape.point_count;
    }
}

static double area_of(const double *x, const int32_t *node)
{
    double a[3], b[3];
    for (size_t k = 0; k < 3; k++) {
        a[k] = x[3 * (size_t)node[1] + k] - x[3 * (size_t)node[0] + k];
        b[k] = x[3 * (size_t)node[2] + k] - x[3 * (size_t)node[0] + k];
    }
    double c[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    return 0.5 * sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
}

/* A node has a third of its triangles; an edge a third of the area around each of its ends' edges, which is
 * length times mean height: the share of both ends. */
static void share_areas(drape_search *s)
{
    const drape_model *m = s->model;
    for (int32_t f = 0; f < m->triangle_count; f++) {
        const int32_t *node = m->triangle + 3 * (size_t)f;
        s->face_area[f] = area_of(m->rest, node);
        for (int a = 0; a < 3; a++)
            s->node_area[node[a]] += s->face_area[f] / 3;
    }
    for (int32_t e = 0; e < m->edge_count; e++)
        s->edge_area[e] =
            0.5 * (s->node_area[m->edge[2 * (size_t)e]] + s->node_area[m->edge[2 * (size_t)e + 1]]);
}

static bool take_arrays(drape_search *s, int32_t points, int32_t triangles)
{
    const drape_model *m = s->model;
    s->rest = drape_alloc(s->ctx, 3 * (size_t)s->points, sizeof *s->rest);
    s->point_collider = drape_alloc(s->ctx, (size_t)points, sizeof *s->point_collider);
    s->segment = drape_alloc(s->ctx, 2 * (size_t)s->segments, sizeof *s->segment);
    s->segment_collider = drape_alloc(s->ctx, (size_t)s->segments, sizeof *s->segment_collider);
    s->triangle = drape_alloc(s->ctx, 3 * (size_t)triangles, sizeof *s->triangle);
    s->triangle_collider = drape_alloc(s->ctx, (size_t)triangles, sizeof *s->triangle_collider);
    s->node_area = drape_alloc(s->ctx, (size_t)m->node_count, sizeof *s->node_area);
    s->edge_area = drape_alloc(s->ctx, (size_t)m->edge_count, sizeof *s->edge_area);
    s->face_area = drape_alloc(s->ctx, (size_t)m->triangle_count, sizeof *s->face_area);
    return s->rest && s->point_collider && s->segment && s->segment_collider && s->triangle &&
           s->triangle_collider && s->node_area && s->edge_area && s->face_area;
}

drape_status drape_search_create(drape_context *ctx, const drape_model *model, drape_search *s)
{
    int32_t points, triangles;
    *s = (drape_search){.ctx = ctx, .model = model};
    count_features(model, &points, &s->segments, &triangles);
    s->points = model->node_count + points;
    s->most_distance = model->collider_count > 0 ? model->contact.distance : 0;
    if (model->contact.self)
        s->most_distance = fmax(s->most_distance, 2 * model->contact.self_thickness);
    drape_status status = take_arrays(s, points, triangles) ? DRAPE_OK : DRAPE_E_MEMORY;
    bool pieces = points > 0 || model->contact.self; /* faces and edges have something to meet */
    if (!status) {
        list_features(s);
        share_areas(s);
        status = drape_bvh_build(ctx, pieces ? model->triangle_count : 0, 3, model->triangle, model->rest,
                                 &s->faces);
    }
    if (!status)
        status = drape_bvh_build(ctx, pieces ? model->edge_count : 0, 2, model->edge, model->rest, &s->edges);
    if (!status)
        status = drape_bvh_build(ctx, triangles, 3, s->triangle, s->rest, &s->obstacles);
    if (status)
        drape_search_destroy(s);
    return status;
}

void drape_search_destroy(drape_search *s)
{
    void *arrays[] = {s->rest,     s->point_collider,    s->segment,   s->segment_collider,
                      s->triangle, s->triangle_collider, s->node_area, s->edge_area,
                      s->face_area};
    if (!s->ctx)
        return;
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        drape_free(s->ctx, arrays[i]);
    drape_bvh_free(s->ctx, &s->faces);
    drape_bvh_free(s->ctx, &s->edges);
    drape_bvh_free(s->ctx, &s->obstacles);
    *s = (drape_search){0};
}

size_t drape_search_bytes(const drape_search *s)
{
    size_t trees = (size_t)s->faces.count + (size_t)s->edges.count + (size_t)s->obstacles.count;
    size_t areas =
        (size_t)s->model->node_count + (size_t)s->model->edge_count + (size_t)s->model->triangle_count;
    return trees * (2 * sizeof(drape_bvh_branch) + sizeof(int32_t)) +
           (3 * (size_t)s->points + areas) * sizeof(double) +
           (size_t)(s->points - s->model->node_count) * sizeof *s->point_collider +
           (3 * (size_t)s->segments + 4 * (size_t)s->obstacles.count) * sizeof(int32_t);
}

/* ---- Constants of a pair ---- */

static void set_nodes(drape_pair *p, int32_t a, int32_t b, int32_t c, int32_t d)
{
    p->node[0] = a;
    p->node[1] = b;
    p->node[2] = c;
    p->node[3] = d;
}

drape_pair drape_search_surface(const drape_search *s, int32_t node, int32_t collider)
{
    return (drape_pair){.kind = DRAPE_PAIR_SURFACE,
                        .node = {node, -1, -1, -1},
                        .collider = collider,
                        .area = s->node_area[node],
                        .distance = s->model->contact.distance};
}

static void set_collider(const drape_search *s, int32_t collider, drape_pair *p)
{
    p->collider = collider;
    p->radius = s->model->colliders[collider].shape.radius;
    p->distance = s->model->contact.distance;
}

/* ---- Searching ---- */

/* One piece against a tree. */
typedef struct question {
    drape_search *search;
    const double *x, *y;
    drape_search_visit *visit;
    void *user;
    drape_pair pair; /* with the piece that asks filled in */
    int32_t asking;  /* its number */
} question;

static bool is_free(const drape_search *s, int32_t point)
{
    return point < s->model->node_count && s->model->free_of_node[point] >= 0;
}

static void answer(question *q)
{
    const int32_t *n = q->pair.node;
    const drape_search *s = q->search;
    if (is_free(s, n[0]) || is_free(s, n[1]) || is_free(s, n[2]) || is_free(s, n[3]))
        q->visit(q->user, &q->pair);
}

static void own_face(void *user, int32_t face)
{
    question *q = user;
    const int32_t *t = q->search->model->triangle + 3 * (size_t)face;
    if (t[0] == q->asking || t[1] == q->asking || t[2] == q->asking)
        return;
    set_nodes(&q->pair, q->asking, t[0], t[1], t[2]);
    answer(q);
}

static void own_edge(void *user, int32_t edge)
{
    question *q = user;
    const int32_t *e = q->search->model->edge + 2 * (size_t)edge,
                  *f = q->search->model->edge + 2 * (size_t)q->asking;
    if (edge <= q->asking || e[0] == f[0] || e[0] == f[1] || e[1] == f[0] || e[1] == f[1])
        return;
    set_nodes(&q->pair, f[0], f[1], e[0], e[1]);
    q->pair.area = 0.5 * (q->search->edge_area[edge] + q->search->edge_area[q->asking]);
    answer(q);
}

static void feature_face(void *user, int32_t face)
{
    question *q = user;
    const int32_t *t = q->search->model->triangle + 3 * (size_t)face;
    set_nodes(&q->pair, q->asking, t[0], t[1], t[2]);
    q->pair.area = q->search->face_area[face];
    answer(q);
}

static void feature_edge(void *user, int32_t edge)
{
    question *q = user;
    const int32_t *e = q->search->model->edge + 2 * (size_t)edge,
                  *f = q->search->segment + 2 * (size_t)q->asking;
    set_nodes(&q->pair, e[0], e[1], f[0], f[1]);
    q->pair.area = q->search->edge_area[edge];
    answer(q);
}

static void obstacle_face(void *user, int32_t face)
{
    question *q = user;
    const int32_t *t = q->search->triangle + 3 * (size_t)face;
    set_collider(q->search, q->search->triangle_collider[face], &q->pair);
    set_nodes(&q->pair, q->asking, t[0], t[1], t[2]);
    answer(q);
}

static void search_self(question *q, double reach)
{
    const drape_search *s = q->search;
    double wide = fmax(0, 2 * s->model->contact.self_thickness + reach);
    q->pair = (drape_pair){.kind = DRAPE_PAIR_TRIANGLE, .collider = -1};
    q->pair.distance = 2 * s->model->contact.self_thickness;
    for (q->asking = 0; q->asking < s->model->node_count; q->asking++) {
        drape_box box = drape_box_of(&q->asking, 1, q->x, q->y, wide);
        q->pair.area = s->node_area[q->asking];
        drape_bvh_query(&s->faces, &box, own_face, q);
    }
    q->pair.kind = DRAPE_PAIR_SEGMENTS;
    for (q->asking = 0; q->asking < s->model->edge_count; q->asking++) {
        drape_box box = drape_box_of(s->model->edge + 2 * (size_t)q->asking, 2, q->x, q->y, wide);
        drape_bvh_query(&s->edges, &box, own_edge, q);
    }
}

static double wide(const drape_pair *pair, double reach)
{
    return fmax(0, pair->distance + pair->radius + reach);
}

static void search_features(question *q, double reach)
{
    const drape_search *s = q->search;
    q->pair = (drape_pair){.kind = DRAPE_PAIR_TRIANGLE};
    for (q->asking = s->model->node_count; q->asking < s->points; q->asking++) {
        set_collider(s, s->point_collider[q->asking - s->model->node_count], &q->pair);
        drape_box box = drape_box_of(&q->asking, 1, q->x, q->y, wide(&q->pair, reach));
        drape_bvh_query(&s->faces, &box, feature_face, q);
    }
    q->pair.kind = DRAPE_PAIR_SEGMENTS;
    for (q->asking = 0; q->asking < s->segments; q->asking++) {
        set_collider(s, s->segment_collider[q->asking], &q->pair);
        drape_box box =
            drape_box_of(s->segment + 2 * (size_t)q->asking, 2, q->x, q->y, wide(&q->pair, reach));
        drape_bvh_query(&s->edges, &box, feature_edge, q);
    }
}

static void search_obstacles(question *q, double reach)
{
    const drape_search *s = q->search;
    q->pair = (drape_pair){.kind = DRAPE_PAIR_TRIANGLE};
    for (q->asking = 0; s->obstacles.count > 0 && q->asking < s->model->node_count; q->asking++) {
        drape_box box = drape_box_of(&q->asking, 1, q->x, q->y, fmax(0, s->model->contact.distance + reach));
        q->pair.area = s->node_area[q->asking];
        drape_bvh_query(&s->obstacles, &box, obstacle_face, q);
    }
}

void drape_search_pairs(drape_search *s, const double *x, const double *y, double reach,
                        drape_search_visit *visit, void *user)
{
    question q = {.search = s, .x = x, .y = y, .visit = visit, .user = user};
    bool features = s->points > s->model->node_count;
    if (features || s->model->contact.self) {
        drape_bvh_fit(&s->faces, x, y);
        drape_bvh_fit(&s->edges, x, y);
    }
    drape_bvh_fit(&s->obstacles, x, y);
    if (s->model->contact.self)
        search_self(&q, reach);
    if (features)
        search_features(&q, reach);
    search_obstacles(&q, reach);
}
