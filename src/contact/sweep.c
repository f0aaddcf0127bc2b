/* sweep.c: moves cloth aside that a moving collider would sweep over in a step, and along with the collider
 * the cloth that this cloth would pass through. See contact.h. */
#include "contact/contact_parts.h"

#include "base/clock.h"
#include "base/vec3.h"

#include <string.h>

#define EDGES      0.5  /* gap to which the middle of an edge is moved, in activation distances of features */
#define CLOSE      0.05 /* how much farther away the search along a path may end, in activation distances */
#define MAX_PASSES 2    /* over all colliders: one of them may push a node towards another one */

static double distance_from(const drape_collider *collider, const double *x, double *normal)
{
    return collider->ops->distance(collider->values, &collider->shape, x, normal, NULL);
}

/* A node goes from x to y, both in the collider's own coordinates. If its path comes within a distance of the
 * surface, the node slides on the surface from there on: y becomes the place that it slides to. Returns
 * whether it slides. A node that begins inside has no side, and keeps its path. */
static bool slide(const drape_collider *collider, double distance, double rounding, const double *x,
                  double *y)
{
    double p[3], at[3], normal[3], t = 0;
    double gap = distance_from(collider, x, NULL);
    const double aim = fmin(gap, DRAPE_RESTING * distance);
    vec3_sub(y, x, p);
    const double length = vec3_norm(p);
    if (!drape_gap_has_side(gap, rounding) || !(length > gap - aim) ||
        (gap == aim && distance_from(collider, y, NULL) >= aim && length < gap))
        return false;
    memcpy(at, x, sizeof at);
    for (int i = 0; i < DRAPE_MAX_ADVANCES && gap - aim > CLOSE * distance; i++) {
        t += (gap - aim) / length;
        if (t >= 1)
            return false;
        memcpy(at, x, sizeof at);
        vec3_add_scaled(t, p, at);
        gap = distance_from(collider, at, NULL);
    }
    distance_from(collider, at, normal);
    const double inward = (1 - t) * vec3_dot(p, normal);
    if (!(inward < 0))
        return false;
    vec3_add_scaled(1 - t, p, at);
    vec3_add_scaled(-inward, normal, at);
    gap = distance_from(collider, at, normal);
    if (gap < aim)
        vec3_add_scaled(aim - gap, normal, at);
    memcpy(y, at, sizeof at);
    return true;
}

/* Where nodes slide round a moving body, the middle of an edge between them may be in the body, and nothing
 * would push it out before the end of the step. Moves both nodes of such an edge outwards. slid: (node_count)
 * the last pass in which each node slid. */
static void lift_edges(const drape_contact *c, int32_t collider, int pass, uint8_t *slid, double *y)
{
    const drape_model *m = c->model;
    const drape_collider *k = &m->colliders[collider];
    const drape_collider_pose *from = &c->start_pose[collider], *to = &c->path_pose[collider];
    const double aim = EDGES * drape_broad_phase_feature_distance(&c->broad, collider);
    for (int32_t e = 0; e < m->edge_count; e++) {
        const int32_t *n = m->edge + 2 * (size_t)e;
        const double *a = c->start + 3 * (size_t)n[0], *b = c->start + 3 * (size_t)n[1];
        double *const end[2] = {y + 3 * (size_t)n[0], y + 3 * (size_t)n[1]};
        double middle[3], own[3], normal[3];
        if ((slid[n[0]] != pass && slid[n[1]] != pass) || drape_contact_lets_in(c, collider, n, 2))
            continue;
        for (int i = 0; i < 3; i++)
            middle[i] = 0.5 * (end[0][i] + end[1][i]);
        drape_pose_own(to, middle, own);
        const double gap = distance_from(k, own, normal);
        if (gap >= aim)
            continue;
        for (int i = 0; i < 3; i++)
            middle[i] = 0.5 * (a[i] + b[i]);
        drape_pose_own(from, middle, own);
        const double lack = fmin(aim, distance_from(k, own, NULL)) - gap;
        drape_pose_direction(to, normal);
        for (int i = 0; lack > 0 && i < 2; i++)
            if (m->free_of_node[n[i]] >= 0) {
                vec3_add_scaled(lack, normal, end[i]);
                slid[n[i]] = (uint8_t)pass;
            }
    }
}

