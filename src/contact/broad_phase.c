/* broad_phase.c: see broad_phase.h. */
#include "contact/broad_phase.h"

#include "base/vec3.h"

#include <math.h>
#include <string.h>

/* Up to so many points and segments of colliders, the elements of the cloth are scanned for each of them: to
 * fit the trees of the cloth costs as much as twenty scans. */
#define FEW 16
/* Upper bound of the activation distance of round features, in the depth by which the middle of an edge may
 * be nearer than its ends. A fast body has a larger one, which holds the nodes; these hold the edges. */
#define SAGS 2

/* ---- Creation ---- */

static void list_features(drape_broad_phase *s)
{
    int32_t first = s->model->node_count, segments = 0, triangles = 0;
    memcpy(s->rest, s->model->rest, 3 * (size_t)first * sizeof *s->rest);
    for (int32_t i = 0; i < s->points; i++)
        s->point[i] = i;
    for (int32_t i = 0; i < s->model->collider_count; i++) {
        s->first_point[i] = first;
        const drape_collider *c = &s->model->colliders[i];
        if (c->shape.point_count > 0)
            memcpy(s->rest + 3 * (size_t)first, c->shape.point,
                   3 * (size_t)c->shape.point_count * sizeof *s->rest);
        for (int32_t p = 0; p < c->shape.point_count; p++)
            s->point_collider[first - s->model->node_count + p] = i;
        for (int32_t k = 0; k < 2 * c->shape.segment_count; k++)
            s->segment[2 * (size_t)segments + (size_t)k] = c->shape.segment[k] + first;
        for (int32_t k = 0; k < c->shape.segment_count; k++)
            s->segment_collider[segments + k] = i;
        segments += c->shape.segment_count;
        for (int32_t k = 0; !c->ops->smooth && k < 3 * c->shape.triangle_count; k++)
            s->triangle[3 * (size_t)triangles + (size_t)k] = c->shape.triangle[k] + first;
        for (int32_t k = 0; !c->ops->smooth && k < c->shape.triangle_count; k++)
            s->triangle_collider[triangles + k] = i;
        triangles += c->ops->smooth ? 0 : c->shape.triangle_count;
        first += c->shape.point_count;
    }
}

/* A node gets a third of the area of its triangles, an edge the mean of its two nodes. */
static void share_areas(drape_broad_phase *s)
{
    const drape_model *m = s->model;
    for (int32_t f = 0; f < m->triangle_count; f++) {
        const int32_t *node = m->triangle + 3 * (size_t)f;
        double area[3];
        vec3_triangle_area(node, m->rest, area);
        s->face_area[f] = vec3_norm(area) / 2;
        for (int a = 0; a < 3; a++)
            s->node_area[node[a]] += s->face_area[f] / 3;
    }
    /* Nodes that another rank owns have triangles there. */
    const drape_ranks *ranks = drape_model_ranks(s->model);
    const int32_t nodes = ranks ? s->model->node_count : 0;
    for (int32_t i = 0; i < nodes; i++) /* rest is filled after this */
        s->rest[3 * (size_t)i] = s->node_area[i];
    drape_ranks_fetch(ranks, s->rest);
    for (int32_t i = 0; i < nodes; i++)
        s->node_area[i] = s->rest[3 * (size_t)i];
    for (int32_t e = 0; e < m->edge_count; e++)
        s->edge_area[e] =
            0.5 * (s->node_area[m->edge[2 * (size_t)e]] + s->node_area[m->edge[2 * (size_t)e + 1]]);
}

/* How much nearer to a round feature of radius r the middle of an edge is than its ends, which are on the
 * surface. */
static double sag(double r, double edge)
{
    const double half = 0.5 * edge;
    return half < r ? r - sqrt(r * r - half * half) : half;
}

/* Trees of what can meet something. */
static drape_status build_trees(drape_arena *arena, drape_broad_phase *s, int32_t corners, int32_t triangles)
{
    const drape_model *m = s->model;
    const bool self = m->contact.self, met = corners > 0 || self;
    const struct {
        drape_path_bvh *tree;
        int32_t count, nodes;
        const int32_t *node;
    } of[] = {{&s->nodes, self || triangles > 0 ? m->node_count : 0, 1, s->point},
              {&s->faces, met ? m->triangle_count : 0, 3, m->triangle},
              {&s->edges, met ? m->edge_count : 0, 2, m->edge},
              {&s->corners, corners, 1, s->point + m->node_count},
              {&s->segment_tree, s->segments, 2, s->segment},
              {&s->obstacles, triangles, 3, s->triangle}};
    drape_status status = DRAPE_OK;
    for (size_t i = 0; !status && i < sizeof of / sizeof *of; i++)
        status = drape_path_bvh_build(arena, of[i].count, of[i].nodes, of[i].node, s->rest, of[i].tree);
    return status;
}

