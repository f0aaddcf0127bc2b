/* ride.c: see ride.h. */
#include "model/ride.h"

#include "base/vec3.h"

#include <math.h>
#include <string.h>

drape_ride drape_ride_none(void)
{
    return (drape_ride){.collider = -1, .triangle = -1, .since = NAN};
}

/* N = a x b of the edges from the first corner; n = N / |N|, 0 if the triangle has no area. */
static double normal_of(const double corner[9], double a[3], double b[3], double n[3])
{
    vec3_sub(corner + 3, corner, a);
    vec3_sub(corner + 6, corner, b);
    vec3_cross(a, b, n);
    const double length = vec3_norm(n);
    for (int k = 0; k < 3; k++)
        n[k] = length > 0 ? n[k] / length : 0;
    return length;
}

/* With r = X - p_0: w_1 = (r x b) . n / |N|, w_2 = (a x r) . n / |N|, d = r . n. */
void drape_ride_fix(drape_ride *ride, const double corner[9], const double X[3])
{
    double a[3], b[3], n[3], r[3], cross[3];
    const double area = normal_of(corner, a, b, n);
    vec3_sub(X, corner, r);
    vec3_cross(r, b, cross);
    ride->own[1] = area > 0 ? vec3_dot(cross, n) / area : 0;
    vec3_cross(a, r, cross);
    ride->own[2] = area > 0 ? vec3_dot(cross, n) / area : 0;
    ride->own[0] = 1 - ride->own[1] - ride->own[2];
    ride->offset = vec3_dot(r, n);
}

/* From the first corner on, so that a shift of all corners shifts the point by as much. */
void drape_ride_point(const drape_ride *ride, const double corner[9], double X[3])
{
    double a[3], b[3], n[3];
    normal_of(corner, a, b, n);
    memcpy(X, corner, 3 * sizeof *X);
    vec3_add_scaled(ride->own[1], a, X);
    vec3_add_scaled(ride->own[2], b, X);
    vec3_add_scaled(ride->offset, n, X);
}

/* dn/dt = (I - n n') (da/dt x b + a x db/dt) / |N| */
void drape_ride_velocity(const drape_ride *ride, const double corner[9], const double v[9], double V[3])
{
    double a[3], b[3], n[3], da[3], db[3], one[3], other[3];
    const double area = normal_of(corner, a, b, n);
    vec3_sub(v + 3, v, da);
    vec3_sub(v + 6, v, db);
    vec3_cross(da, b, one);
    vec3_cross(a, db, other);
    vec3_add_scaled(1, other, one);
    vec3_add_scaled(-vec3_dot(one, n), n, one);
    memcpy(V, v, 3 * sizeof *V);
    vec3_add_scaled(ride->own[1], da, V);
    vec3_add_scaled(ride->own[2], db, V);
    if (area > 0)
        vec3_add_scaled(ride->offset / area, one, V);
}