/* Lets the nodes of y that a collider reaches slide on it; returns whether there are any. Nodes that the
 * collider lets in keep their place. After the first pass only nodes that slid in the last one have another
 * place than before. */
static bool sweep(drape_contact *c, int32_t collider, int pass, uint8_t *slid, double *y)
{
    const drape_collider *k = &c->model->colliders[collider];
    const drape_collider_pose *from = &c->start_pose[collider], *to = &c->path_pose[collider];
    const double reach = c->broad.distance[collider];
    bool moved = false, *near = c->broad.near;
    if (c->deformed[collider])
        return false;
    if (pass == 1)
        drape_distant_mark(&c->broad.distant, collider, (const drape_collider_pose *const[]){from, to}, reach,
                           near);
    for (int32_t i = 0; i < c->model->free_count; i++) {
        const int32_t node = c->model->node_of_free[i];
        const size_t at = 3 * (size_t)node;
        double a[3], b[3];
        if ((!near[node] && slid[node] == 0) || slid[node] < pass - 1 ||
            drape_contact_lets_in(c, collider, &node, 1))
            continue;
        drape_pose_own(from, c->start + at, a);
        drape_pose_own(to, y + at, b);
        if (drape_distant_keeps(&c->broad.distant, collider, node, a, reach) &&
            drape_distant_keeps(&c->broad.distant, collider, node, b, reach))
            continue;
        if (!slide(k, reach, c->broad.rounding, a, b))
            continue;
        drape_pose_point(to, b, y + at);
        slid[node] = (uint8_t)pass;
        moved = true;
    }
    if (moved && drape_pose_differs(from, to))
        lift_edges(c, collider, pass, slid, y);
    return moved;
}

/* ---- Triangles that deform ---- */

/* A node that a triangle reaches stays over the triangle from then on, but may slide along it: at the end of
 * the step the node is as far from the triangle as the triangle may come. */

/* A node and the first triangle that reaches it. */
typedef struct meeting {
    drape_contact *contact;
    const double *y;
    int32_t node;
    double fraction, gap; /* step fraction at which they meet; gap at the beginning of the path [m] */
    drape_pair pair;
} meeting;

static double aim_of(const drape_pair *pair, double gap)
{
    return fmin(gap, DRAPE_RESTING * pair->distance);
}

/* The triangle that meets the node first counts, or the nearest of those that are near from the beginning
 * on. */
static void meet_triangle(void *user, int32_t triangle)
{
    meeting *m = user;
    const drape_contact *c = m->contact;
    const drape_broad_phase *broad = &c->broad;
    const int32_t *t = broad->triangle + 3 * (size_t)triangle, collider = broad->triangle_collider[triangle];
    const drape_pair pair = {.kind = DRAPE_PAIR_TRIANGLE,
                             .node = {m->node, t[0], t[1], t[2]},
                             .collider = collider,
                             .radius = broad->model->colliders[collider].shape.radius,
                             .distance = broad->distance[collider]};
    if (c->model->colliders[pair.collider].frames.frame_count == 0 ||
        drape_exempt_has(c->exempt, pair.collider, &m->node, 1))
        return;
    const drape_configuration start = {.model = c->model, .x = c->start};
    const double gap = drape_pair_gap_value(&pair, &start), rounding = c->broad.rounding,
                 aim = aim_of(&pair, gap), least = drape_pair_least_gap(&pair, rounding);
    if (!drape_gap_has_side(gap, rounding))
        return;
    double fraction = 0;
    if (aim < gap) {
        const drape_keep keep = {.rounding = rounding, .least = 1, .above = (aim - least) / (gap - least)};
        fraction = drape_pair_step_fraction(&pair, c->start, m->y, NULL, &keep, m->fraction);
    }
    if (fraction > 0 ? fraction >= m->fraction : m->fraction == 0 && gap >= m->gap)
        return;
    m->fraction = fraction;
    m->gap = gap;
    m->pair = pair;
}

