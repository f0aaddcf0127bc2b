/* collider.c: see colliders.h. */
#include "colliders/colliders.h"

#include "base/param.h"
#include "base/vec3.h"
#include "model/track.h"

drape_collider_pose drape_collider_pose_at(const drape_collider *collider, double t)
{
    drape_collider_pose pose = {{0}, {0}};
    const drape_track *track = &collider->track;
    if (track->key_count > 0) {
        drape_track_displacement(track->keys, track->key_count, t, pose.displacement);
        drape_track_velocity(track->keys, track->key_count, t, pose.velocity);
    }
    return pose;
}

double drape_collider_distance(const drape_collider *collider, const drape_collider_pose *pose,
                               const double *x, double *normal, double *curvature)
{
    double own[3];
    vec3_sub(x, pose->displacement, own);
    return collider->ops->distance(collider->values, &collider->shape, own, normal, curvature);
}

#define SAME_AXIS 1e-9 /* sine of the angle between directions that count as the same */

void drape_turned_point(const double *rotation, const double *x, double *shift)
{
    for (int k = 0; k < 3; k++)
        shift[k] = vec3_dot(rotation + 3 * k, x) - x[k];
}

bool drape_turned_axis(const double *rotation, const double *axis, const double *to, bool flip)
{
    double turned[3], across[3];
    for (int k = 0; k < 3; k++)
        turned[k] = vec3_dot(rotation + 3 * k, axis);
    vec3_cross(to, turned, across);
    return vec3_norm(across) <= SAME_AXIS && (flip || vec3_dot(to, turned) > 0);
}

drape_status drape_collider_build(drape_context *ctx, drape_arena *arena, const char *pointer,
                                  const char *folder, double tolerance, drape_collider *collider)
{
    const drape_collider_ops *ops = collider->ops;
    struct drape_shape_builder builder = {
        .ctx = ctx, .arena = arena, .pointer = pointer, .folder = folder, .choice = &collider->choice};
    drape_status status =
        drape_params_resolve(ctx, pointer, ops->entry.params, ops->entry.param_count,
                             collider->choice.settings, collider->choice.setting_count, collider->values);
    if (status)
        return status;
    collider->shape = (drape_collider_shape){.builder = &builder};
    ctx->message[0] = 0;
    status = ops->shape(collider->values, tolerance, &collider->shape);
    collider->shape.builder = NULL;
    collider->frames = builder.frames;
    return drape_fail_unsaid(ctx, status, pointer, "shape() of \"%s\" returned %s", ops->entry.name,
                             drape_status_name(status));
}
