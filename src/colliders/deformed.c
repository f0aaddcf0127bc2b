/* deformed.c: see deformed.h. */
#include "colliders/deformed.h"

#include "geometry/mesh_distance.h"
#include "geometry/nearest.h"

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

drape_status drape_deformed_nearest(drape_context *ctx, const drape_motion *motion, int32_t collider,
                                    double t, int32_t count, const int32_t *nodes, const double *x,
                                    int32_t *triangles)
{
    const drape_collider *c = &motion->model->colliders[collider];
    drape_arena arena = drape_arena_of(ctx);
    drape_collider_pose pose;
    drape_bvh tree = {.count = 0};
    double *points = NULL;
    drape_status status = DRAPE_OK;
    drape_motion_pose(motion, collider, t, t, &pose);
    if (count > 0 && c->frames.frame_count > 0) {
        points = drape_arena_take(&arena, (size_t)c->shape.point_count, 3 * sizeof *points);
        status = drape_arena_status(&arena);
        if (!status)
            drape_motion_points(motion, collider, t, points);
        if (!status)
            status = drape_bvh_build(&arena, c->shape.triangle_count, 3, c->shape.triangle, points, &tree);
        if (!status)
            drape_bvh_fit(&tree, points);
    }
    for (int32_t i = 0; !status && i < count; i++) {
        double own[3];
        drape_pose_own(&pose, x + 3 * (size_t)nodes[i], own);
        triangles[i] = drape_nearest_on(&tree, points, own, INFINITY).triangle;
        status = drape_check_cancel_after(ctx, 64 + (size_t)tree.count);
    }
    drape_arena_free(&arena);
    return status;
}