/* Two unit vectors in the plane of a triangle, and its normal; false if it has no area. */
static bool frame_of(double corner[3][3], double frame[3][3])
{
    double side[3], length;
    vec3_sub(corner[1], corner[0], frame[0]);
    vec3_sub(corner[2], corner[0], side);
    vec3_cross(frame[0], side, frame[2]);
    length = vec3_norm(frame[2]);
    const double along = vec3_norm(frame[0]);
    for (int k = 0; k < 3 && length > 0; k++) {
        frame[2][k] /= length;
        frame[0][k] /= along;
    }
    vec3_cross(frame[2], frame[0], frame[1]);
    return length > 0;
}

/* The direction from the triangle to the node when they meet turns with the triangle until the end. Moves the
 * node y along it until its gap is the aim; returns whether the gap was smaller. */
static bool slide_on_triangle(const meeting *m, double *y)
{
    const double *x = m->contact->start, aim = aim_of(&m->pair, m->gap), t = m->fraction;
    double at[4][3], corner[2][3][3], frame[2][3][3], normal[3] = {0}, to[3];
    drape_closest closest;
    for (int a = 0; a < 4; a++)
        for (size_t k = 0; k < 3; k++) {
            const size_t i = 3 * (size_t)m->pair.node[a] + k;
            at[a][k] = (1 - t) * x[i] + t * m->y[i];
            if (a > 0) {
                corner[0][a - 1][k] = at[a][k];
                corner[1][a - 1][k] = m->y[i];
            }
        }
    drape_closest_point_triangle(at, &closest);
    if (!frame_of(corner[0], frame[0]) || !frame_of(corner[1], frame[1]))
        return false;
    for (int f = 0; f < 3; f++)
        vec3_add_scaled(vec3_dot(frame[0][f], closest.normal), frame[1][f], normal);
    memcpy(to, y, sizeof to);
    for (int a = 1; a < 4; a++) /* the weights of the corners are negative */
        vec3_add_scaled(closest.c[a], corner[1][a - 1], to);
    const double gap = vec3_dot(to, normal) - m->pair.radius;
    if (!(gap < aim))
        return false;
    vec3_add_scaled(aim - gap, normal, y);
    return true;
}

/* Lets the nodes of y (points x 3) slide on triangles of colliders that deform, where these reach them on
 * straight paths of all points from the beginning of the step. The points of colliders in y are those of the
 * end of the step. Returns whether any node slides. */
static bool slide_on_meshes(drape_contact *c, double *y)
{
    drape_path_bvh *tree = &c->broad.obstacles;
    double reach = c->broad.obstacle_radius;
    bool moved = false;
    for (int32_t k = 0; k < c->model->collider_count; k++)
        reach = fmax(reach, c->broad.obstacle_radius + c->broad.distance[k]);
    drape_path_bvh_fit(tree, c->start, y, NULL, NULL);
    for (int32_t f = 0; f < c->model->free_count; f++) {
        meeting m = {.contact = c, .y = y, .node = c->model->node_of_free[f], .fraction = 1, .gap = INFINITY};
        const drape_path_query query = {.node = &m.node, .nodes = 1, .x = c->start, .y = y, .reach = reach};
        drape_path_bvh_query(tree, &query, meet_triangle, &m);
        if (m.fraction < 1)
            moved = slide_on_triangle(&m, y + 3 * (size_t)m.node) || moved;
    }
    return moved;
}

static bool sweep_meshes(drape_contact *c, double *y)
{
    bool deforms = false;
    for (int32_t k = 0; k < c->model->collider_count; k++)
        deforms = deforms || drape_motion_deforms(c->motion, k);
    if (!deforms)
        return false;
    drape_contact_fill(c, y, c->path_pose, c->to);
    const bool moved = slide_on_meshes(c, c->to);
    memcpy(y, c->to, 3 * (size_t)c->model->node_count * sizeof *y);
    return moved;
}

static void sweep_all(drape_contact *c, double *y)
{
    uint8_t *slid = c->broad.side;
    bool moved = true;
    memset(slid, 0, (size_t)c->model->node_count * sizeof *slid);
    drape_distant_fit(&c->broad.distant, c->start, y);
    for (int pass = 1; pass <= MAX_PASSES && moved; pass++) {
        moved = false;
        for (int32_t k = 0; k < c->model->collider_count; k++)
            moved = sweep(c, k, pass, slid, y) || moved;
        if (sweep_meshes(c, y)) {
            memset(slid, pass, (size_t)c->model->node_count * sizeof *slid);
            moved = true;
        }
    }
}

