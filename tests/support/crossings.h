/*
 * crossings.h: counts what contact must not let happen, by code of its own: edges of cloth through
 * triangles of cloth, edges of cloth through triangles of colliders, edges and axes of colliders through
 * triangles of cloth, and nodes and points of faces inside a collider. It shares nothing with the library
 * but the mesh, the poses and the distance of a point from a collider, which entries/colliders compares
 * with brute force. Parts of cloth whose nodes are all pinned do not count, nor do those with a
 * pinned node inside the collider: pins follow their tracks, wherever these lead.
 */
#ifndef DRAPE_TESTS_CROSSINGS_H
#define DRAPE_TESTS_CROSSINGS_H

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "colliders/colliders.h"

#define CROSSINGS_CUTS  6    /* intervals along a side: a face is sampled at 28 points, with its corners */
#define CROSSINGS_DEPTH 2e-9 /* [m] contact allows 1e-9; the rest is for rounding, here and there */

typedef struct crossings {
    int64_t cloth;     /* edges of cloth through triangles of cloth */
    int64_t colliders; /* edges of either through triangles of the other */
    int64_t inside;    /* nodes and faces of cloth with a point inside a collider */
    double depth;      /* [m] of the deepest of these points */
    char first[128];   /* the first crossing; "": none */
} crossings;

static inline int64_t crossings_total(const crossings *c)
{
    return c->cloth + c->colliders + c->inside;
}

/* ---- One edge and one triangle ---- */

/* The widest numbers that the compiler has: 113 bits, in software on most processors. */
#ifdef __SIZEOF_FLOAT128__
__extension__ typedef __float128 crossings_wide;
#define CROSSINGS_WIDE_EPSILON 0x1p-112
#else
typedef long double crossings_wide;
#define CROSSINGS_WIDE_EPSILON LDBL_EPSILON
#endif

/* The sign of the volume of a b c d in numbers of one type, or 0 if it is uncertain. Differences of doubles,
 * products and sums each add less than the type's epsilon of their size; there are fewer than 32 of them. */
#define CROSSINGS_SIDE(type, epsilon)                                                                        \
    type u[3], v[3], w[3], lu = 0, lv = 0, lw = 0;                                                           \
    for (int k = 0; k < 3; k++) {                                                                            \
        u[k] = (type)b[k] - a[k];                                                                            \
        v[k] = (type)c[k] - a[k];                                                                            \
        w[k] = (type)d[k] - a[k];                                                                            \
        lu += u[k] < 0 ? -u[k] : u[k];                                                                       \
        lv += v[k] < 0 ? -v[k] : v[k];                                                                       \
        lw += w[k] < 0 ? -w[k] : w[k];                                                                       \
    }                                                                                                        \
    const type volume = w[0] * (u[1] * v[2] - u[2] * v[1]) + w[1] * (u[2] * v[0] - u[0] * v[2]) +            \
                        w[2] * (u[0] * v[1] - u[1] * v[0]);                                                  \
    const type uncertain = 32 * (type)(epsilon)*lu * lv * lw;                                                \
    return volume > uncertain ? 1 : volume < -uncertain ? -1 : 0;

static inline int crossings_side_wide(const double *a, const double *b, const double *c, const double *d)
{
    CROSSINGS_SIDE(crossings_wide, CROSSINGS_WIDE_EPSILON)
}

static inline int crossings_side_fast(const double *a, const double *b, const double *c, const double *d)
{
    CROSSINGS_SIDE(long double, LDBL_EPSILON)
}

static inline int crossings_side(const double *a, const double *b, const double *c, const double *d)
{
    const int side = crossings_side_fast(a, b, c, d);
    return side ? side : crossings_side_wide(a, b, c, d);
}

/* Whether the ends of p q are on different sides of the plane of a b c, and the line through them passes
 * through the inside of the triangle. What is uncertain does not count. */
static inline bool crossings_pierces(const double *p, const double *q, const double *a, const double *b,
                                     const double *c)
{
    if (crossings_side(a, b, c, p) * crossings_side(a, b, c, q) >= 0)
        return false;
    const int side = crossings_side(p, q, a, b);
    return side && side == crossings_side(p, q, b, c) && side == crossings_side(p, q, c, a);
}

/* ---- All edges and triangles ---- */

/* Elements of `nodes` nodes over positions. */
typedef struct crossings_set {
    const double *x;
    const int32_t *node;
    int32_t count;
    int nodes;
    const uint8_t *pinned; /* of the nodes; NULL: none is free */
    const uint8_t *caught; /* pinned nodes inside the collider; NULL: none */
} crossings_set;

typedef struct crossings_box {
    double low[3], high[3];
    int32_t element;
} crossings_box;

static inline crossings_box crossings_box_of(const crossings_set *set, int32_t element)
{
    crossings_box box = {.element = element};
    for (int k = 0; k < 3; k++) {
        box.low[k] = INFINITY;
        box.high[k] = -INFINITY;
        for (int a = 0; a < set->nodes; a++) {
            const double at = set->x[3 * (size_t)set->node[element * set->nodes + a] + (size_t)k];
            box.low[k] = fmin(box.low[k], at);
            box.high[k] = fmax(box.high[k], at);
        }
    }
    return box;
}

