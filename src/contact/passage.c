/* passage.c: what keeps steps from passing through: how far a way is free, and what is wrong with the end of a
 * step. See contact.h. */
#include "contact/inside.h"

#include "base/clock.h"
#include "base/vec3.h"
#include "contact/depth.h"

#include <math.h>
#include <string.h>

#define KEEP_ITERATE 0.5  /* of a gap, where an iterate of Newton is cut short */
#define KEEP_STEP    1e-3 /* of a gap: coming nearer than that on the way of a step is taken for a crossing */
#define TOUCH        1e-9 /* [m] a piece may lie this deep in a collider */
#define MARCH_SHARE  0.9
#define MOST_MARCHES 10000 /* of a node along its way */

/* ---- Ways ---- */

/* The pairs that a way might bring together. */
typedef struct journey {
    const double *x, *y; /* (points x 3) */
    double keep, way;
    bool core;
    drape_pair worst;
} journey;

/* No further than the way that another pair leaves: where forces throw nodes to the end of the world, each pair on its
 * own would come near so slowly, against its speed, that all of them together never end. */
static void follow(void *user, const drape_pair *pair)
{
    journey *j = user;
    double way = drape_pair_way(pair, j->x, j->y, j->keep, j->core, j->way);
    if (way < j->way) {
        j->way = way;
        j->worst = *pair;
    }
}

static double longest_way(const drape_contact *c, const journey *j)
{
    double most = 0;
    for (size_t i = 0; i < (size_t)c->search.points; i++) {
        double way[3];
        vec3_sub(j->y + 3 * i, j->x + 3 * i, way);
        most = fmax(most, vec3_dot(way, way));
    }
    return sqrt(most);
}

/* Straight ways: where both ends are near the last search, what is between is. Two points come nearer to each other
 * by no more than both of their ways. */
static void travel(drape_contact *c, journey *j)
{
    double moved = drape_contact_moved(c, j->x);
    if (moved > c->margin || drape_contact_moved(c, j->y) > c->margin) {
        double start = drape_clock_seconds();
        drape_search_pairs(&c->search, j->x, j->y, -c->search.most_distance, follow, j);
        c->search_seconds += drape_clock_seconds() - start;
        return;
    }
    double reach = 2 * longest_way(c, j);
    for (int32_t i = 0; i < c->count; i++)
        if (drape_pair_points(&c->pairs[i]) > 1 && drape_contact_may(&c->pairs[i], moved, reach))
            follow(j, &c->pairs[i]);
}

/* The same for nodes and surfaces: marching by the distance, which no way can outrun, until keep of the gap is
 * left. 1 from inside. */
static double march(const drape_contact *c, int32_t collider, const double *x, const double *y, double keep)
{
    const drape_collider *of = &c->model->colliders[collider];
    const drape_collider_pose *pose = &c->pose[collider];
    double gap = drape_collider_distance(of, pose, x, NULL, NULL), least = keep * gap, t = 0, p[3], at[3];
    vec3_sub(y, x, p);
    double length = vec3_norm(p);
    for (int i = 0; gap > least && length > gap - least && i < MOST_MARCHES; i++) {
        t += MARCH_SHARE * (gap - least) / length;
        if (t >= 1)
            return 1;
        memcpy(at, x, sizeof at);
        vec3_add_scaled(t, p, at);
        gap = drape_collider_distance(of, pose, at, NULL, NULL);
        if (gap < least + (1 - MARCH_SHARE) * least)
            return t;
    }
    return 1;
}

static double march_all(const drape_contact *c, const double *x, const double *y, double keep)
{
    double way = 1;
    for (int32_t k = 0; k < c->model->collider_count; k++)
        for (int32_t i = 0; c->model->colliders[k].ops->smooth && i < c->model->free_count; i++) {
            size_t at = 3 * (size_t)c->model->node_of_free[i];
            way = fmin(way, march(c, k, x + at, y + at, keep));
        }
    return way;
}

