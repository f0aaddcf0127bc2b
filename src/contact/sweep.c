/* sweep.c: what a moving collider would sweep over in a step, moved along with it: see contact.h. */
#include "contact/parts.h"

#include "base/clock.h"
#include "base/vec3.h"
#include "contact/sweep_mesh.h"

#include <string.h>

/* Of the activation distance: nodes that a collider reaches are put there. The force that accelerates cloth
 * of areal density sigma to a speed v within a step h is K b'(y), with K = sigma (2 g L + v^2)/d, so b'(y) =
 * v d/(h (2 g L + v^2)): y is 0.7 to 1 for what moves by d and less in a step. */
#define RESTING    0.8
#define CLOSE      0.05 /* of the activation distance: how far above that a march along the path may end */
#define MAX_STEPS  50   /* of a march: where it ends the path is free */
#define MAX_PASSES 2    /* over all colliders: one may push a node towards another */

static double distance_from(const drape_collider *collider, const double *x, double *normal)
{
    return collider->ops->distance(collider->values, &collider->shape, x, normal, NULL);
}

/* Moves a node that goes from x to y, both in the collider's own coordinates, to where it slides on the
 * collider from the place at which the path comes within a distance of it. Returns whether it does. A node
 * that begins inside has no side, and stays. */
static bool slide(const drape_collider *collider, double distance, double rounding, const double *x,
                  double *y)
{
    double p[3], at[3], normal[3], t = 0;
    double gap = distance_from(collider, x, NULL);
    const double aim = fmin(gap, RESTING * distance);
    vec3_sub(y, x, p);
    const double length = vec3_norm(p);
    if (!drape_gap_has_side(gap, rounding) || !(length > gap - aim) ||
        (gap == aim && distance_from(collider, y, NULL) >= aim && length < gap))
        return false;
    memcpy(at, x, sizeof at);
    for (int i = 0; i < MAX_STEPS && gap - aim > CLOSE * distance; i++) {
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

/* Lets the nodes of y that a collider reaches slide on it; returns whether there are any. A node that its
 * surface does not hold goes where it goes. */
static bool sweep(drape_contact *c, int32_t collider, double *y)
{
    const drape_collider *k = &c->model->colliders[collider];
    const drape_collider_pose *from = &c->start_pose[collider], *to = &c->path_pose[collider];
    const double reach = c->broad.distance[collider];
    bool moved = false;
    if (c->deformed[collider])
        return false;
    for (int32_t i = 0; i < c->model->free_count; i++) {
        const int32_t node = c->model->node_of_free[i];
        const size_t at = 3 * (size_t)node;
        double a[3], b[3];
        if (drape_contact_lets_in(c, collider, &node, 1))
            continue;
        drape_pose_own(from, c->start + at, a);
        drape_pose_own(to, y + at, b);
        if (drape_distant_keeps(&c->broad.distant, collider, node, a, reach) &&
            drape_distant_keeps(&c->broad.distant, collider, node, b, reach))
            continue;
        if (!slide(k, reach, c->broad.rounding, a, b))
            continue;
        drape_pose_point(to, b, y + at);
        moved = true;
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
    const bool moved = drape_contact_sweep_meshes(c, c->to);
    memcpy(y, c->to, 3 * (size_t)c->model->node_count * sizeof *y);
    return moved;
}

void drape_contact_sweep(drape_contact *c, double t, double *y)
{
    const double start = drape_clock_seconds();
    bool moved = true;
    drape_contact_poses(c, t, c->path_pose);
    for (int pass = 0; pass < MAX_PASSES && moved; pass++) {
        moved = false;
        for (int32_t k = 0; k < c->model->collider_count; k++)
            moved = sweep(c, k, y) || moved;
        moved = sweep_meshes(c, y) || moved;
    }
    c->seconds += drape_clock_seconds() - start;
}
