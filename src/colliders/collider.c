/* collider.c: see colliders.h. */
#include "colliders/colliders.h"

#include "base/param.h"
#include "model/track.h"

drape_collider_pose drape_collider_pose_at(const drape_collider *collider, double t)
{
    drape_collider_pose pose = {.t = t};
    double displacement[3], velocity[3], rotation[9], spin[3];
    drape_track_displacement(collider->track.keys, collider->track.key_count, t, displacement);
    drape_track_velocity(collider->track.keys, collider->track.key_count, t, velocity);
    drape_turns_rotation(&collider->turns, t, rotation);
    drape_turns_velocity(&collider->turns, t, spin);
    drape_pose_about(&pose, collider->pivot, rotation, displacement, velocity, spin);
    return pose;
}

void drape_collider_point(const drape_collider *collider, const drape_collider_pose *pose, int32_t point,
                          double *x)
{
    drape_pose_point(pose, collider->shape.point + 3 * (size_t)point, x);
}

void drape_collider_point_velocity(const drape_collider *collider, const drape_collider_pose *pose,
                                   int32_t point, double *v)
{
    double x[3];
    drape_collider_point(collider, pose, point, x);
    drape_pose_velocity(pose, x, v);
}

double drape_collider_distance(const drape_collider *collider, const drape_collider_pose *pose,
                               const double *x, double *normal, double *curvature)
{
    double own[3];
    drape_pose_own(pose, x, own);
    const double d = collider->ops->distance(collider->values, &collider->shape, own, normal, curvature);
    if (normal)
        drape_pose_direction(pose, normal);
    if (curvature)
        drape_pose_tensor(pose, curvature);
    return d;
}

drape_status drape_collider_build(drape_context *ctx, drape_arena *arena, const char *pointer,
                                  const char *folder, double tolerance, drape_collider *collider)
{
    const drape_collider_ops *ops = collider->ops;
    struct drape_shape_builder builder = {
        .ctx = ctx, .arena = arena, .pointer = pointer, .folder = folder, .choice = &collider->choice};
    drape_status status = drape_params_resolve(ctx, pointer, &ops->entry, collider->choice.settings,
                                               collider->choice.setting_count, collider->values);
    if (status)
        return status;
    collider->shape = (drape_collider_shape){.builder = &builder, .user = collider->ops->user};
    ctx->message[0] = 0;
    status = ops->shape(collider->values, tolerance, &collider->shape);
    collider->shape.builder = NULL;
    collider->frames = builder.frames;
    return drape_fail_unsaid(ctx, status, pointer, "shape() of \"%s\" returned %s", ops->entry.name,
                             drape_status_name(status));
}
