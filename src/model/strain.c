/*
 * strain.c: principal strains of triangles. Let D = (x1 - x0, x2 - x0) be the edge vectors, and R the same at
 * rest, in a frame of the triangle whose first axis is its first edge. The deformation gradient is F = D R^-1
 * (3 x 2). The principal stretches are the square roots of the eigenvalues of F'F, a symmetric 2 x 2 matrix.
 */
#include <math.h>

#include "base/elementary.h"
#include "base/vec3.h"
#include "model/model.h"

/* Computes the two edge vectors of a triangle. */
static void edges_of(const double *x, const int32_t *node, double u[3], double v[3])
{
    vec3_sub(x + 3 * (size_t)node[1], x + 3 * (size_t)node[0], u);
    vec3_sub(x + 3 * (size_t)node[2], x + 3 * (size_t)node[0], v);
}

static void strain_of(const double *rest, const double *x, const int32_t *node, double strain[2])
{
    double a[3], b[3], normal[3], u[3], v[3], f[2][3];
    edges_of(rest, node, a, b);
    edges_of(x, node, u, v);
    vec3_cross(a, b, normal);
    /* R = (l, p; 0, h): b is p along the first edge and h across; R^-1 = (1/l, -p/(l h); 0, 1/h). */
    double l = vec3_norm(a), p = vec3_dot(a, b) / l, h = vec3_norm(normal) / l;
    for (int k = 0; k < 3; k++) {
        f[0][k] = u[k] / l;
        f[1][k] = (v[k] - p * f[0][k]) / h;
    }
    double c00 = vec3_dot(f[0], f[0]), c01 = vec3_dot(f[0], f[1]), c11 = vec3_dot(f[1], f[1]);
    double mean = 0.5 * (c00 + c11), spread = drape_hypot(0.5 * (c00 - c11), c01);
    strain[0] = sqrt(mean + spread) - 1;
    strain[1] = sqrt(fmax(0, mean - spread)) - 1;
}

void drape_model_strain(const drape_model *model, const double *x, double *strain)
{
    if (!model || !x || !strain)
        return;
    for (size_t t = 0; t < (size_t)model->triangle_count; t++)
        strain_of(model->rest, x, model->triangle + 3 * t, strain + 2 * t);
}
