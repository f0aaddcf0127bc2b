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
    DRAPE_TURN("rotate", 0, -1e6, 1e6,
               "axis and angle, or a vector along the axis whose length is the angle; about the center of a "
               "box, or the origin"),
    DRAPE_NUMBER("rounding", "m", 0, 0, 1e9,
                 "radius of its edges and corners, or rims, below half of its smallest extent; its size "
                 "includes them"),
};

/* Rows are the axes of the box: y = frame (x - center). */
typedef struct frame {
    double axis[3][3];
} frame;

static drape_status keep_frame(const double *values, drape_collider_shape *shape)
{
    double turn[3][3];
    const double *v = values + ROTATE, rotate[4] = {v[0], v[1], v[2], vec3_norm(v)};
    frame *kept = drape_shape_take(shape, 1, sizeof *kept);
    if (!kept)
        return DRAPE_E_MEMORY;
    drape_rotation_matrix(rotate, turn);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            kept->axis[i][j] = turn[j][i];
    shape->kept = kept;
    return DRAPE_OK;
}

/* Corner c lies on the high side of axis k where bit k of c is set; an edge joins corners that differ in one
 * bit. */
static void fill_core(const double *values, const frame *f, drape_collider_shape *shape)
{
    int32_t *segment = shape->segment;
    for (int32_t c = 0; c < 8; c++) {
        double *point = shape->point + 3 * c;
        for (int k = 0; k < 3; k++)
            point[k] = values[CENTER + k];
        for (int k = 0; k < 3; k++) {
            double half = values[SIZE + k] / 2 - values[ROUNDING];
            vec3_add_scaled(c >> k & 1 ? half : -half, f->axis[k], point);
            if (!(c >> k & 1)) {
                *segment++ = c;
                *segment++ = c | 1 << k;
            }
        }
    }
    shape->radius = values[ROUNDING];
}

static drape_status make_shape(const double *values, double tolerance, drape_collider_shape *shape)
{
    const double *size = values + SIZE;
    double least = fmin(size[0], fmin(size[1], size[2]));
    (void)tolerance;
    if (!(values[ROUNDING] < least / 2))
        return drape_shape_refuse(shape, "rounding",
                                  "%.10g is not allowed; it is below half of the smallest size, %.10g m",
                                  values[ROUNDING], least / 2);
    drape_status status = drape_shape_reserve(shape, 8, 12, 0);
    if (!status)
        status = keep_frame(values, shape);
    if (!status)
        fill_core(values, shape->kept, shape);
    return status;
}

/* out = sum of g[k] axis[k] */
static void turn_back(const frame *f, const double *g, double *out)
{
    for (int i = 0; i < 3; i++)
        out[i] = g[0] * f->axis[0][i] + g[1] * f->axis[1][i] + g[2] * f->axis[2][i];
}

/* Outside of the core d = |max(q, 0)|: only directions in which q > 0 have curvature. */
static void bend(const frame *f, const double *q, const double *g, double length, double *curvature)
{
    for (int i = 0; i < 9; i++) {
        double sum = 0;
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                sum += ((a == b && q[a] > 0) - g[a] * g[b]) * f->axis[a][i / 3] * f->axis[b][i % 3];
        curvature[i] = length > 0 ? sum / length : 0;
    }
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
    if (normal)
        turn_back(f, g, normal);
    if (curvature)
        bend(f, q, g, outside, curvature);
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
