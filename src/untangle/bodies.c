/*
 * bodies.c: nodes and faces in closed colliders are pushed out along the signed distance. A piece of
 * cloth that is inside by a quarter or more would be torn where its nodes leave in different directions: it
 * leaves in one. Of a face that is in a collider between its nodes, it is the deepest of a grid of points, or
 * the middle of where edges of the collider pass through it.
 */
#include "untangle/workspace.h"

#include "base/elementary.h"
#include "base/pi.h"
#include "geometry/intersect.h"

#include <string.h>

#define ACROSS     6   /* parts of a side of a face: 28 points of it are tested */
#define AGREE      0.5 /* cosine of the angle to their mean within which directions tear nothing */
#define DIRECTIONS 24  /* in which a face is searched around an edge that passes through it */

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

/* Adds the bound that a point of a face, with these weights of its nodes, is at the wanted distance. */
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

/* ---- Nodes ---- */

/* The length of the path in a direction from a point of the piece of a node to outside of all bodies;
 * infinite if it does not lead out. */
static double exit_length(const drape_untangler *u, int32_t node, const double *x, const double direction[3])
{
    double length = 0;
    for (int k = 0; k < DRAPE_MAX_ADVANCES; k++) {
        double p[3] = {x[0], x[1], x[2]};
        vec3_add_scaled(length, direction, p);
        /* The signed distance of a point from all bodies that a node does not ignore, as far as it is in
         * one. */
        double d = 0;
        for (int32_t c = 0; c < u->model->collider_count; c++) {
            double(*const box)[3] = u->box[c];
            bool within = !u->open[c] && !drape_model_ignores(u->model, c, node);
            for (int i = 0; i < 3; i++)
                within = within && p[i] >= box[0][i] && p[i] <= box[1][i];
            if (within)
                d = fmin(d, distance_at(u, c, p, NULL));
        }
        if (d >= -u->broad.rounding)
            return length;
        length -= d;
    }
    return INFINITY;
}

static bool is_in(const drape_untangler *u, int32_t node, int32_t piece)
{
    return u->piece[node] == piece && u->depth[node] < -u->broad.rounding;
}

/* Chooses a direction if the longest path of a node out along it is shorter than along those tried before. */
static void try_direction(const drape_untangler *u, int32_t piece, const double v[3], double *shortest,
                          drape_untangle_exit *out)
{
    const double norm = vec3_norm(v);
    double direction[3], longest = 0;
    if (!(norm > 0))
        return;
    for (int k = 0; k < 3; k++)
        direction[k] = v[k] / norm;
    for (int32_t i = 0; i < u->model->node_count && longest < *shortest; i++)
        if (is_in(u, i, piece))
            longest = fmax(longest, exit_length(u, i, u->x + 3 * (size_t)i, direction));
    if (!(longest < *shortest))
        return;
    *shortest = longest;
    out->chosen = true;
    memcpy(out->direction, direction, sizeof direction);
}

/* Chooses the exit of a piece that is inside, unless the directions of its nodes agree. Tried are the mean of
 * these directions, that of the least deep node, and both sides of the sheet, to which it needs no room
 * sideways. */
static void choose_exit(drape_untangler *u, int32_t piece, drape_untangle_exit *out)
{
    const drape_model *m = u->model;
    double mean[3] = {0}, normal[3] = {0}, back[3], shortest = INFINITY;
    bool agree = true;
    int32_t least = -1;
    for (int32_t i = 0; i < m->node_count; i++) {
        if (!is_in(u, i, piece))
            continue;
        vec3_add_scaled(1, u->outward + 3 * (size_t)i, mean);
        if (least < 0 || u->depth[i] > u->depth[least])
            least = i;
    }
    for (int32_t i = 0; i < m->node_count; i++)
        agree = agree &&
                (!is_in(u, i, piece) || vec3_dot(u->outward + 3 * (size_t)i, mean) > AGREE * vec3_norm(mean));
    if (agree)
        return;
    for (int32_t f = 0; f < m->triangle_count; f++)
        if (u->piece[m->triangle[3 * (size_t)f]] == piece) {
            double n[3];
            vec3_triangle_area(m->triangle + 3 * (size_t)f, u->x, n);
            vec3_add_scaled(1, n, normal);
        }
    for (int k = 0; k < 3; k++)
        back[k] = -normal[k];
    try_direction(u, piece, normal, &shortest, out);
    try_direction(u, piece, back, &shortest, out);
    try_direction(u, piece, u->outward + 3 * (size_t)least, &shortest, out);
    try_direction(u, piece, mean, &shortest, out);
}