void drape_contact_sweep(drape_contact *c, double t, double *y)
{
    const double start = drape_clock_seconds();
    drape_contact_poses(c, t, c->path_pose);
    sweep_all(c, y);
    c->seconds += drape_clock_seconds() - start;
}

/* ---- Layers ---- */

typedef struct layers {
    drape_contact *contact;
    bool meet;  /* pieces of cloth pass through each other, */
    bool grown; /* among them some that were not carried */
} layers;

/* A pair on the straight path from the beginning of the step to c->to. */
static void meet(void *user, const drape_pair *pair)
{
    layers *of = user;
    drape_contact *c = of->contact;
    const drape_keep keep = drape_contact_keep_step(c);
    if (pair->collider >= 0 || drape_pair_step_fraction(pair, c->start, c->to, NULL, &keep, 1) == 1)
        return;
    of->meet = true;
    for (int a = 0; a < 4; a++) {
        of->grown = of->grown || !c->carried[pair->node[a]];
        c->carried[pair->node[a]] = true;
    }
}

/* Whether cloth passes through cloth on its path to y. The nodes that do are added to those that are carried;
 * *grown: whether any are new. */
static bool layers_meet(drape_contact *c, const double *y, bool *grown)
{
    layers of = {.contact = c};
    *grown = false;
    /* Marks the nodes that are not where the step began. */
    bool *marked = c->moved;
    bool any = false;
    memset(marked, 0, (size_t)(c->broad.points + c->model->collider_count) * sizeof *marked);
    for (int32_t i = 0; i < c->model->free_count; i++) {
        const size_t node = (size_t)c->model->node_of_free[i];
        marked[node] = memcmp(y + 3 * node, c->start + 3 * node, 3 * sizeof *y) != 0;
        any = any || marked[node];
    }
    if (!any)
        return false;
    drape_contact_fill(c, y, c->path_pose, c->to);
    const drape_straight_path path = {{{.model = c->model, .x = c->start, .pose = c->start_pose},
                                       {.model = c->model, .x = c->to, .pose = c->path_pose}}};
    drape_candidates_find(&c->broad, &path, 0, true, c->moved, meet, &of);
    *grown = of.grown;
    return of.meet;
}

/* The rigid collider that moves and is nearest to a node at the beginning of the step; -1: there is none. */
static int32_t find_carrier(const drape_contact *c, int32_t node)
{
    int32_t carrier = -1;
    double least = INFINITY, own[3];
    for (int32_t k = 0; k < c->model->collider_count; k++) {
        if (c->deformed[k] || !drape_pose_differs(&c->start_pose[k], &c->path_pose[k]) ||
            drape_contact_lets_in(c, k, &node, 1))
            continue;
        drape_pose_own(&c->start_pose[k], c->start + 3 * (size_t)node, own);
        const double gap = distance_from(&c->model->colliders[k], own, NULL);
        carrier = gap < least ? k : carrier;
        least = gap < least ? gap : least;
    }
    return carrier;
}

void drape_contact_carry_layers(drape_contact *c, double t, double *y)
{
    const double start = drape_clock_seconds();
    const size_t size = 3 * (size_t)c->model->node_count * sizeof *y;
    drape_contact_poses(c, t, c->path_pose);
    memcpy(c->from, y, size);
    memset(c->carried, 0, (size_t)c->model->node_count * sizeof *c->carried);
    bool grown, apart = !layers_meet(c, y, &grown);
    while (!apart && grown) {
        /* Cloth that moves rigidly with a collider meets neither that nor other cloth which does. */
        for (int32_t i = 0; i < c->model->free_count; i++) {
            const int32_t node = c->model->node_of_free[i];
            const int32_t carrier = c->carried[node] ? find_carrier(c, node) : -1;
            double own[3];
            if (carrier < 0)
                continue;
            drape_pose_own(&c->start_pose[carrier], c->start + 3 * (size_t)node, own);
            drape_pose_point(&c->path_pose[carrier], own, y + 3 * (size_t)node);
        }
        sweep_all(c, y);
        apart = !layers_meet(c, y, &grown);
    }
    if (!apart)
        memcpy(y, c->from, size);
    c->seconds += drape_clock_seconds() - start;
}
