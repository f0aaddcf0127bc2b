/* embed.c: see embed.h. */
#include "geometry/embed.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/vec3.h"

/* One Newton step of  sum w_i (x_i + h n_i) = point  in w_1, w_2 and h; the residual r = point - sum.
 * Cramer's rule. Returns whether the columns are independent. */
static bool improve(const double *x, const double *normals, const double r[3], drape_embedded *e)
{
    double column[3][3] = {{0}}, cross[3];
    for (int i = 1; i < 3; i++) {
        vec3_sub(x + 3 * (size_t)e->node[i], x + 3 * (size_t)e->node[0], column[i - 1]);
        vec3_add_scaled(e->height, normals + 3 * (size_t)e->node[i], column[i - 1]);
        vec3_add_scaled(-e->height, normals + 3 * (size_t)e->node[0], column[i - 1]);
    }
    for (int a = 0; a < 3; a++)
        vec3_add_scaled(e->weights[a], normals + 3 * (size_t)e->node[a], column[2]);
    vec3_cross(column[1], column[2], cross);
    const double volume = vec3_dot(column[0], cross);
    if (!(fabs(volume) > 0))
        return false;
    const double first = vec3_dot(r, cross) / volume;
    vec3_cross(column[2], column[0], cross);
    const double second = vec3_dot(r, cross) / volume;
    vec3_cross(column[0], column[1], cross);
    e->weights[1] += first;
    e->weights[2] += second;
    e->weights[0] = 1 - e->weights[1] - e->weights[2];
    e->height += vec3_dot(r, cross) / volume;
    return true;
}

/* From the flat solution. The height must stay of the size of the distance: beyond the centre of
 * curvature, on the inside of a fold, the iteration fails or finds another solution far away; so it ends
 * where a step does not bring the point nearer. */
static bool bind_smooth(const double *x, const double *normals, const double point[3], double distance,
                        drape_embedded *to)
{
    double size = 0, at[3], r[3];
    for (int k = 0; k < 3; k++)
        size = fmax(size, fabs(point[k]));
    const double rounding = 16 * DBL_EPSILON * (size + distance);
    to->flat = false;
    for (double before = INFINITY, now;; before = now) {
        drape_embedded_point(to, x, normals, at);
        vec3_sub(point, at, r);
        now = vec3_norm(r);
        if (now <= rounding)
            return fabs(to->height) <= 2 * distance + rounding;
        if (!(now < before) || !improve(x, normals, r, to))
            return false;
    }
}

void drape_embed_in(const drape_bvh *tree, const double *x, const double *normals, const double point[3],
                    int32_t triangle, double distance, drape_embedded *to)
{
    to->triangle = triangle;
    memcpy(to->node, tree->node + 3 * (size_t)triangle, sizeof to->node);
    /* Weights and height along the normal of the triangle: the components of the point in its frame. */
    const double *x0 = x + 3 * (size_t)to->node[0];
    double u[3], v[3], n[3], d[3];
    vec3_sub(x + 3 * (size_t)to->node[1], x0, u);
    vec3_sub(x + 3 * (size_t)to->node[2], x0, v);
    vec3_sub(point, x0, d);
    vec3_triangle_normal(to->node, x, n);
    const double uu = vec3_dot(u, u), uv = vec3_dot(u, v), vv = vec3_dot(v, v), area = uu * vv - uv * uv;
    const double du = vec3_dot(d, u), dv = vec3_dot(d, v);
    to->weights[1] = area > 0 ? (vv * du - uv * dv) / area : 0;
    to->weights[2] = area > 0 ? (uu * dv - uv * du) / area : 0;
    to->weights[0] = 1 - to->weights[1] - to->weights[2];
    to->height = vec3_dot(d, n);
    to->flat = true;
    if (normals) {
        drape_embedded smooth = *to;
        if (bind_smooth(x, normals, point, distance, &smooth))
            *to = smooth;
    }
}

double drape_embed(const drape_bvh *tree, const double *x, const double *normals, const double point[3],
                   drape_embedded *to)
{
    const drape_on_triangle at = drape_nearest_on(tree, x, point, INFINITY);
    drape_embed_in(tree, x, normals, point, at.triangle, at.distance, to);
    return at.distance;
}
