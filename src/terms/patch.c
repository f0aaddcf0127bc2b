/* patch.c: see patch.h. */
#include "terms/patch.h"

#include "base/elementary.h"
#include "base/vec3.h"

#include <math.h>
#include <string.h>

#define MIN_EIGENVALUE 1e-4 /* over the largest; curvatures below are ignored */

const int drape_patch_hinge[DRAPE_PATCH_HINGES][4] = {{0, 1, 2, 3}, {1, 2, 0, 4},  {2, 0, 1, 5},
                                                      {0, 3, 1, 6}, {3, 1, 0, 7},  {1, 4, 2, 8},
                                                      {4, 2, 1, 9}, {2, 5, 0, 10}, {5, 0, 2, 11}};

static int corner_of(const int32_t *nodes, int32_t node)
{
    return nodes[0] == node ? 0 : nodes[1] == node ? 1 : 2;
}

drape_beyond drape_beyond_edge(const drape_cloth_view *cloth, int32_t triangle, int32_t edge, int32_t a,
                               int32_t b)
{
    const int32_t *beside = cloth->edge_triangle + 2 * (size_t)edge;
    const int32_t image = cloth->edge_image ? cloth->edge_image[edge] : -1;
    drape_beyond out = {
        .triangle = beside[0] == triangle ? beside[1] : beside[0], .apex = -1, .a = a, .b = b};
    if (image >= 0) {
        /* the image is a translation of the edge: which of its nodes is a, and the displacement back */
        const int32_t *end = cloth->edge + 2 * (size_t)image;
        double along[3], other[3];
        vec3_sub(cloth->rest + 3 * (size_t)b, cloth->rest + 3 * (size_t)a, along);
        vec3_sub(cloth->rest + 3 * (size_t)end[1], cloth->rest + 3 * (size_t)end[0], other);
        const int first = vec3_dot(along, other) < 0;
        out.triangle = cloth->edge_triangle[2 * (size_t)image];
        out.across = true;
        out.a = end[first];
        out.b = end[1 - first];
        vec3_sub(cloth->rest + 3 * (size_t)a, cloth->rest + 3 * (size_t)out.a, out.at_rest);
        vec3_sub(cloth->start + 3 * (size_t)a, cloth->start + 3 * (size_t)out.a, out.shift);
    }
    for (int k = 0; out.triangle >= 0 && k < 3; k++) {
        const int32_t node = cloth->triangle[3 * (size_t)out.triangle + (size_t)k];
        if (node != out.a && node != out.b)
            out.apex = node;
    }
    return out;
}

/* Adds the apex beyond hinge h of the triangle `from`, whose nodes there are a and b: its node and its place
 * in the plane. Returns the triangle of the apex. */
static drape_beyond add_beyond(const drape_cloth_view *cloth, const drape_beyond *from, int h, int32_t a,
                               int32_t b, drape_patch *out)
{
    const int *local = drape_patch_hinge[h], apex = local[3];
    const int32_t *own = cloth->triangle + 3 * (size_t)from->triangle;
    const int i = corner_of(own, a), j = corner_of(own, b), side = (i + 1) % 3 == j ? i : j;
    const int32_t edge = cloth->triangle_edge[3 * (size_t)from->triangle + (size_t)side];
    drape_beyond next = drape_beyond_edge(cloth, from->triangle, edge, a, b);
    out->edge[h] = edge;
    out->beyond[h] = next.triangle;
    out->turned[h] = cloth->edge_triangle[2 * (size_t)edge] != from->triangle;
    out->node[apex] = next.apex;
    next.across = next.across || from->across;
    out->shifted[h] = next.across;
    vec3_add_scaled(1, from->at_rest, next.at_rest);
    vec3_add_scaled(1, from->shift, next.shift);
    memcpy(out->at_rest[apex], next.at_rest, sizeof next.at_rest);
    memcpy(out->shift[apex], next.shift, sizeof next.shift);
    if (next.triangle < 0)
        return next;
    const double *at = cloth->rest + 3 * (size_t)next.a, *start = out->flat + 2 * local[0],
                 *end = out->flat + 2 * local[1];
    double along[3], d[3], normal[3];
    vec3_sub(cloth->rest + 3 * (size_t)next.b, at, along);
    vec3_sub(cloth->rest + 3 * (size_t)next.apex, at, d);
    vec3_cross(along, d, normal);
    const double length2 = vec3_dot(along, along), s = vec3_dot(d, along) / length2;
    const double rise = vec3_norm(normal) / length2; /* altitude over length */
    out->flat[2 * apex] = start[0] + s * (end[0] - start[0]) + rise * (end[1] - start[1]);
    out->flat[2 * apex + 1] = start[1] + s * (end[1] - start[1]) - rise * (end[0] - start[0]);
    return next;
}