/* An exit that was chosen holds until the whole piece is out. */
static drape_status choose_exits(drape_untangler *u)
{
    drape_arena arena = drape_arena_within(u->arena);
    int32_t *in = drape_arena_take(&arena, (size_t)u->piece_count, sizeof *in),
            *out = drape_arena_take(&arena, (size_t)u->piece_count, sizeof *out);
    const drape_status status = drape_arena_status(&arena);
    for (int32_t i = 0; !status && i < u->model->node_count; i++) {
        if (!(u->mobility[i] > 0))
            out[u->piece[i]] = u->model->node_count; /* it stays */
        else if (u->depth[i] < -u->broad.rounding)
            in[u->piece[i]]++;
        else
            out[u->piece[i]]++;
    }
    for (int32_t k = 0; !status && k < u->piece_count; k++) {
        drape_untangle_exit *leave = &u->exit[k];
        leave->chosen = leave->chosen && in[k] > 0;
        if (!leave->chosen && 3 * in[k] > out[k])
            choose_exit(u, k, leave);
    }
    drape_arena_free(&arena);
    return status;
}

/* If the piece of a node has an exit that leads out from x, a point of the piece in a body, sets n to the
 * direction of the exit, and d to the signed distance along it. */
static void turn_to_exit(const drape_untangler *u, int32_t node, const double *x, double *d, double n[3])
{
    const drape_untangle_exit *leave = &u->exit[u->piece[node]];
    const double length = leave->chosen ? exit_length(u, node, x, leave->direction) : INFINITY;
    if (!isfinite(length))
        return;
    *d = -length;
    memcpy(n, leave->direction, sizeof leave->direction);
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
        double d = distance_at(u, collider, u->x + 3 * (size_t)i, n);
        if (d >= reach)
            continue;
        u->min_share = fmin(u->min_share, d / least);
        u->min_wanted = fmin(u->min_wanted, d / wanted);
        if (d < -u->broad.rounding) {
            u->sunk_count++;
            u->sunk[i] = true;
            turn_to_exit(u, i, u->x + 3 * (size_t)i, &d, n);
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
    double d = distance_at(u, collider, x, n);
    if (!(d < -u->broad.rounding))
        return;
    turn_to_exit(u, node[0], x, &d, n);
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
    double n[3], oa[3], ob[3];
    vec3_triangle_area(node, p->u->x, n);
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

/* Moves from a point where an edge of the collider passes through a face to the deepest point of the face
 * around it, by a pattern search: the part of the face that is inside there is a wedge of unknown
 * direction. */
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
            drape_sin_cos(k * (2 * DRAPE_PI / DIRECTIONS), &sine, &cosine);
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
    /* The depth of each node in the body in which it is deepest, and the gradient of the distance there. */
    const drape_model *m = u->model;
    for (int32_t i = 0; i < m->node_count; i++)
        u->depth[i] = 0;
    for (int32_t c = 0; c < m->collider_count; c++)
        for (int32_t i = 0; i < m->node_count && !u->open[c]; i++) {
            double n[3];
            if (drape_model_ignores(m, c, i) || !is_near(u, c, &i, 1, 0))
                continue;
            const double d = distance_at(u, c, u->x + 3 * (size_t)i, n);
            if (!(d < u->depth[i]))
                continue;
            u->depth[i] = d;
            memcpy(u->outward + 3 * (size_t)i, n, sizeof n);
        }
    drape_status status = choose_exits(u);
    for (int32_t c = 0; !status && c < u->model->collider_count; c++) {
        if (u->open[c])
            continue;
        push_nodes(u, c);
        push_faces(u, c);
        status = push_pierced(u, c);
    }
    return status ? status : u->out_of_memory ? DRAPE_E_MEMORY : DRAPE_OK;
}
