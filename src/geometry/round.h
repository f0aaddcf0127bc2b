/* round.h: the distance from a point or a line; shared by spheres, capsules, cylinders and the edges of
 * meshes. */
#ifndef DRAPE_GEOMETRY_ROUND_H
#define DRAPE_GEOMETRY_ROUND_H

#include "base/vec3.h"

/* Computes a unit vector perpendicular to the unit vector u. */
static inline void round_across(const double *u, double *out)
{
    int least =
        fabs(u[0]) <= fabs(u[1]) ? (fabs(u[0]) <= fabs(u[2]) ? 0 : 2) : (fabs(u[1]) <= fabs(u[2]) ? 1 : 2);
    double other[3] = {least == 0, least == 1, least == 2};
    vec3_cross(u, other, out);
    double length = vec3_norm(out);
    for (int k = 0; k < 3; k++)
        out[k] /= length;
}

/* Returns the distance |r| from the nearest point and writes its derivatives: normal n = r / |r| and
 * curvature (I - n n^T - u u^T) / |r|. u is the direction of the line on which r starts; NULL for a point. On
 * the point or line itself the normal is arbitrary and the curvature 0. */
static inline double round_distance(const double *r, const double *u, double *normal, double *curvature)
{
    double n[3] = {0, 1, 0}, length = vec3_norm(r);
    if (!normal && !curvature)
        return length;
    if (length > 0)
        for (int k = 0; k < 3; k++)
            n[k] = r[k] / length;
    else if (u)
        round_across(u, n);
    for (int i = 0; normal && i < 3; i++)
        normal[i] = n[i];
    for (int i = 0; curvature && i < 9; i++) {
        int a = i / 3, b = i % 3;
        double across = (a == b) - n[a] * n[b] - (u ? u[a] * u[b] : 0);
        curvature[i] = length > 0 ? across / length : 0;
    }
    return length;
}

#endif
