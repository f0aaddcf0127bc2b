/*
 * untangle_bodies.c: nodes and faces in closed colliders are pushed out along the signed distance. Of a face
 * that is in one between its nodes, it is the deepest of a grid of points, or the middle of where edges of
 * the collider pass through it.
 */
#include "contact/untangle_parts.h"

#include "base/elementary.h"
#include "base/vec3.h"
#include "geometry/intersect.h"

#include <string.h>

#define ACROSS 6    /* parts of a side of a face: 28 points of it are tested */
#define TOUCH  1e-9 /* [m] a point less deep than this is not inside */
#define TURN   6.283185307179586
#define DIRECTIONS 24 /* in which a face is searched around an edge that passes through it */

static double distance_at(const drape_untangler *u, int32_t collider, const double *x, double n[3])
{
    return drape_collider_distance(u->body[collider], &u->pose[collider], x, n, NULL);
}

/* Whether some of these nodes may be within reach of a collider with triangles. */
static bool is_near(const drape_untangler *u, int32_t collider, const int32_t *node, int nodes, double reach)
{
    double(*const box)[3] = u->box[collider];
    for (int k = 0; k < 3; k++) {
        double low = INFINITY, high = -INFINITY;
        for (int a = 0; a < nodes; a++) {
            low = fmin(low, u->x[3 * (size_t)node[a] + (size_t)k]);
            high = fmax(high, u->x[3 * (size_t)node[a] + (size_t)k]);
        }
        if (low > box[1][k] + reach || high < box[0][k] - reach)
            return false;
    }
    return true;
}

/* A point of a face, with these weights of its nodes, is to be at the wanted distance. */
static void push(drape_untangler *u, int32_t collider, const int32_t *node, const double *weight, int nodes,
                 double d, const double n[3])
{
    drape_half_space bound = {.node = {-1, -1, -1, -1},
                              .normal = {n[0], n[1], n[2]},
                              .bound = drape_untangle_wanted(u, u->broad.distance[collider]) - d};
    for (int a = 0; a < nodes; a++) {
        bound.node[a] = node[a];
        bound.c[a] = weight[a];
        bound.bound += weight[a] * vec3_dot(n, u->x + 3 * (size_t)node[a]);
    }
    drape_untangle_bound(u, &bound);
}

static void push_nodes(drape_untangler *u, int32_t collider)
{
    const drape_model *m = u->model;
    const double distance = u->broad.distance[collider], wanted = drape_untangle_wanted(u, distance),
                 reach = wanted + 2 * drape_untangle_stride(u);
    const drape_pair pair = {.distance = distance};
    const double least = drape_pair_least_gap(&pair, u->broad.rounding), one = 1;
    for (int32_t f = 0; f < m->free_count; f++) {
        const int32_t i = m->node_of_free[f];
        double n[3];
        if (drape_model_ignores(m, collider, i) || !is_near(u, collider, &i, 1, reach))
            continue;
        const double d = distance_at(u, collider, u->x + 3 * (size_t)i, n);
        if (d >= reach)
            continue;
        u->least_share = fmin(u->least_share, d / least);
        u->least_wanted = fmin(u->least_wanted, d / wanted);
        if (d < -TOUCH) {
            u->sunk_count++;
            u->sunk[i] = true;
        }
        push(u, collider, &i, &one, 1, d, n);
    }
}

/* ---- Faces ---- */

static void point_of(const drape_untangler *u, const int32_t *node, const double weight[3], double x[3])
{
    memset(x, 0, 3 * sizeof *x);
    for (int a = 0; a < 3; a++)
        vec3_add_scaled(weight[a], u->x + 3 * (size_t)node[a], x);
}

/* Pushes a face out at one of its points if that is in the collider. */
static void push_point(drape_untangler *u, int32_t collider, const int32_t *node, const double weight[3])
{
    double x[3], n[3];
    point_of(u, node, weight, x);
    const double d = distance_at(u, collider, x, n);
    if (!(d < -TOUCH))
        return;
    u->sunk_count++;
    for (int a = 0; a < 3; a++)
        u->sunk[node[a]] = true;
    push(u, collider, node, weight, 3, d, n);
}

static double longest_edge(const drape_untangler *u, const int32_t *node)
{
    double longest = 0, d[3];
    for (int a = 0; a < 3; a++) {
        vec3_sub(u->x + 3 * (size_t)node[a], u->x + 3 * (size_t)node[(a + 1) % 3], d);
        longest = fmax(longest, vec3_dot(d, d));
    }
    return sqrt(longest);
}

static void push_faces(drape_untangler *u, int32_t collider)
{
    const drape_model *m = u->model;
    for (int32_t f = 0; f < m->triangle_count; f++) {
        const int32_t *node = m->triangle + 3 * (size_t)f;
        double deepest = 0, at[3] = {0};
        if (drape_model_ignores(m, collider, node[0]) || !is_near(u, collider, node, 3, 0) ||
            distance_at(u, collider, u->x + 3 * (size_t)node[0], NULL) > longest_edge(u, node))
            continue;
        for (int a = 0; a <= ACROSS; a++)
            for (int b = 0; a + b <= ACROSS; b++) {
                const double weight[3] = {(double)(ACROSS - a - b) / ACROSS, (double)a / ACROSS,
                                          (double)b / ACROSS};
                double x[3];
                point_of(u, node, weight, x);
                const double d = distance_at(u, collider, x, NULL);
                if (d < deepest) {
                    deepest = d;
                    memcpy(at, weight, sizeof at);
                }
            }
        if (deepest < 0 && at[0] < 1 && at[1] < 1 && at[2] < 1) /* else it is a node */
            push_point(u, collider, node, at);
    }
}

