/* collider_plane.c: the half space below a plane: d = n . (x - p), n the normal brought to length 1. Faces
 * and edges of a cloth are above it where their nodes are, so that it has no features. */
#include "colliders/colliders.h"

#include "base/vec3.h"

#include <string.h>

enum { POINT = 0, NORMAL = 3, PARAM_COUNT = 2 }; /* places of the values */

static const drape_param params[PARAM_COUNT] = {
    DRAPE_VECTOR("point", "m", DRAPE_REQUIRED, -1e9, 1e9, "a point on the plane"),
    DRAPE_VECTOR("normal", "1", DRAPE_REQUIRED, -1e9, 1e9,
                 "normal towards the side that cloth is on, of any length but 0"),
};

static drape_status make_shape(const double *values, double tolerance, drape_collider_shape *shape)
{
    const double *n = values + NORMAL;
    (void)tolerance;
    double largest = fmax(fabs(n[0]), fmax(fabs(n[1]), fabs(n[2])));
    if (!(largest > 0))
        return drape_shape_refuse(shape, "normal", "0 0 0 has no direction; any other length is allowed");
    double *unit = drape_shape_take(shape, 3, sizeof *unit);
    if (!unit)
        return DRAPE_E_MEMORY;
    for (int k = 0; k < 3; k++)
        unit[k] = n[k] / largest; /* first, so that no square under- or overflows */
    double length = vec3_norm(unit);
    for (int k = 0; k < 3; k++)
        unit[k] /= length;
    shape->kept = unit;
    return DRAPE_OK;
}

static double distance(const double *values, const drape_collider_shape *shape, const double *x,
                       double *normal, double *curvature)
{
    const double *unit = shape->kept;
    double from[3];
    vec3_sub(x, values + POINT, from);
    if (normal)
        memcpy(normal, unit, 3 * sizeof *normal);
    if (curvature)
        memset(curvature, 0, 9 * sizeof *curvature);
    return vec3_dot(from, unit);
}

const drape_collider_ops drape_collider_plane = {
    .struct_size = sizeof(drape_collider_ops),
    .entry = {.name = "plane",
              .summary = "the half space below a plane",
              .reference = "d = n . (x - p)",
              DRAPE_PARAMS(params)},
    .shape = make_shape,
    .distance = distance,
    .smooth = true,
};
