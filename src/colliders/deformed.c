/* deformed.c: see deformed.h. */
#include "colliders/deformed.h"

#include "geometry/closest.h"
#include "geometry/mesh_distance.h"

#include <math.h>
#include <string.h>

drape_status drape_deformed_create(drape_arena *arena, const drape_collider *collider, drape_deformed **out)
{
    const size_t points = (size_t)collider->shape.point_count;
    drape_deformed *d = *out = drape_arena_take(arena, 1, sizeof *d);
    double *x = drape_arena_take(arena, points, 3 * sizeof *x);
    if (!d || !x)
        return DRAPE_E_MEMORY;
    memcpy(x, collider->shape.point, 3 * points * sizeof *x);
    d->collider = *collider;
    d->collider.frames = (drape_sequence){.frame_count = 0};
    d->collider.shape.point = x;
    d->distance =
        drape_mesh_distance_create(arena, &d->collider.shape, drape_mesh_distance_side(collider->shape.kept));
    d->collider.shape.kept = d->distance;
    return d->distance ? DRAPE_OK : DRAPE_E_MEMORY;
}

void drape_deformed_move(drape_deformed *d, const double *points)
{
    const size_t size = 3 * (size_t)d->collider.shape.point_count * sizeof *points;
    if (memcmp(d->collider.shape.point, points, size) == 0)
        return;
    memcpy(d->collider.shape.point, points, size);
    drape_mesh_distance_refit(d->distance, &d->collider.shape);
}

drape_status drape_deformed_at(drape_arena *arena, const drape_model *model, const drape_motion *motion,
                               int32_t collider, double t, const drape_collider **out)
{
    const drape_collider *from = *out = &model->colliders[collider];
    drape_deformed *deformed;
    if (from->frames.frame_count == 0)
        return DRAPE_OK;
    double *x = drape_arena_take(arena, (size_t)from->shape.point_count, 3 * sizeof *x);
    const drape_status status = x ? drape_deformed_create(arena, from, &deformed) : DRAPE_E_MEMORY;
    if (status)
        return status;
    if (motion)
        drape_motion_points(motion, collider, t, x);
    else
        drape_sequence_points(&from->frames, t, x);
    drape_deformed_move(deformed, x);
    *out = &deformed->collider;
    return DRAPE_OK;
}

int32_t drape_deformed_nearest(const drape_motion *motion, int32_t collider, double t, const double x[3])
{
    const drape_collider *c = &motion->model->colliders[collider];
    drape_collider_pose pose;
    drape_closest at;
    double points[4][3], corner[9], best = INFINITY;
    int32_t nearest = -1;
    drape_motion_pose(motion, collider, t, t, &pose);
    drape_pose_own(&pose, x, points[0]);
    for (int32_t k = 0; c->frames.frame_count > 0 && k < c->shape.triangle_count; k++) {
        drape_deformation_corners(&motion->deformation[collider], c->shape.triangle + 3 * (size_t)k, t,
                                  corner);
        memcpy(points[1], corner, sizeof corner);
        drape_closest_point_triangle(points, &at);
        if (at.distance < best) {
            best = at.distance;
            nearest = k;
        }
    }
    return nearest;
}