/* ---- Edges of a collider between these points ---- */

typedef struct piercing {
    drape_untangler *u;
    const int32_t *edge; /* of the collider */
    const double *x;     /* of its points */
    int32_t *number;     /* (triangle_count) how many of its edges pass through */
    double *sum;         /* (triangle_count x 3) of the points where they do */
} piercing;

static void note_piercing(void *user, int32_t edge, int32_t triangle)
{
    piercing *p = user;
    const int32_t *node = p->u->model->triangle + 3 * (size_t)triangle;
    const double *a = p->x + 3 * (size_t)p->edge[2 * (size_t)edge],
                 *b = p->x + 3 * (size_t)p->edge[2 * (size_t)edge + 1], *o = p->u->x + 3 * (size_t)node[0];
    double v[3], w[3], n[3], oa[3], ob[3];
    vec3_sub(p->u->x + 3 * (size_t)node[1], o, v);
    vec3_sub(p->u->x + 3 * (size_t)node[2], o, w);
    vec3_cross(v, w, n);
    vec3_sub(a, o, oa);
    vec3_sub(b, o, ob);
    const double above = fabs(vec3_dot(n, oa)), below = fabs(vec3_dot(n, ob)),
                 t = above + below > 0 ? above / (above + below) : 0.5;
    vec3_add_scaled(1 - t, a, p->sum + 3 * (size_t)triangle);
    vec3_add_scaled(t, b, p->sum + 3 * (size_t)triangle);
    p->number[triangle]++;
}

static void weights_at(const drape_untangler *u, const int32_t *node, const double at[3], double weight[3])
{
    double x[4][3];
    drape_closest closest;
    memcpy(x[0], at, sizeof x[0]);
    for (int a = 0; a < 3; a++)
        memcpy(x[a + 1], u->x + 3 * (size_t)node[a], sizeof x[a + 1]);
    drape_closest_point_triangle(x, &closest);
    for (int a = 0; a < 3; a++)
        weight[a] = -closest.c[a + 1];
}

/* From a point where an edge of the collider passes through a face to the deepest point of the face around it:
 * what is inside there is a wedge of any direction. */
static void deepen(const drape_untangler *u, int32_t collider, const int32_t *node, double weight[3])
{
    double x[3], v[3], w[3], n[3];
    point_of(u, node, weight, x);
    vec3_sub(u->x + 3 * (size_t)node[1], u->x + 3 * (size_t)node[0], v);
    vec3_sub(u->x + 3 * (size_t)node[2], u->x + 3 * (size_t)node[0], w);
    vec3_cross(v, w, n);
    vec3_cross(n, v, w); /* v and w are perpendicular now, in the plane of the face */
    const double longest = longest_edge(u, node), along = vec3_norm(v), across = vec3_norm(w);
    if (!(along > 0 && across > 0))
        return;
    double d = distance_at(u, collider, x, NULL);
    for (double radius = 0.25 * longest; radius > 1e-4 * longest; radius /= 2)
        for (int k = 0; k < DIRECTIONS; k++) {
            double sine, cosine, other[3], there[3];
            drape_sin_cos(k * (TURN / DIRECTIONS), &sine, &cosine);
            memcpy(there, x, sizeof there);
            vec3_add_scaled(radius * cosine / along, v, there);
            vec3_add_scaled(radius * sine / across, w, there);
            weights_at(u, node, there, other);
            point_of(u, node, other, there);
            const double deep = distance_at(u, collider, there, NULL);
            if (!(deep < d))
                continue;
            d = deep;
            memcpy(weight, other, sizeof other);
            memcpy(x, there, sizeof there);
        }
}

static drape_status push_pierced(drape_untangler *u, int32_t collider)
{
    const drape_model *m = u->model;
    const drape_collider_shape *shape = &m->colliders[collider].shape;
    drape_arena arena = drape_arena_within(u->arena);
    piercing p = {.u = u, .edge = shape->segment, .x = u->x + 3 * (size_t)u->broad.first_point[collider]};
    p.number = drape_arena_take(&arena, (size_t)m->triangle_count, sizeof *p.number);
    p.sum = drape_arena_take(&arena, (size_t)m->triangle_count, 3 * sizeof *p.sum);
    drape_status status = drape_arena_status(&arena);
    const drape_surface edges = {.x = p.x, .edge = shape->segment, .edge_count = shape->segment_count},
                        cloth = drape_surface_of(m, u->x);
    if (!status)
        status = drape_intersect(u->ctx, &edges, &cloth, note_piercing, &p);
    for (int32_t f = 0; !status && f < m->triangle_count; f++) {
        const int32_t *node = m->triangle + 3 * (size_t)f;
        double at[3], weight[3];
        if (p.number[f] == 0 || drape_model_ignores(m, collider, node[0]))
            continue;
        for (int k = 0; k < 3; k++)
            at[k] = p.sum[3 * (size_t)f + (size_t)k] / p.number[f];
        weights_at(u, node, at, weight);
        deepen(u, collider, node, weight);
        push_point(u, collider, node, weight);
    }
    drape_arena_free(&arena);
    return status;
}

drape_status drape_untangle_bodies(drape_untangler *u)
{
    memset(u->sunk, 0, (size_t)u->model->node_count * sizeof *u->sunk);
    u->sunk_count = 0;
    for (int32_t c = 0; c < u->model->collider_count; c++) {
        if (u->open[c])
            continue;
        push_nodes(u, c);
        push_faces(u, c);
        const drape_status status = push_pierced(u, c);
        if (status)
            return status;
    }
    return u->out_of_memory ? DRAPE_E_MEMORY : DRAPE_OK;
}