drape_status drape_broad_phase_create(drape_arena *arena, const drape_model *m, drape_broad_phase *s)
{
    int32_t points, triangles;
    *s = (drape_broad_phase){.model = m};
    points = s->segments = triangles = 0;
    for (int32_t i = 0; i < m->collider_count; i++) {
        const drape_collider *c = &m->colliders[i];
        points += c->shape.point_count;
        s->segments += c->shape.segment_count;
        triangles += c->ops->smooth ? 0 : c->shape.triangle_count;
    }
    s->points = m->node_count + points;
    s->rest = drape_arena_take(arena, 3 * (size_t)s->points, sizeof *s->rest);
    s->point_collider = drape_arena_take(arena, (size_t)points, sizeof *s->point_collider);
    s->first_point = drape_arena_take(arena, (size_t)m->collider_count, sizeof *s->first_point);
    s->segment = drape_arena_take(arena, 2 * (size_t)s->segments, sizeof *s->segment);
    s->segment_collider = drape_arena_take(arena, (size_t)s->segments, sizeof *s->segment_collider);
    s->triangle = drape_arena_take(arena, 3 * (size_t)triangles, sizeof *s->triangle);
    s->triangle_collider = drape_arena_take(arena, (size_t)triangles, sizeof *s->triangle_collider);
    s->distance = drape_arena_take(arena, (size_t)m->collider_count, sizeof *s->distance);
    s->feature_most = drape_arena_take(arena, (size_t)m->collider_count, sizeof *s->feature_most);
    s->side = drape_arena_take(arena, (size_t)m->node_count, sizeof *s->side);
    s->near = drape_arena_take(arena, (size_t)m->node_count, sizeof *s->near);
    s->close = drape_arena_take(arena, (size_t)m->node_count, sizeof *s->close);
    s->near_node = drape_arena_take(arena, (size_t)m->node_count, sizeof *s->near_node);
    s->near_element = drape_arena_take(
        arena, (size_t)(m->edge_count > m->triangle_count ? m->edge_count : m->triangle_count) + 1,
        sizeof *s->near_element);
    s->marked_node = drape_arena_take(arena, (size_t)m->node_count, sizeof *s->marked_node);
    drape_elements_of_create(arena, m->triangle_count, 3, m->triangle, m->node_count, &s->faces_of);
    drape_elements_of_create(arena, m->edge_count, 2, m->edge, m->node_count, &s->edges_of);
    s->point = drape_arena_take(arena, (size_t)s->points, sizeof *s->point);
    s->corner_reach = drape_arena_take(arena, (size_t)points, sizeof *s->corner_reach);
    s->segment_reach = drape_arena_take(arena, (size_t)s->segments, sizeof *s->segment_reach);
    s->obstacle_reach = drape_arena_take(arena, (size_t)triangles, sizeof *s->obstacle_reach);
    s->node_area = drape_arena_take(arena, (size_t)m->node_count, sizeof *s->node_area);
    s->edge_area = drape_arena_take(arena, (size_t)m->edge_count, sizeof *s->edge_area);
    s->face_area = drape_arena_take(arena, (size_t)m->triangle_count, sizeof *s->face_area);
    if (drape_ranks_agree_memory(drape_model_ranks(m), arena->ctx, !drape_arena_status(arena)))
        return DRAPE_E_MEMORY;
    double edge = 0;
    for (int32_t e = 0; e < m->edge_count; e++)
        edge = fmax(edge, m->edge_length[e]);
    for (int32_t i = 0; i < m->collider_count; i++) {
        s->distance[i] = drape_collider_activation(m, i);
        s->feature_most[i] = m->colliders[i].ops->smooth
                                 ? fmax(s->distance[i], SAGS * sag(m->colliders[i].shape.radius, edge))
                                 : INFINITY;
    }
    for (int32_t i = 0; i < m->collider_count; i++)
        if (!m->colliders[i].ops->smooth)
            s->obstacle_radius = fmax(s->obstacle_radius, m->colliders[i].shape.radius);
    share_areas(s);
    list_features(s);
    drape_status status = build_trees(arena, s, points, triangles);
    if (!status)
        status = drape_distant_create(arena, m, &s->faces, &s->distant);
    if (!status && m->contact.self)
        status = drape_self_search_create(arena, m, s->rest, &s->layers);
    return status;
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
    p->distance = drape_broad_phase_feature_distance(s, collider);
}

