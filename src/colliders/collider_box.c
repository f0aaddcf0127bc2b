/* collider_box.c: a box with rounded edges: in the frame of the box q = |y| - (half sizes - rounding), and
 * d = |max(q, 0)| + min(max(q_x, q_y, q_z), 0) - rounding: exact inside and outside (Quilez, "Distance
 * functions", sdRoundBox). Outside, the normal is continuous: the core is convex. */
#include "colliders/colliders.h"

#include "base/vec3.h"

enum { CENTER = 0, SIZE = 3, ROTATE = 6, ROUNDING = 9, PARAM_COUNT = 4 }; /* places of the values */

static const drape_param params[PARAM_COUNT] = {
    DRAPE_VECTOR("center", "m", DRAPE_REQUIRED, -1e9, 1e9, "its center"),
    DRAPE_VECTOR("size", "m", DRAPE_REQUIRED, DRAPE_ABOVE(0), 1e9,
                 "full lengths of its edges along x, y, z before the rotation; one number: a cube",
                 .uniform = true),
    DRAPE_SHAPE_ROTATE_PARAM,
    DRAPE_SHAPE_ROUNDING_PARAM,
};

/* Rows are the axes of the box: y = frame (x - center). */
typedef struct frame {
    double axis[3][3];
} frame;

static drape_status make_shape(const double *values, double tolerance, drape_collider_shape *shape)
{
    const double *size = values + SIZE;
    double least = fmin(size[0], fmin(size[1], size[2]));
    (void)tolerance;
    if (!(values[ROUNDING] < least / 2))
        return drape_shape_refuse(shape, "rounding",
                                  "%.10g is not allowed; it is below half of the smallest size, %.10g m",
                                  values[ROUNDING], least / 2);
    const drape_status status = drape_shape_reserve(shape, 8, 12, 0);
    frame *kept = drape_shape_take(shape, 1, sizeof *kept);
    if (status || !kept)
        return status ? status : DRAPE_E_MEMORY;
    double turn[3][3];
    const double *v = values + ROTATE, rotate[4] = {v[0], v[1], v[2], vec3_norm(v)};
    drape_rotation_matrix(rotate, turn);
    for (int i = 0; i < 9; i++)
        kept->axis[i / 3][i % 3] = turn[i % 3][i / 3];
    shape->kept = kept;
    /* Corner c lies on the high side of axis k where bit k of c is set; an edge joins corners that differ in
     * one bit. */
    int32_t *segment = shape->segment;
    for (int32_t c = 0; c < 8; c++) {
        double *point = shape->point + 3 * c;
        for (int k = 0; k < 3; k++)
            point[k] = values[CENTER + k];
        for (int k = 0; k < 3; k++) {
            const double half = values[SIZE + k] / 2 - values[ROUNDING];
            vec3_add_scaled(c >> k & 1 ? half : -half, kept->axis[k], point);
            if (!(c >> k & 1)) {
                *segment++ = c;
                *segment++ = c | 1 << k;
            }
        }
    }
    shape->radius = values[ROUNDING];
    return DRAPE_OK;
}

static double distance(const double *values, const drape_collider_shape *shape, const double *x,
                       double *normal, double *curvature)
{
    const frame *f = shape->kept;
    double from[3], q[3], g[3] = {0}, sign[3], outside = 0;
    int most = 0;
    vec3_sub(x, values + CENTER, from);
    for (int k = 0; k < 3; k++) {
        double y = vec3_dot(f->axis[k], from);
        sign[k] = y < 0 ? -1 : 1;
        q[k] = fabs(y) - (values[SIZE + k] / 2 - values[ROUNDING]);
        most = q[k] > q[most] ? k : most;
        outside += q[k] > 0 ? q[k] * q[k] : 0;
    }
    outside = sqrt(outside);
    for (int k = 0; outside > 0 && k < 3; k++)
        g[k] = sign[k] * fmax(q[k], 0) / outside;
    if (!(outside > 0))
        g[most] = sign[most];
    for (int i = 0; normal && i < 3; i++)
        normal[i] = g[0] * f->axis[0][i] + g[1] * f->axis[1][i] + g[2] * f->axis[2][i];
    /* Outside of the core d = |max(q, 0)|: only directions in which q > 0 have curvature. */
    for (int i = 0; curvature && i < 9; i++) {
        double sum = 0;
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                sum += ((a == b && q[a] > 0) - g[a] * g[b]) * f->axis[a][i / 3] * f->axis[b][i % 3];
        curvature[i] = outside > 0 ? sum / outside : 0;
    }
    return (outside > 0 ? outside : q[most]) - values[ROUNDING];
}

const drape_collider_ops drape_collider_box = {
    .struct_size = sizeof(drape_collider_ops),
    .entry = {.name = "box",
              .summary = "a box, whose edges may be rounded",
              .reference = "d = |max(q, 0)| + min(max q, 0) - rounding, q = |y| - (size / 2 - rounding)",
              DRAPE_PARAMS(params)},
    .shape = make_shape,
    .distance = distance,
    .smooth = true,
};
