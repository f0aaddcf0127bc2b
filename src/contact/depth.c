/* depth.c: see depth.h. */
#include "contact/depth.h"

#include "base/vec3.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* The distance at a point of a segment, and its derivative along it. */
typedef struct tangent {
    double t, d, slope;
} tangent;

static tangent tangent_at(const drape_collider *collider, const drape_collider_pose *pose, const double *a,
                          const double *u, double t)
{
    double x[3] = {a[0], a[1], a[2]}, n[3];
    vec3_add_scaled(t, u, x);
    tangent at = {.t = t, .d = drape_collider_distance(collider, pose, x, n, NULL)};
    at.slope = vec3_dot(n, u);
    return at;
}

/* By the cuts of two tangents, until the lower bound that they are is reached or rounding leaves no place for
 * another one between them. */
double drape_depth_edge(const drape_collider *collider, const drape_collider_pose *pose, const double *a,
                        const double *b, double enough)
{
    double u[3];
    vec3_sub(b, a, u);
    tangent low = tangent_at(collider, pose, a, u, 0), high = tangent_at(collider, pose, a, u, 1);
    double least = fmin(low.d, high.d);
    while (low.slope < 0 && high.slope > 0) {
        double t = (high.d - high.slope * high.t - low.d + low.slope * low.t) / (low.slope - high.slope);
        double bound = low.d + low.slope * (t - low.t);
        if (bound > enough)
            return bound;
        if (!(bound < least && t > low.t && t < high.t))
            return least;
        tangent at = tangent_at(collider, pose, a, u, t);
        least = fmin(least, at.d);
        *(at.slope < 0 ? &low : &high) = at;
    }
    return least;
}

/* The smallest distance on the line that joins the points of the sides 0 1 and 0 2 at the share s of their
 * lengths. */
static double depth_across(const drape_collider *collider, const drape_collider_pose *pose,
                           const double *const corner[3], double s)
{
    double end[2][3], side[3];
    for (int i = 0; i < 2; i++) {
        memcpy(end[i], corner[0], sizeof end[i]);
        vec3_sub(corner[i + 1], corner[0], side);
        vec3_add_scaled(s, side, end[i]);
    }
    return drape_depth_edge(collider, pose, end[0], end[1], INFINITY);
}

/* The minimum on a line parallel to side 1 2 is a convex function of s, minimised by golden section (Kiefer
 * 1953), until values beside a minimum differ by rounding alone: at the root of epsilon. */
double drape_depth_face(const drape_collider *collider, const drape_collider_pose *pose,
                        const double *const corner[3], double enough)
{
    const double golden = (sqrt(5) - 1) / 2;
    double low = 0, high = 1, d[2], sides[3], length = 0;
    /* None if a tangent plane at some corner is above `enough` on the whole triangle. */
    for (int i = 0; i < 3; i++) {
        double n[3], to[3], distance = drape_collider_distance(collider, pose, corner[i], n, NULL),
                            least = distance;
        for (int j = 0; j < 3; j++) {
            vec3_sub(corner[j], corner[i], to);
            least = fmin(least, distance + vec3_dot(n, to));
        }
        if (least > enough)
            return INFINITY;
    }
    for (int i = 1; i < 3; i++) {
        vec3_sub(corner[i], corner[0], sides);
        length = fmax(length, vec3_norm(sides)); /* bounds the change of the distance with s */
    }
    for (int i = 0; i < 2; i++)
        d[i] = depth_across(collider, pose, corner, i ? golden : 1 - golden);
    double least = fmin(d[0], d[1]);
    while (high - low > sqrt(DBL_EPSILON) && least - length * (high - low) <= enough) {
        double width = golden * (high - low);
        bool left = d[0] < d[1];
        *(left ? &high : &low) = left ? low + width : high - width;
        width = golden * (high - low);
        d[left] = d[!left];
        d[!left] = depth_across(collider, pose, corner, left ? high - width : low + width);
        least = fmin(least, d[!left]);
    }
    return least;
}