/* ---- Searching ---- */

/* Stages of a search, after those of the smooth colliders, which have negative numbers. */
enum { OWN_FACES, OWN_EDGES, FEATURE_FACES, FEATURE_EDGES, OBSTACLES };

/* A search in progress. */
typedef struct query {
    drape_broad_phase *broad;
    const drape_broad_query *want;
    drape_broad_phase_visit *visit;
    void *user;
    drape_pair pair; /* its constants, as far as they depend on the stage alone */
} query;

static bool is_free(const drape_broad_phase *s, int32_t point)
{
    return point < s->model->node_count && s->model->free_of_node[point] >= 0;
}

static bool is_marked(const bool *marked, const int32_t *node, int nodes)
{
    for (int a = 0; marked && a < nodes; a++)
        if (marked[node[a]])
            return true;
    return !marked;
}

/* Whether the model ignores a pair. Nodes 0 and 3 are of different pieces, one of which is of cloth. */
static bool is_ignored(const drape_broad_phase *s, const drape_pair *pair)
{
    const int32_t *n = pair->node, nodes = s->model->node_count;
    return pair->collider < 0 ? drape_model_ignores_cloth(s->model, n[0], n[3])
                              : drape_model_ignores(s->model, pair->collider, n[0] < nodes ? n[0] : n[3]);
}

/* Reports a pair of a piece and of an element of a tree. */
static void report(query *q, int32_t piece, const drape_path_bvh *tree, int32_t element)
{
    const int32_t *n = q->pair.node;
    const drape_broad_phase *s = q->broad;
    if (s->model->ignored && is_ignored(s, &q->pair))
        return;
    q->pair.rank[1] = piece;
    q->pair.rank[2] = tree->place[element];
    if (is_free(s, n[0]) || is_free(s, n[1]) || is_free(s, n[2]) || is_free(s, n[3]))
        q->visit(q->user, &q->pair);
}

/* Queries of nodes and faces and of edges of cloth, which are two stages of one search. */
typedef struct self_query {
    query face, edge;
} self_query;

static void meet_own_face(void *user, int32_t node, int32_t face)
{
    query *q = &((self_query *)user)->face;
    const drape_broad_phase *s = q->broad;
    const int32_t *t = s->model->triangle + 3 * (size_t)face;
    if (drape_model_share_node(s->model, &node, 1, t, 3))
        return;
    q->pair.area = s->node_area[node];
    set_nodes(&q->pair, node, t[0], t[1], t[2]);
    if (is_marked(q->want->marked, q->pair.node, 4))
        report(q, node, &s->faces, face);
}

static void meet_own_edge(void *user, int32_t a, int32_t b)
{
    query *q = &((self_query *)user)->edge;
    const drape_broad_phase *s = q->broad;
    const int32_t first = a < b ? a : b, second = a < b ? b : a, *f = s->model->edge + 2 * (size_t)first,
                  *e = s->model->edge + 2 * (size_t)second;
    if (drape_model_share_node(s->model, e, 2, f, 2))
        return;
    q->pair.area = 0.5 * (s->edge_area[second] + s->edge_area[first]);
    set_nodes(&q->pair, f[0], f[1], e[0], e[1]);
    if (is_marked(q->want->marked, q->pair.node, 4))
        report(q, first, &s->edges, second);
}

static void meet_face(void *user, int32_t corner, int32_t face)
{
    query *q = user;
    const drape_broad_phase *s = q->broad;
    const int32_t point = s->model->node_count + corner, *t = s->model->triangle + 3 * (size_t)face;
    set_collider(s, s->point_collider[corner], &q->pair);
    set_nodes(&q->pair, point, t[0], t[1], t[2]);
    q->pair.area = s->face_area[face];
    report(q, point, &s->faces, face);
}

static void meet_edge(void *user, int32_t segment, int32_t edge)
{
    query *q = user;
    const drape_broad_phase *s = q->broad;
    const int32_t *e = s->model->edge + 2 * (size_t)edge, *f = s->segment + 2 * (size_t)segment;
    set_collider(s, s->segment_collider[segment], &q->pair);
    set_nodes(&q->pair, e[0], e[1], f[0], f[1]);
    q->pair.area = s->edge_area[edge];
    report(q, segment, &s->edges, edge);
}

