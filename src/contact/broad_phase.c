/* broad_phase.c: see broad_phase.h. */
#include "contact/broad_phase.h"

#include <math.h>
#include <string.h>

/* Points and segments of colliders up to which the trees of the cloth are not fitted for them: to fit costs
 * as much as twenty scans. */
#define FEW 16

/* ---- Creation ---- */

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

static void list_collider(drape_broad_phase *s, int32_t collider, int32_t first, int32_t *segments,
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

static void list_features(drape_broad_phase *s)
{
    int32_t first = s->model->node_count, segments = 0, triangles = 0;
    memcpy(s->rest, s->model->rest, 3 * (size_t)first * sizeof *s->rest);
    for (int32_t i = 0; i < s->model->collider_count; i++) {
        s->first_point[i] = first;
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

/* A node gets a third of the area of its triangles, an edge the mean of its two nodes. */
static void share_areas(drape_broad_phase *s)
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

drape_status drape_broad_phase_create(drape_arena *arena, const drape_model *m, drape_broad_phase *s)
{
    int32_t points, triangles;
    *s = (drape_broad_phase){.model = m};
    count_features(m, &points, &s->segments, &triangles);
    s->points = m->node_count + points;
    s->rest = drape_arena_take(arena, 3 * (size_t)s->points, sizeof *s->rest);
    s->point_collider = drape_arena_take(arena, (size_t)points, sizeof *s->point_collider);
    s->first_point = drape_arena_take(arena, (size_t)m->collider_count, sizeof *s->first_point);
    s->segment = drape_arena_take(arena, 2 * (size_t)s->segments, sizeof *s->segment);
    s->segment_collider = drape_arena_take(arena, (size_t)s->segments, sizeof *s->segment_collider);
    s->triangle = drape_arena_take(arena, 3 * (size_t)triangles, sizeof *s->triangle);
    s->triangle_collider = drape_arena_take(arena, (size_t)triangles, sizeof *s->triangle_collider);
    s->distance = drape_arena_take(arena, (size_t)m->collider_count, sizeof *s->distance);
    s->side = drape_arena_take(arena, (size_t)m->node_count, sizeof *s->side);
    s->near_node = drape_arena_take(arena, (size_t)m->node_count, sizeof *s->near_node);
    s->near_edge = drape_arena_take(arena, (size_t)m->edge_count, sizeof *s->near_edge);
    s->node_area = drape_arena_take(arena, (size_t)m->node_count, sizeof *s->node_area);
    s->edge_area = drape_arena_take(arena, (size_t)m->edge_count, sizeof *s->edge_area);
    s->face_area = drape_arena_take(arena, (size_t)m->triangle_count, sizeof *s->face_area);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < m->collider_count; i++)
        s->distance[i] = drape_collider_activation(m, i);
    for (int32_t i = 0; i < m->collider_count; i++)
        if (!m->colliders[i].ops->smooth)
            s->obstacle_radius = fmax(s->obstacle_radius, m->colliders[i].shape.radius);
    list_features(s);
    share_areas(s);
    const bool met = points > 0 || m->contact.self; /* faces and edges can meet something */
    drape_status status =
        drape_path_bvh_build(arena, met ? m->triangle_count : 0, 3, m->triangle, m->rest, &s->faces);
    if (!status)
        status = drape_path_bvh_build(arena, met ? m->edge_count : 0, 2, m->edge, m->rest, &s->edges);
    return status ? status : drape_path_bvh_build(arena, triangles, 3, s->triangle, s->rest, &s->obstacles);
}

/* ---- Constants of a pair ---- */

static void set_nodes(drape_pair *p, int32_t a, int32_t b, int32_t c, int32_t d)
{
    p->node[0] = a;
    p->node[1] = b;
    p->node[2] = c;
    p->node[3] = d;
}

drape_pair drape_broad_phase_surface(const drape_broad_phase *s, int32_t node, int32_t collider)
{
    return (drape_pair){.kind = DRAPE_PAIR_SURFACE,
                        .node = {node, -1, -1, -1},
                        .collider = collider,
                        .area = s->node_area[node],
                        .distance = s->distance[collider],
                        .rank = {collider - s->model->collider_count, node}};
}

static void set_collider(const drape_broad_phase *s, int32_t collider, drape_pair *p)
{
    p->collider = collider;
    p->radius = s->model->colliders[collider].shape.radius;
    p->distance = s->distance[collider];
}

/* ---- Searching ---- */

/* Stages of a search, after those of the smooth colliders, which have negative numbers. */
enum { OWN_FACES, OWN_EDGES, FEATURE_FACES, FEATURE_EDGES, OBSTACLES };

/* A piece that is tested against those in a tree. */
typedef struct query {
    drape_broad_phase *broad;
    const drape_broad_query *want;
    drape_broad_phase_visit *visit;
    void *user;
    drape_pair pair; /* its constants, as far as they depend on this piece alone */
    int32_t piece;   /* number of the point, edge or segment */
    const drape_path_bvh *tree;
    bool scans; /* the trees of the cloth are not fitted */
} query;

static bool is_free(const drape_broad_phase *s, int32_t point)
{
    return point < s->model->node_count && s->model->free_of_node[point] >= 0;
}

/* The other piece of a pair of cloths has its last node; at a collider one piece has nodes of cloth alone. */
static bool is_ignored(const drape_broad_phase *s, const drape_pair *pair)
{
    const int32_t *n = pair->node, nodes = s->model->node_count;
    return pair->collider < 0 ? drape_model_ignores_cloth(s->model, n[0], n[3])
                              : drape_model_ignores(s->model, pair->collider, n[0] < nodes ? n[0] : n[3]);
}

static void report(query *q, int32_t element)
{
    const int32_t *n = q->pair.node;
    const drape_broad_phase *s = q->broad;
    if (s->model->ignored && is_ignored(s, &q->pair))
        return;
    q->pair.rank[2] = q->tree->place[element];
    if (is_free(s, n[0]) || is_free(s, n[1]) || is_free(s, n[2]) || is_free(s, n[3]))
        q->visit(q->user, &q->pair);
}

static void own_face(void *user, int32_t face)
{
    query *q = user;
    const int32_t *t = q->broad->model->triangle + 3 * (size_t)face;
    if (drape_model_share_node(q->broad->model, &q->piece, 1, t, 3))
        return;
    set_nodes(&q->pair, q->piece, t[0], t[1], t[2]);
    report(q, face);
}

static void own_edge(void *user, int32_t edge)
{
    query *q = user;
    const int32_t *e = q->broad->model->edge + 2 * (size_t)edge,
                  *f = q->broad->model->edge + 2 * (size_t)q->piece;
    if (drape_model_share_node(q->broad->model, e, 2, f, 2))
        return;
    set_nodes(&q->pair, f[0], f[1], e[0], e[1]);
    q->pair.area = 0.5 * (q->broad->edge_area[edge] + q->broad->edge_area[q->piece]);
    report(q, edge);
}

static void feature_face(void *user, int32_t face)
{
    query *q = user;
    const int32_t *t = q->broad->model->triangle + 3 * (size_t)face;
    set_nodes(&q->pair, q->piece, t[0], t[1], t[2]);
    q->pair.area = q->broad->face_area[face];
    report(q, face);
}

static void feature_edge(void *user, int32_t edge)
{
    query *q = user;
    const int32_t *e = q->broad->model->edge + 2 * (size_t)edge,
                  *f = q->broad->segment + 2 * (size_t)q->piece;
    set_nodes(&q->pair, e[0], e[1], f[0], f[1]);
    q->pair.area = q->broad->edge_area[edge];
    report(q, edge);
}

static void obstacle_face(void *user, int32_t face)
{
    query *q = user;
    const int32_t *t = q->broad->triangle + 3 * (size_t)face;
    set_collider(q->broad, q->broad->triangle_collider[face], &q->pair);
    set_nodes(&q->pair, q->piece, t[0], t[1], t[2]);
    report(q, face);
}

static bool is_marked(const bool *marked, const int32_t *node, int nodes)
{
    for (int a = 0; marked && a < nodes; a++)
        if (marked[node[a]])
            return true;
    return !marked;
}

/* Tests a piece against those in a tree with numbers above `after`: its nodes are the `nodes` ones from
 * `node` on. */
static void search_tree(query *q, int32_t piece, const int32_t *node, int nodes, int32_t after,
                        const drape_path_bvh *tree, drape_bvh_visit *visit)
{
    const drape_path_query want = {.node = node,
                                   .nodes = nodes,
                                   .x = q->want->x,
                                   .y = q->want->y,
                                   .reach = q->pair.distance + q->pair.radius + q->want->reach,
                                   .after = after,
                                   .only_marked = !is_marked(q->want->marked, node, nodes)};
    q->piece = q->pair.rank[1] = piece;
    q->tree = tree;
    if (q->scans)
        drape_path_bvh_scan(tree, &want, q->broad->model->node_count, q->want->marked, q->broad->side, visit,
                            q);
    else
        drape_path_bvh_query(tree, &want, visit, q);
}

static void note_nodes(void *user, int32_t face)
{
    drape_broad_phase *s = user;
    for (int a = 0; a < 3; a++)
        s->near_node[s->model->triangle[3 * (size_t)face + (size_t)a]] = true;
}

static void note_edge(void *user, int32_t edge)
{
    ((drape_broad_phase *)user)->near_edge[edge] = true;
}

static void note_near(drape_broad_phase *s, const drape_broad_query *want, double reach,
                      const drape_path_bvh *tree, drape_bvh_visit *visit)
{
    drape_path_query from = {.nodes = tree->nodes, .x = want->x, .y = want->y, .reach = reach, .after = -1};
    for (int32_t e = 0; e < tree->count; e++) {
        from.node = tree->node + (size_t)e * (size_t)tree->nodes;
        if (is_marked(want->marked, from.node, tree->nodes))
            drape_path_bvh_query(tree, &from, visit, s);
    }
}

/* Finds the nodes and edges that may meet a marked face or edge: most meet none. */
static void find_near(drape_broad_phase *s, const drape_broad_query *want)
{
    const double reach = 2 * s->model->contact.self_thickness + want->reach;
    const bool all = !want->marked;
    memset(s->near_node, all, (size_t)s->model->node_count * sizeof *s->near_node);
    memset(s->near_edge, all, (size_t)s->model->edge_count * sizeof *s->near_edge);
    if (all)
        return;
    note_near(s, want, reach, &s->faces, note_nodes);
    note_near(s, want, reach, &s->edges, note_edge);
}

static void search_self(query *q)
{
    drape_broad_phase *s = q->broad;
    q->pair = (drape_pair){.kind = DRAPE_PAIR_TRIANGLE,
                           .collider = -1,
                           .distance = 2 * s->model->contact.self_thickness,
                           .rank = {OWN_FACES}};
    find_near(s, q->want);
    for (int32_t i = 0; i < s->model->node_count; i++) {
        q->pair.area = s->node_area[i];
        if (s->near_node[i] || q->want->marked[i])
            search_tree(q, i, &i, 1, -1, &s->faces, own_face);
    }
    q->pair.kind = DRAPE_PAIR_SEGMENTS;
    q->pair.rank[0] = OWN_EDGES;
    for (int32_t e = 0; e < s->model->edge_count; e++)
        if (s->near_edge[e]) /* as every marked edge: it meets itself */
            search_tree(q, e, s->model->edge + 2 * (size_t)e, 2, e, &s->edges, own_edge);
}

static void search_features(query *q)
{
    const drape_broad_phase *s = q->broad;
    q->pair = (drape_pair){.kind = DRAPE_PAIR_TRIANGLE, .rank = {FEATURE_FACES}};
    for (int32_t i = s->model->node_count; i < s->points; i++) {
        set_collider(s, s->point_collider[i - s->model->node_count], &q->pair);
        search_tree(q, i, &i, 1, -1, &s->faces, feature_face);
    }
    q->pair.kind = DRAPE_PAIR_SEGMENTS;
    q->pair.rank[0] = FEATURE_EDGES;
    for (int32_t i = 0; i < s->segments; i++) {
        set_collider(s, s->segment_collider[i], &q->pair);
        search_tree(q, i, s->segment + 2 * (size_t)i, 2, -1, &s->edges, feature_edge);
    }
}

static void search_obstacles(query *q)
{
    const drape_broad_phase *s = q->broad;
    double largest = 0;
    for (int32_t i = 0; i < s->model->collider_count; i++)
        largest = fmax(largest, s->distance[i]);
    for (int32_t i = 0; s->obstacles.count > 0 && i < s->model->node_count; i++) {
        q->pair = (drape_pair){.kind = DRAPE_PAIR_TRIANGLE,
                               .radius = s->obstacle_radius,
                               .area = s->node_area[i],
                               .distance = largest,
                               .rank = {OBSTACLES}};
        search_tree(q, i, &i, 1, -1, &s->obstacles, obstacle_face);
    }
}

void drape_broad_phase_pairs(drape_broad_phase *s, const drape_broad_query *want,
                             drape_broad_phase_visit *visit, void *user)
{
    query q = {.broad = s, .want = want, .visit = visit, .user = user};
    const int32_t features = s->points - s->model->node_count + s->segments;
    q.scans = features <= FEW && !s->model->contact.self;
    if (!q.scans) {
        drape_path_bvh_fit(&s->faces, want->x, want->y, want->marked);
        drape_path_bvh_fit(&s->edges, want->x, want->y, want->marked);
    }
    drape_path_bvh_fit(&s->obstacles, want->x, want->y, want->marked);
    if (s->model->contact.self)
        search_self(&q);
    if (features > 0)
        search_features(&q);
    q.scans = false;
    search_obstacles(&q);
}