static inline int crossings_order(const void *a, const void *b)
{
    const double p = ((const crossings_box *)a)->low[0], q = ((const crossings_box *)b)->low[0];
    return p < q ? -1 : p > q;
}

static inline bool crossings_meet(const crossings_box *a, const crossings_box *b)
{
    for (int k = 0; k < 3; k++)
        if (a->low[k] > b->high[k] || b->low[k] > a->high[k])
            return false;
    return true;
}

static inline bool crossings_free(const crossings_set *set, int32_t element)
{
    bool free = false;
    for (int a = 0; set->pinned && a < set->nodes; a++) {
        const int32_t node = set->node[element * set->nodes + a];
        if (set->caught && set->caught[node])
            return false;
        free = free || !set->pinned[node];
    }
    return free;
}

static inline bool crossings_apply(const crossings_set *edges, int32_t e, const crossings_set *faces,
                                   int32_t f)
{
    const int32_t *n = edges->node + 2 * e, *m = faces->node + 3 * f;
    for (int i = 0; edges->x == faces->x && i < 6; i++)
        if (n[i % 2] == m[i / 2])
            return false;
    return crossings_free(edges, e) || crossings_free(faces, f);
}

static inline void crossings_name(char name[128], const char *what, const crossings_set *edges, int32_t e,
                                  const crossings_set *faces, int32_t f)
{
    const int32_t *n = edges->node + 2 * e, *m = faces->node + 3 * f;
    if (!name[0])
        snprintf(name, 128, "%s: edge %d %d, triangle %d %d %d", what, (int)n[0], (int)n[1], (int)m[0],
                 (int)m[1], (int)m[2]);
}

/* Counts the edges that pass through triangles: those whose boxes overlap, found in the order of their lowest
 * x. */
static inline int64_t crossings_between(const crossings_set *edges, const crossings_set *faces,
                                        const char *what, char name[128])
{
    crossings_box *box = malloc(((size_t)faces->count + 1) * sizeof *box);
    double widest = 0;
    int64_t count = 0;
    if (!box)
        abort();
    for (int32_t f = 0; f < faces->count; f++) {
        box[f] = crossings_box_of(faces, f);
        widest = fmax(widest, box[f].high[0] - box[f].low[0]);
    }
    qsort(box, (size_t)faces->count, sizeof *box, crossings_order);
    for (int32_t e = 0; e < edges->count; e++) {
        const crossings_box own = crossings_box_of(edges, e);
        int32_t low = 0, high = faces->count;
        while (low < high) { /* the first that may reach the edge */
            const int32_t middle = low + (high - low) / 2;
            if (box[middle].low[0] + widest < own.low[0])
                low = middle + 1;
            else
                high = middle;
        }
        for (int32_t i = low; i < faces->count && box[i].low[0] <= own.high[0]; i++) {
            const int32_t f = box[i].element, *n = edges->node + 2 * e, *m = faces->node + 3 * f;
            if (!crossings_meet(&own, &box[i]) || !crossings_apply(edges, e, faces, f) ||
                !crossings_pierces(edges->x + 3 * n[0], edges->x + 3 * n[1], faces->x + 3 * m[0],
                                   faces->x + 3 * m[1], faces->x + 3 * m[2]))
                continue;
            count++;
            crossings_name(name, what, edges, e, faces, f);
        }
    }
    free(box);
    return count;
}

/* ---- One collider ---- */

/* Edges of the collider: its segments and those of its triangles, each once, as its surface is closed. */
static inline int32_t *crossings_edges_of(const drape_collider_shape *shape, int32_t *count)
{
    int32_t *edge = malloc((size_t)(shape->segment_count + 3 * shape->triangle_count + 1) * 2 * sizeof *edge);
    if (!edge)
        abort();
    *count = shape->triangle_count > 0 ? 0 : shape->segment_count;
    if (*count > 0)
        memcpy(edge, shape->segment, 2 * (size_t)*count * sizeof *edge);
    for (int32_t i = 0; i < 3 * shape->triangle_count; i++) {
        const int32_t a = shape->triangle[i], b = shape->triangle[i % 3 == 2 ? i - 2 : i + 1];
        if (a < b) {
            edge[2 * *count] = a;
            edge[2 * (*count)++ + 1] = b;
        }
    }
    return edge;
}

static inline void crossings_collider(const drape_collider *collider, const drape_collider_pose *pose,
                                      const crossings_set *edges, const crossings_set *faces,
                                      crossings *found)
{
    const drape_collider_shape *shape = &collider->shape;
    double *point = malloc(((size_t)shape->point_count + 1) * 3 * sizeof *point);
    if (!point)
        abort();
    for (int32_t i = 0; i < shape->point_count; i++)
        drape_collider_point(collider, pose, i, point + 3 * (size_t)i);
    crossings_set own_edges = {.x = point, .nodes = 2},
                  own_faces = {
                      .x = point, .nodes = 3, .node = shape->triangle, .count = shape->triangle_count};
    int32_t *edge = crossings_edges_of(shape, &own_edges.count);
    own_edges.node = edge;
    found->colliders += crossings_between(edges, &own_faces, "cloth's edge in collider", found->first);
    found->colliders += crossings_between(&own_edges, faces, "collider's edge in cloth", found->first);
    free(edge);
    free(point);
}