static void meet_obstacle(void *user, int32_t node, int32_t triangle)
{
    query *q = user;
    const drape_broad_phase *s = q->broad;
    const int32_t *t = s->triangle + 3 * (size_t)triangle;
    set_collider(s, s->triangle_collider[triangle], &q->pair);
    set_nodes(&q->pair, node, t[0], t[1], t[2]);
    q->pair.area = s->node_area[node];
    report(q, node, &s->obstacles, triangle);
}

static void begin_stage(query *q, int32_t stage, drape_pair_kind kind)
{
    q->pair = (drape_pair){.kind = kind, .collider = -1, .rank = {stage}};
}

/* Up to which gap [m] from the features of a collider pairs are wanted, without the reach of the query. */
static double feature_reach(const drape_broad_phase *s, int32_t collider, bool passing)
{
    return drape_broad_phase_wanted(s, passing, drape_broad_phase_feature_distance(s, collider));
}

/* How far from the features of each collider contact begins. */
static void set_reaches(drape_broad_phase *s, bool passing)
{
    const struct {
        const int32_t *collider;
        double *reach;
        int32_t count;
    } of[] = {{s->point_collider, s->corner_reach, s->corners.count},
              {s->segment_collider, s->segment_reach, s->segment_tree.count},
              {s->triangle_collider, s->obstacle_reach, s->obstacles.count}};
    for (size_t i = 0; i < sizeof of / sizeof *of; i++)
        for (int32_t k = 0; k < of[i].count; k++) {
            const int32_t collider = of[i].collider[k];
            of[i].reach[k] = s->model->colliders[collider].shape.radius + feature_reach(s, collider, passing);
        }
}

/* A feature whose elements of cloth are scanned. */
typedef struct scan {
    query *query;
    int32_t feature;
    drape_path_bvh_meet *meet;
} scan;

static void scanned(void *user, int32_t element)
{
    const scan *of = user;
    of->meet(of->query, of->feature, element);
}

/* The nodes that are scanned: all of the cloth, or those of elements that have a marked node. */
typedef struct scanned_cloth {
    const int32_t *node; /* (nodes); NULL: all nodes of the model */
    int32_t nodes;
    double edge; /* [m] upper bound of the lengths of edges between them on the path */
} scanned_cloth;

static double square_of_edge(const drape_model *m, const drape_broad_query *want, int32_t edge)
{
    const double *const ends[2] = {want->x, want->y};
    const int32_t *n = m->edge + 2 * (size_t)edge;
    double largest = 0, d[3];
    for (int end = 0; end < 2 && ends[end]; end++) {
        vec3_sub(ends[end] + 3 * (size_t)n[1], ends[end] + 3 * (size_t)n[0], d);
        const double square = vec3_dot(d, d);
        largest = square > largest ? square : largest;
    }
    return largest;
}

/* All nodes. The balls around clusters are fitted, by which drape_distant_mark passes over most nodes. */
static scanned_cloth all_cloth(drape_broad_phase *s, const drape_broad_query *want)
{
    double largest = 0;
    drape_distant_fit(&s->distant, want->x, want->y);
    for (int32_t e = 0; e < s->model->edge_count; e++) {
        const double square = square_of_edge(s->model, want, e);
        largest = square > largest ? square : largest;
    }
    return (scanned_cloth){.nodes = s->model->node_count, .edge = sqrt(largest)};
}

/* Lists the nodes of some elements that are not listed yet. */
static void list_nodes(drape_broad_phase *s, const drape_path_bvh *tree, const int32_t *element,
                       int32_t elements, scanned_cloth *to)
{
    for (int32_t i = 0; i < elements; i++) {
        const int32_t *node = tree->node + (size_t)element[i] * (size_t)tree->nodes;
        for (int a = 0; a < tree->nodes; a++) {
            if (!s->near[node[a]])
                s->marked_node[to->nodes++] = node[a];
            s->near[node[a]] = true;
        }
    }
}

/* The nodes of elements that have a marked node. One edge of such a face may have no marked node; it is not
 * longer than the other two together. */