double drape_contact_way(drape_contact *c, const double *x, const double *y, double t)
{
    double start = drape_clock_seconds();
    const double span[2] = {t, t};
    drape_contact_pose(c, t, span);
    drape_contact_fill(c, x, c->from);
    drape_contact_fill(c, y, c->to);
    journey j = {.x = c->from, .y = c->to, .keep = KEEP_ITERATE, .way = 1};
    travel(c, &j);
    double share = fmin(j.way, march_all(c, x, y, KEEP_ITERATE));
    c->seconds += drape_clock_seconds() - start;
    return share;
}

bool drape_contact_crosses(drape_contact *c, const double *y, double t)
{
    double start = drape_clock_seconds();
    const double span[2] = {t, t};
    drape_contact_pose(c, t, span);
    drape_contact_fill(c, y, c->to);
    journey j = {.x = c->start, .y = c->to, .keep = KEEP_STEP, .way = 1, .core = true};
    travel(c, &j);
    c->seconds += drape_clock_seconds() - start;
    return j.way < 1;
}

/* ---- The end of a step ---- */

static drape_worst worst_of(const drape_contact *c, const drape_pair *pair, const char *what, double value,
                            double limit)
{
    drape_worst worst = {.what = what,
                         .term =
                             pair->collider >= 0 ? c->model->colliders[pair->collider].name : "self_contact",
                         .element = pair->collider >= 0 ? pair->collider : 0,
                         .node = {-1, -1, -1, -1},
                         .cloth = -1,
                         .value = value,
                         .limit = limit};
    int count = 0;
    for (int a = 0; a < 4; a++)
        if (pair->node[a] >= 0 && pair->node[a] < c->model->node_count)
            worst.node[count++] = pair->node[a];
    worst.cloth = drape_model_cloth_of(c->model, worst.node[0]);
    return worst;
}

/* A node may be where it was too deep before, but no deeper. */
static double allowed(const drape_contact *c, const drape_touch *touch)
{
    double before = touch->closest.points == 1 ? c->start_gaps[touch->pair.node[0]] : c->start_least;
    return fmin(before, -TOUCH);
}

static drape_status check_depth(drape_contact *c, const char **reason, drape_worst *worst)
{
    double most = 0;
    for (int32_t i = 0; i < c->touch_count; i++) {
        const drape_touch *touch = &c->touches[i];
        if (touch->pair.collider < 0)
            continue;
        double least = allowed(c, touch);
        if (touch->gap >= least || least - touch->gap < most)
            continue;
        most = least - touch->gap;
        *worst = worst_of(c, &touch->pair, "gap [m]", touch->gap, least);
    }
    *reason = most > 0 ? "penetration" : *reason;
    return most > 0 ? DRAPE_RETRY_REJECTED : DRAPE_OK;
}

/* Depth of an edge (two nodes) or a face (three) of cloth, now or where the step began. */
static double depth_of(const drape_contact *c, int32_t collider, const int32_t *node, int nodes, bool start)
{
    const drape_collider *of = &c->model->colliders[collider];
    const drape_collider_pose *pose = start ? &c->start_pose[collider] : &c->pose[collider];
    const double *x = start ? c->start : c->x, *corner[3], enough = start ? INFINITY : -TOUCH;
    for (int a = 0; a < nodes; a++)
        corner[a] = x + 3 * (size_t)node[a];
    return nodes == 2 ? drape_depth_edge(of, pose, corner[0], corner[1], enough)
                      : drape_depth_face(of, pose, corner, enough);
}

/* Pieces of cloth against the curved surface of a shape that lies inside of it. As deep as it was before a piece
 * may be. */