void drape_patch_around(const drape_cloth_view *cloth, int32_t triangle, const double flat[6],
                        drape_patch *out)
{
    memset(out, 0, sizeof *out);
    memcpy(out->flat, flat, 6 * sizeof *flat);
    for (int k = 0; k < DRAPE_PATCH_NODES; k++)
        out->node[k] = k < 3 ? cloth->triangle[3 * (size_t)triangle + (size_t)k] : -1;
    for (int h = 0; h < DRAPE_PATCH_HINGES; h++)
        out->edge[h] = out->beyond[h] = -1;
    for (int i = 0; i < 3; i++) {
        const drape_beyond own = {.triangle = triangle};
        const drape_beyond next = add_beyond(cloth, &own, i, out->node[i], out->node[(i + 1) % 3], out);
        if (next.triangle < 0)
            continue;
        add_beyond(cloth, &next, 3 + 2 * i, next.a, next.apex, out);
        add_beyond(cloth, &next, 4 + 2 * i, next.apex, next.b, out);
    }
}

/* Cyclic Jacobi rotations: leaves the eigenvalues on the diagonal of a (3 x 3), eigenvectors in the columns
 * of v. */
static void diagonalize(double a[9], double v[9])
{
    for (int i = 0; i < 9; i++)
        v[i] = i % 4 == 0;
    for (int turn = 0; turn < 30; turn++) { /* ten sweeps: convergence is quadratic */
        const int p = turn % 3 == 2 ? 1 : 0, q = turn % 3 == 0 ? 1 : 2;
        if (a[3 * p + q] == 0)
            continue;
        const double tau = (a[4 * q] - a[4 * p]) / (2 * a[3 * p + q]);
        const double t = (tau >= 0 ? 1 : -1) / (fabs(tau) + drape_hypot(1, tau)), c = 1 / drape_hypot(1, t),
                     s = t * c;
        for (int i = 0; i < 3; i++) {
            const double ap = a[3 * i + p], aq = a[3 * i + q], vp = v[3 * i + p], vq = v[3 * i + q];
            a[3 * i + p] = c * ap - s * aq, a[3 * i + q] = s * ap + c * aq;
            v[3 * i + p] = c * vp - s * vq, v[3 * i + q] = s * vp + c * vq;
        }
        for (int i = 0; i < 3; i++) {
            const double ap = a[3 * p + i], aq = a[3 * q + i];
            a[3 * p + i] = c * ap - s * aq, a[3 * q + i] = s * ap + c * aq;
        }
    }
}

void drape_least_solution(const double *m, int n, const double target[3], double *c)
{
    double a[9] = {0}, v[9], y[3] = {0};
    for (int i = 0; i < 9; i++)
        for (int j = 0; j < n; j++)
            a[i] += m[n * (i / 3) + j] * m[n * (i % 3) + j];
    diagonalize(a, v);
    const double largest = fmax(a[0], fmax(a[4], a[8]));
    for (int k = 0; k < 3; k++) {
        if (!(a[4 * k] > MIN_EIGENVALUE * largest))
            continue;
        const double along = v[k] * target[0] + v[3 + k] * target[1] + v[6 + k] * target[2];
        for (int i = 0; i < 3; i++)
            y[i] += v[3 * i + k] * along / a[4 * k];
    }
    for (int j = 0; j < n; j++)
        c[j] = m[j] * y[0] + m[n + j] * y[1] + m[2 * n + j] * y[2];
}