static scanned_cloth marked_cloth(drape_broad_phase *s, const drape_broad_query *want)
{
    const int32_t *face = s->faces_of.first, *edge = s->edges_of.first;
    scanned_cloth some = {.node = s->marked_node};
    double largest = 0;
    memset(s->near, 0, (size_t)s->model->node_count * sizeof *s->near);
    for (int32_t i = 0; i < s->model->node_count; i++) {
        if (!want->marked[i])
            continue;
        list_nodes(s, &s->faces, s->faces_of.element + face[i], face[i + 1] - face[i], &some);
        list_nodes(s, &s->edges, s->edges_of.element + edge[i], edge[i + 1] - edge[i], &some);
        for (int32_t e = edge[i]; e < edge[i + 1]; e++) {
            const double square = square_of_edge(s->model, want, s->edges_of.element[e]);
            largest = square > largest ? square : largest;
        }
    }
    some.edge = 2 * sqrt(largest);
    return some;
}

/* Whether a node is farther than the reach from a collider on its whole path. Then no element that has the
 * node can meet a feature, since features lie within the surface. */
static bool is_distant(const drape_broad_phase *s, const drape_broad_query *want, int32_t collider,
                       int32_t node, double reach)
{
    const double *const ends[2] = {want->x, want->y};
    bool distant = true;
    for (int end = 0; distant && end < 2 && ends[end]; end++) {
        double own[3];
        drape_pose_own(&want->pose[end][collider], ends[end] + 3 * (size_t)node, own);
        distant = drape_distant_keeps(&s->distant, collider, node, own, reach);
    }
    return distant;
}

/* The gap of the nodes of an element at which the element keeps another gap: if the square of the distance
 * from a point or a segment is at least D^2 at the corners, it is at least D^2 less a third of the square of
 * the longest edge everywhere on the element. */
static double gap_of_nodes(double radius, double gap, double edge)
{
    return sqrt((radius + gap) * (radius + gap) + edge * edge / 3) - radius;
}

/* Lists the elements all of whose nodes are near and one of which is close, each once: at the first node that
 * is both. */
static drape_path_elements list_elements(drape_broad_phase *s, const drape_path_bvh *tree,
                                         const drape_elements_of *of, int32_t points)
{
    drape_path_elements among = {.element = s->near_element, .point = s->near_node, .points = points};
    for (int32_t i = 0; i < points; i++) {
        const int32_t from = s->near_node[i];
        for (int32_t k = of->first[from]; s->close[from] && k < of->first[from + 1]; k++) {
            const int32_t e = of->element[k], *node = tree->node + (size_t)e * (size_t)tree->nodes;
            bool near = true, first = true, before = true;
            for (int a = 0; a < tree->nodes; a++) {
                near = near && s->near[node[a]];
                before = before && node[a] != from;
                first = first && !(before && s->near[node[a]] && s->close[node[a]]);
            }
            s->near_element[among.elements] = e;
            among.elements += near && first;
        }
    }
    return among;
}

static void scan_tree(query *q, const drape_path_bvh *features, int32_t feature, const double *reach,
                      const drape_path_bvh *tree, const drape_path_elements *among, drape_path_bvh_meet *meet)
{
    const drape_broad_query *want = q->want;
    const int32_t *node = features->node + (size_t)feature * (size_t)features->nodes;
    const drape_path_query from = {.node = node,
                                   .nodes = features->nodes,
                                   .x = want->x,
                                   .y = want->y,
                                   .reach = reach[feature] + want->reach,
                                   .only_marked = !is_marked(want->marked, node, features->nodes)};
    drape_path_bvh_scan(tree, &from, among, want->marked, q->broad->side, scanned, &(scan){q, feature, meet});
}

/* Finds the pairs with features of colliders that have no triangles, by a scan of the cloth near each
 * feature. */