static drape_status check_inscribed(drape_contact *c, const int32_t *node, int nodes, int32_t count,
                                    const char **reason, drape_worst *worst)
{
    const drape_model *m = c->model;
    for (int32_t k = 0; k < m->collider_count; k++)
        for (int32_t i = 0; m->colliders[k].shape.inscribed && i < count; i++) {
            const int32_t *n = node + (size_t)i * (size_t)nodes;
            double depth = depth_of(c, k, n, nodes, false), least;
            if (depth >= -TOUCH || depth >= (least = fmin(depth_of(c, k, n, nodes, true), -TOUCH)))
                continue;
            drape_pair pair = {.kind = DRAPE_PAIR_SEGMENTS, .node = {n[0], n[1], -1, -1}, .collider = k};
            pair.node[2] = nodes > 2 ? n[2] : -1;
            *reason = "penetration";
            *worst = worst_of(c, &pair, "gap [m]", depth, least);
            return DRAPE_RETRY_REJECTED;
        }
    return DRAPE_OK;
}

static drape_status check_way(drape_contact *c, const char **reason, drape_worst *worst)
{
    journey j = {.x = c->start, .y = c->x, .keep = KEEP_STEP, .way = 1, .core = true};
    travel(c, &j);
    if (j.way >= 1)
        return DRAPE_OK;
    *reason = "collision";
    *worst = worst_of(c, &j.worst, "fraction of the step before passing through", j.way, 1);
    return DRAPE_RETRY_REJECTED;
}

/* Whether a node on its straight way dips into the surface although both ends are outside: marching by the
 * distance, which no way can outrun. x, y: in the collider's own coordinates. */
static bool dips(const drape_collider *collider, const double *x, const double *y)
{
    double p[3], at[3], t = 0,
                        before = collider->ops->distance(collider->values, &collider->shape, x, NULL, NULL),
                        after = collider->ops->distance(collider->values, &collider->shape, y, NULL, NULL);
    vec3_sub(y, x, p);
    double length = vec3_norm(p);
    if (before <= 0 || after <= 0 || length < before + after)
        return false;
    for (int i = 0; i < MOST_MARCHES && t < 1; i++) {
        memcpy(at, x, sizeof at);
        vec3_add_scaled(t, p, at);
        double gap = collider->ops->distance(collider->values, &collider->shape, at, NULL, NULL);
        if (gap < -TOUCH)
            return true;
        t += fmax(gap, TOUCH) / length;
    }
    return false;
}

static drape_status check_surfaces(drape_contact *c, const char **reason, drape_worst *worst)
{
    for (int32_t k = 0; k < c->model->collider_count; k++)
        for (int32_t i = 0; c->model->colliders[k].ops->smooth && i < c->model->free_count; i++) {
            size_t node = (size_t)c->model->node_of_free[i];
            double x[3], y[3];
            vec3_sub(c->start + 3 * node, c->start_pose[k].displacement, x);
            vec3_sub(c->x + 3 * node, c->pose[k].displacement, y);
            if (!dips(&c->model->colliders[k], x, y))
                continue;
            drape_pair pair = drape_search_surface(&c->search, (int32_t)node, k);
            *reason = "collision";
            *worst = worst_of(c, &pair, "node through collider", 1, 0);
            return DRAPE_RETRY_REJECTED;
        }
    return DRAPE_OK;
}

drape_status drape_contact_check(drape_contact *c, const double *x, double t, const char **reason,
                                 drape_worst *worst)
{
    double start = drape_clock_seconds();
    drape_status status = drape_contact_go(c, &(drape_contact_at){.x = x, .t = t, .span = {t, t}});
    if (!status)
        status = check_depth(c, reason, worst);
    if (!status)
        status = check_surfaces(c, reason, worst);
    if (!status)
        status = check_inscribed(c, c->model->edge, 2, c->model->edge_count, reason, worst);
    if (!status)
        status = check_inscribed(c, c->model->triangle, 3, c->model->triangle_count, reason, worst);
    if (!status)
        status = check_way(c, reason, worst);
    c->seconds += drape_clock_seconds() - start;
    return status;
}
