/* collider_sphere.c: d = |x - c| - r. */
#include "colliders/colliders.h"

#include "geometry/round.h"

#include <string.h>

enum { CENTER = 0, RADIUS = 3, PARAM_COUNT = 2 }; /* places of the values */

static const drape_param params[PARAM_COUNT] = {
    DRAPE_VECTOR("center", "m", DRAPE_REQUIRED, -1e9, 1e9, "its center"),
    DRAPE_NUMBER("radius", "m", DRAPE_REQUIRED, DRAPE_ABOVE(0), 1e9, "its radius"),
};

static drape_status make_shape(const double *values, double tolerance, drape_collider_shape *shape)
{
    (void)tolerance;
    drape_status status = drape_shape_reserve(shape, 1, 0, 0);
    if (status)
        return status;
    memcpy(shape->point, values + CENTER, 3 * sizeof *shape->point);
    shape->radius = values[RADIUS];
    return DRAPE_OK;
}

static double distance(const double *values, const drape_collider_shape *shape, const double *x,
                       double *normal, double *curvature)
{
    double from[3];
    (void)shape;
    vec3_sub(x, values + CENTER, from);
    return round_distance(from, NULL, normal, curvature) - values[RADIUS];
}

const drape_collider_ops drape_collider_sphere = {
    .struct_size = sizeof(drape_collider_ops),
    .entry = {.name = "sphere", .summary = "a ball", .reference = "d = |x - c| - r", DRAPE_PARAMS(params)},
    .shape = make_shape,
    .distance = distance,
    .smooth = true,
};