/* The deepest of the samples of a face. */
static inline double crossings_face_depth(const drape_collider *collider, const drape_collider_pose *pose,
                                          const double *x, const int32_t *node)
{
    double deepest = -INFINITY, p[3];
    for (int i = 0; i <= CROSSINGS_CUTS; i++)
        for (int j = 0; i + j <= CROSSINGS_CUTS; j++) {
            const double u = (double)i / CROSSINGS_CUTS, v = (double)j / CROSSINGS_CUTS;
            for (int k = 0; k < 3; k++)
                p[k] = (1 - u - v) * x[3 * node[0] + k] + u * x[3 * node[1] + k] + v * x[3 * node[2] + k];
            deepest = fmax(deepest, -drape_collider_distance(collider, pose, p, NULL, NULL));
        }
    return deepest;
}

static inline void crossings_depths(const drape_collider *collider, const drape_collider_pose *pose,
                                    const crossings_set *faces, crossings *found)
{
    for (int32_t f = 0; f < faces->count; f++) {
        if (!crossings_free(faces, f))
            continue;
        const int32_t *node = faces->node + 3 * f;
        const double depth = crossings_face_depth(collider, pose, faces->x, node);
        if (depth <= CROSSINGS_DEPTH)
            continue;
        found->inside++;
        found->depth = fmax(found->depth, depth);
        if (!found->first[0])
            snprintf(found->first, sizeof found->first, "triangle %d %d %d is %.3g m inside %s", (int)node[0],
                     (int)node[1], (int)node[2], depth, collider->name);
    }
}

/* Cloth at x (node_count x 3), colliders on their tracks at time t. Cloth may pass through cloth in a scene
 * without self-contact. */
static inline crossings crossings_count(const drape_model *m, const double *x, double t)
{
    crossings_set edges = {x, m->edge, m->edge_count, 2, m->pinned, NULL},
                  faces = {x, m->triangle, m->triangle_count, 3, m->pinned, NULL};
    crossings found = {0};
    if (m->contact.self)
        found.cloth = crossings_between(&edges, &faces, "cloth in cloth", found.first);
    uint8_t *caught = malloc((size_t)m->node_count);
    if (!caught)
        abort();
    edges.caught = faces.caught = caught;
    for (int32_t k = 0; k < m->collider_count; k++) {
        const drape_collider *collider = &m->colliders[k];
        const drape_collider_pose pose = drape_collider_pose_at(collider, t);
        for (int32_t i = 0; i < m->node_count; i++)
            caught[i] =
                m->pinned[i] && drape_collider_distance(collider, &pose, x + 3 * (size_t)i, NULL, NULL) < 0;
        crossings_collider(collider, &pose, &edges, &faces, &found);
        crossings_depths(collider, &pose, &faces, &found);
    }
    free(caught);
    return found;
}

/* ---- A run ---- */

/* An observer's memory: the counts over all accepted states and all frames. */
typedef struct crossings_run {
    int64_t states, frames, crossed_states, crossed_frames; /* those with any crossing */
    int64_t cloth, colliders, inside;                       /* the largest numbers in one of them */
    double depth, first_time;                               /* [m]; [s] of the first crossing */
    char first[128];                                        /* the first crossing */
} crossings_run;

static inline void crossings_add(crossings_run *run, const drape_model *m, const double *x, double t,
                                 int64_t *states, int64_t *crossed)
{
    const crossings found = crossings_count(m, x, t);
    ++*states;
    if (crossings_total(&found) == 0)
        return;
    ++*crossed;
    run->cloth = found.cloth > run->cloth ? found.cloth : run->cloth;
    run->colliders = found.colliders > run->colliders ? found.colliders : run->colliders;
    run->inside = found.inside > run->inside ? found.inside : run->inside;
    run->depth = fmax(run->depth, found.depth);
    if (!run->first[0]) {
        memcpy(run->first, found.first, sizeof run->first);
        run->first_time = t;
    }
}

/* An observer of drape_sim_observe; user: a crossings_run. */
static inline drape_status crossings_observe(void *user, const drape_event *event)
{
    crossings_run *run = user;
    const drape_model *m = drape_sim_model(event->sim);
    if (event->kind == DRAPE_EVENT_FRAME)
        crossings_add(run, m, event->positions, event->time, &run->frames, &run->crossed_frames);
    else if (event->attempt->accepted)
        crossings_add(run, m, drape_sim_positions(event->sim), drape_sim_time(event->sim), &run->states,
                      &run->crossed_states);
    return DRAPE_OK;
}

#endif
