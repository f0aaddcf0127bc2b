/* sweep_mesh.c: see sweep_mesh.h. A node that a triangle reaches keeps its place over it from then on, but
 * for what it moves along it: at the end of the step it is as far from the triangle as the triangle may
 * come. */
#include "contact/sweep_mesh.h"

#include "base/vec3.h"
#include "contact/parts.h"

#include <string.h>

/* A node and the first triangle that reaches it. */
typedef struct meeting {
    drape_contact *contact;
    const double *y;
    int32_t node;
    double fraction, gap; /* of the path; at its beginning [m] */
    drape_pair pair;
} meeting;

static double aim_of(const drape_pair *pair, double gap)
{
    return fmin(gap, DRAPE_RESTING * pair->distance);
}

/* Of triangles that are near from the beginning on, the nearest counts. */
static void meet(void *user, int32_t triangle)
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

/* Two unit vectors in the plane of a triangle, and its normal; false if it has none. */
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
 * end of the node along it; returns whether it had to. */
static bool slide(const meeting *m, double *y)
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

bool drape_contact_sweep_meshes(drape_contact *c, double *y)
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
        drape_path_bvh_query(tree, &query, meet, &m);
        if (m.fraction < 1)
            moved = slide(&m, y + 3 * (size_t)m.node) || moved;
    }
    return moved;
}
