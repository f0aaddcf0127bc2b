/* collider_cylinder.c: a cylinder with flat ends and rounded rims: with rho and z the distances from the axis
 * and from the middle, q = (rho - (radius - rounding), |z| - (half length - rounding)) and
 * d = |max(q, 0)| + min(max(q_0, q_1), 0) - rounding: exact inside and outside. The Hessian of f(rho, z) is
 * f_rr e e + f_rz (e u + u e) + f_zz u u + f_r / rho (I - e e - u u), u along the axis, e away from it. */
#include "base/elementary.h"
#include "base/pi.h"
#include "colliders/colliders.h"

#include "geometry/round.h"

enum { A = 0, B = 3, RADIUS = 6, ROUNDING = 7, PARAM_COUNT = 4 }; /* places of the values */

#define MIN_SIDES 12
#define MAX_SIDES 512

static const drape_param params[PARAM_COUNT] = {
    DRAPE_SHAPE_END_PARAMS,
    DRAPE_NUMBER("radius", "m", DRAPE_REQUIRED, DRAPE_ABOVE(0), 1e9, "its radius"),
    DRAPE_SHAPE_ROUNDING_PARAM,
};

typedef struct axis {
    double middle[3], u[3], half; /* half the length of the core, without the rounding */
} axis;

static drape_status make_shape(const double *values, double tolerance, drape_collider_shape *shape)
{
    axis *c = drape_shape_take(shape, 1, sizeof *c);
    if (!c)
        return DRAPE_E_MEMORY;
    vec3_sub(values + B, values + A, c->u);
    const double length = vec3_norm(c->u), most = fmin(values[RADIUS], length / 2);
    if (!(length > 0))
        return drape_shape_refuse(shape, "b", "it is equal to a; a cylinder has a length above 0");
    if (!(values[ROUNDING] < most))
        return drape_shape_refuse(
            shape, "rounding", "%.10g is not allowed; it is below the radius and half of the length, %.10g m",
            values[ROUNDING], most);
    for (int k = 0; k < 3; k++) {
        c->u[k] /= length;
        c->middle[k] = (values[A + k] + values[B + k]) / 2;
    }
    c->half = length / 2 - values[ROUNDING];
    shape->kept = c;
    shape->radius = values[ROUNDING];
    shape->inscribed = true;
    /* The middle of a side of a prism with n sides is radius (1 - cos(pi / n)) inside of the circle. */
    const double core = values[RADIUS] - values[ROUNDING], sag = tolerance / core, cos_half = 1 - sag,
                 least =
                     cos_half > 0 ? ceil(DRAPE_PI / drape_atan2(sqrt(sag * (2 - sag)), cos_half)) : MIN_SIDES;
    const int32_t sides =
        (int32_t)fmin(fmax(least, MIN_SIDES), MAX_SIDES); /* infinite for a tolerance of 0 */
    const drape_status status = drape_shape_reserve(shape, 2 * sides, 3 * sides, 0);
    if (status)
        return status;
    double e[3], f[3];
    int32_t *segment = shape->segment;
    round_across(c->u, e);
    vec3_cross(c->u, e, f);
    for (int32_t s = 0; s < sides; s++) { /* points 2 s and 2 s + 1 are the ends of ridge s */
        const double turn = 2 * DRAPE_PI;
        double sine, cosine;
        drape_sin_cos(turn * s / sides, &sine, &cosine);
        for (int32_t end = 0; end < 2; end++) {
            double *point = shape->point + 3 * (2 * s + end);
            for (int k = 0; k < 3; k++)
                point[k] = c->middle[k];
            vec3_add_scaled(end ? c->half : -c->half, c->u, point);
            vec3_add_scaled(core * cosine, e, point);
            vec3_add_scaled(core * sine, f, point);
            *segment++ = 2 * s + end;
            *segment++ = 2 * ((s + 1) % sides) + end;
        }
        *segment++ = 2 * s;
        *segment++ = 2 * s + 1;
    }
    return DRAPE_OK;
}

/* f and its derivatives by rho and z in the half plane of the axis. */
typedef struct profile {
    double f, f_r, f_z, f_rr, f_rz, f_zz;
} profile;

static profile profile_of(double rho, double z, double radius, double half)
{
    double q[2] = {rho - radius, fabs(z) - half}, sign = z < 0 ? -1 : 1;
    profile p = {0};
    if (q[0] > 0 && q[1] > 0) {
        p.f = drape_hypot(q[0], q[1]);
        p.f_r = q[0] / p.f;
        p.f_z = sign * q[1] / p.f;
        p.f_rr = p.f_z * p.f_z / p.f;
        p.f_rz = -p.f_r * p.f_z / p.f;
        p.f_zz = p.f_r * p.f_r / p.f;
    } else if (q[0] > q[1]) {
        p.f = q[0];
        p.f_r = 1;
    } else {
        p.f = q[1];
        p.f_z = sign;
    }
    return p;
}

static double distance(const double *values, const drape_collider_shape *shape, const double *x,
                       double *normal, double *curvature)
{
    const axis *c = shape->kept;
    double e[3];
    vec3_sub(x, c->middle, e);
    double z = vec3_dot(e, c->u);
    vec3_add_scaled(-z, c->u, e);
    double rho = vec3_norm(e);
    const profile p = profile_of(rho, z, values[RADIUS] - values[ROUNDING], c->half);
    if (rho > 0)
        for (int k = 0; k < 3; k++)
            e[k] /= rho;
    else
        round_across(c->u, e);
    for (int i = 0; normal && i < 3; i++)
        normal[i] = p.f_r * e[i] + p.f_z * c->u[i];
    for (int i = 0; curvature && i < 9; i++) {
        int a = i / 3, b = i % 3;
        double around = (a == b) - e[a] * e[b] - c->u[a] * c->u[b];
        curvature[i] = p.f_rr * e[a] * e[b] + p.f_rz * (e[a] * c->u[b] + c->u[a] * e[b]) +
                       p.f_zz * c->u[a] * c->u[b] + (rho > 0 ? p.f_r / rho * around : 0);
    }
    return p.f - values[ROUNDING];
}

const drape_collider_ops drape_collider_cylinder = {
    .struct_size = sizeof(drape_collider_ops),
    .entry =
        {.name = "cylinder",
         .summary = "a cylinder with flat ends, whose rims may be rounded",
         .reference =
             "d = |max(q, 0)| + min(max q, 0) - rounding, q = (rho, |z|) - (radius, length / 2) + rounding",
         DRAPE_PARAMS(params)},
    .shape = make_shape,
    .distance = distance,
    .smooth = true,
};
