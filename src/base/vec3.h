/* vec3.h: inline functions on vectors of three doubles. */
#ifndef DRAPE_BASE_VEC3_H
#define DRAPE_BASE_VEC3_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>

static inline void vec3_sub(const double *a, const double *b, double *out)
{
    out[0] = a[0] - b[0];
    out[1] = a[1] - b[1];
    out[2] = a[2] - b[2];
}

static inline double vec3_dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void vec3_cross(const double *a, const double *b, double *out)
{
    double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    out[0] = x;
    out[1] = y;
    out[2] = z;
}

static inline double vec3_norm(const double *a)
{
    return sqrt(vec3_dot(a, a));
}

/* out += s a */
static inline void vec3_add_scaled(double s, const double *a, double *out)
{
    out[0] += s * a[0];
    out[1] += s * a[1];
    out[2] += s * a[2];
}

/* The sides of a triangle (three nodes) at x: from its first node to the second and to the third one. */
static inline void vec3_triangle_sides(const int32_t *node, const double *x, double to_second[3],
                                       double to_third[3])
{
    vec3_sub(x + 3 * (size_t)node[1], x + 3 * (size_t)node[0], to_second);
    vec3_sub(x + 3 * (size_t)node[2], x + 3 * (size_t)node[0], to_third);
}

/* Twice the area of a triangle at x, along its normal. */
static inline void vec3_triangle_area(const int32_t *node, const double *x, double area[3])
{
    double u[3], v[3];
    vec3_triangle_sides(node, x, u, v);
    vec3_cross(u, v, area);
}

/* The normal of length 1 of a triangle (three nodes) at x; 0 if it has no area. */
static inline void vec3_triangle_normal(const int32_t *node, const double *x, double normal[3])
{
    vec3_triangle_area(node, x, normal);
    const double length = vec3_norm(normal);
    for (int k = 0; k < 3; k++)
        normal[k] = length > 0 ? normal[k] / length : 0;
}

#endif
