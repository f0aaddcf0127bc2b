/* collider_capsule.c: all that is within a radius of a segment: d = |x - s| - r, s the nearest point of it
 * (Ericson 2005, Real-Time Collision Detection, section 5.1.2). */
#include "colliders/colliders.h"

#include "geometry/round.h"

#include <string.h>

enum { A = 0, B = 3, RADIUS = 6, PARAM_COUNT = 3 }; /* places of the values */

static const drape_param params[PARAM_COUNT] = {
    DRAPE_SHAPE_END_PARAMS,
    DRAPE_NUMBER("radius", "m", DRAPE_REQUIRED, DRAPE_ABOVE(0), 1e9, "its radius"),
};

static drape_status make_shape(const double *values, double tolerance, drape_collider_shape *shape)
{
    double along[3];
    (void)tolerance;
    vec3_sub(values + B, values + A, along);
    if (!(vec3_norm(along) > 0))
        return drape_shape_refuse(shape, "b", "it is equal to a; a capsule of length 0 is a sphere");
    drape_status status = drape_shape_reserve(shape, 2, 1, 0);
    if (status)
        return status;
    memcpy(shape->point, values + A, 6 * sizeof *shape->point);
    shape->segment[1] = 1;
    shape->radius = values[RADIUS];
    return DRAPE_OK;
}

static double distance(const double *values, const drape_collider_shape *shape, const double *x,
                       double *normal, double *curvature)
{
    double u[3], from[3];
    (void)shape;
    vec3_sub(values + B, values + A, u);
    double length = vec3_norm(u);
    for (int k = 0; k < 3; k++)
        u[k] /= length;
    vec3_sub(x, values + A, from);
    double at = vec3_dot(from, u);
    bool beside = at > 0 && at < length;
    vec3_add_scaled(-fmin(fmax(at, 0), length), u, from);
    return round_distance(from, beside ? u : NULL, normal, curvature) - values[RADIUS];
}

const drape_collider_ops drape_collider_capsule = {
    .struct_size = sizeof(drape_collider_ops),
    .entry = {.name = "capsule",
              .summary = "a cylinder with a hemisphere at each end",
              .reference = "Ericson 2005, section 5.1.2: the nearest point of a segment",
              DRAPE_PARAMS(params)},
    .shape = make_shape,
    .distance = distance,
    .smooth = true,
};