static void scan_features(query *q)
{
    drape_broad_phase *s = q->broad;
    const drape_model *m = s->model;
    const bool *marked = q->want->marked;
    scanned_cloth all = {.edge = -1}, some = {.edge = -1}; /* -1: not listed yet */
    int32_t segment = 0;
    set_reaches(s, q->want->passing);
    for (int32_t k = 0; k < m->collider_count; k++) {
        const drape_collider_shape *shape = &m->colliders[k].shape;
        const int32_t corner = s->first_point[k] - m->node_count, last = segment + shape->segment_count;
        if (shape->point_count == 0)
            continue;
        const bool only_marked = marked && !marked[s->first_point[k]];
        scanned_cloth *of = only_marked ? &some : &all;
        if (of->edge < 0)
            *of = only_marked ? marked_cloth(s, q->want) : all_cloth(s, q->want);
        /* Marks and lists the nodes that are near or close. If the collider turns, these are all: its
         * features move straight in space, which is not straight in its coordinates. */
        const drape_broad_query *want = q->want;
        const drape_collider_pose *const pose[2] = {&want->pose[0][k], &want->pose[want->y ? 1 : 0][k]};
        const bool turns = (pose[0]->turned || pose[1]->turned) &&
                           memcmp(pose[0]->turn, pose[1]->turn, sizeof pose[0]->turn) != 0;
        const double gap = feature_reach(s, k, want->passing) + want->reach, reach = gap + of->edge,
                     close = gap_of_nodes(s->model->colliders[k].shape.radius, gap, of->edge);
        int32_t points = 0;
        if (of->node || turns)
            memset(s->near, of->node ? 0 : 1, (size_t)s->model->node_count * sizeof *s->near);
        else
            drape_distant_mark(&s->distant, k, pose, reach, s->near);
        for (int32_t i = 0; i < of->nodes; i++) {
            const int32_t node = of->node ? of->node[i] : i;
            if (!of->node && !s->near[node])
                continue;
            s->near[node] = turns || !is_distant(s, want, k, node, reach);
            s->close[node] = turns || (s->near[node] && !is_distant(s, want, k, node, close));
            s->near_node[points] = node;
            points += s->near[node];
        }
        begin_stage(q, FEATURE_FACES, DRAPE_PAIR_TRIANGLE);
        drape_path_elements among = list_elements(s, &s->faces, &s->faces_of, points);
        for (int32_t i = corner; among.elements > 0 && i < corner + shape->point_count; i++)
            scan_tree(q, &s->corners, i, s->corner_reach, &s->faces, &among, meet_face);
        begin_stage(q, FEATURE_EDGES, DRAPE_PAIR_SEGMENTS);
        among = list_elements(s, &s->edges, &s->edges_of, shape->segment_count > 0 ? points : 0);
        for (; segment < last; segment++)
            if (among.elements > 0)
                scan_tree(q, &s->segment_tree, segment, s->segment_reach, &s->edges, &among, meet_edge);
    }
}

void drape_broad_phase_pairs(drape_broad_phase *s, const drape_broad_query *want,
                             drape_broad_phase_visit *visit, void *user)
{
    query q = {.broad = s, .want = want, .visit = visit, .user = user};
    if (s->model->contact.self) {
        /* Neighbours at rest have an activation distance of at most half of their distance there
         * (drape_pair_activation_distance), unless the start is untangled. */
        const double distance = 2 * s->model->contact.self_thickness;
        const drape_self_query layers = {
            .x = want->x,
            .y = want->y,
            .reach = drape_broad_phase_wanted(s, want->passing, distance) + want->reach,
            .slack = want->passing || s->model->untangle.given ? INFINITY : want->reach,
            .rounding = s->rounding,
            .marked = want->marked};
        self_query both = {q, q};
        begin_stage(&both.face, OWN_FACES, DRAPE_PAIR_TRIANGLE);
        begin_stage(&both.edge, OWN_EDGES, DRAPE_PAIR_SEGMENTS);
        both.face.pair.distance = both.edge.pair.distance = distance;
        drape_self_search_pairs(&s->layers, &layers, meet_own_face, meet_own_edge, &both);
    }
    if (s->corners.count + s->segments <= FEW && s->obstacles.count == 0) {
        scan_features(&q);
        return;
    }
    const struct {
        drape_path_bvh *tree;
        const double *reach;
    } of[] = {{&s->nodes, NULL},
              {&s->faces, NULL},
              {&s->edges, NULL},
              {&s->corners, s->corner_reach},
              {&s->segment_tree, s->segment_reach},
              {&s->obstacles, s->obstacle_reach}};
    set_reaches(s, want->passing);
    for (size_t i = 0; i < sizeof of / sizeof *of; i++)
        drape_path_bvh_fit(of[i].tree, want->x, want->y, want->marked, of[i].reach);
    begin_stage(&q, FEATURE_FACES, DRAPE_PAIR_TRIANGLE);
    drape_path_bvh_join(&s->corners, &s->faces, q.want->y, q.want->reach, meet_face, &q);
    begin_stage(&q, FEATURE_EDGES, DRAPE_PAIR_SEGMENTS);
    drape_path_bvh_join(&s->segment_tree, &s->edges, q.want->y, q.want->reach, meet_edge, &q);
    begin_stage(&q, OBSTACLES, DRAPE_PAIR_TRIANGLE);
    drape_path_bvh_join(&s->nodes, &s->obstacles, q.want->y, q.want->reach, meet_obstacle, &q);
}
