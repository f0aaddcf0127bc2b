/*
 * midedge.c: the shape operator of a triangle with normals at the middles of its edges,
 *     K = 1/A sum_i L_i (theta_i/2 + phi_i) nu_i nu_i'
 * over its edges: L length, nu the outward normal in the plane, theta the angle of the hinge, phi the angle
 * from the mean normal of the two triangles to the normal of the edge (Grinspun, Gingold, Reisman & Zorin
 * 2006, Computing discrete shape operators on general meshes, section 4). Since K A = sum L (slope across the
 * edge) nu, and the slope is one number for both triangles, sums of K over triangles telescope: a constant
 * moment is in equilibrium on any mesh.
 *
 * Usually the edge normals are additional unknowns, or phi is 0. With phi = 0, K is exact if the two
 * triangles of every edge are point reflections of each other; otherwise plates converge to results 5 to 15 %
 * too stiff. Here phi is a linear function phi_i = sum c_ij theta_j of the angles of the five hinges of the
 * two triangles: the one with the smallest c that makes K exact for every quadratic deflection. It is the
 * same from both sides of the edge. So there are no further unknowns, and deflections converge with the
 * square of the mesh size on any mesh. On symmetric meshes c = 0.
 *
 * The slope across a free edge is unconstrained: it takes the value of least energy, M_nn = 0. Across a
 * clamped edge the normal keeps its direction, and theta_i/2 + phi_i is the angle of the triangle to it.
 *
 * Every bending has energy: K = 0 on both sides of an edge implies theta/2 + phi = theta/2 - phi = 0.
 */
#include "terms/midedge.h"
#include "base/elementary.h"

#include "base/vec3.h"
#include "terms/orthotropic.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* A patch during construction. */
typedef struct patch {
    const drape_cloth_view *cloth;
    drape_midedge *out;
    int32_t triangle;
    drape_patch around;
    bool open[MIDEDGE_HINGES];   /* the hinge exists and is not clamped */
    double c[3][MIDEDGE_HINGES]; /* phi_i = sum c theta */
} patch;

/* ---- Quadratic deflections ---- */

/* Outward normal of hinge h (2) and its length, in the plane. */
static double outward(const patch *p, int h, double nu[2])
{
    const double *a = p->around.flat + 2 * drape_patch_hinge[h][0],
                 *b = p->around.flat + 2 * drape_patch_hinge[h][1];
    const double x = b[0] - a[0], y = b[1] - a[1], length = drape_hypot(x, y);
    nu[0] = y / length;
    nu[1] = -x / length;
    return length;
}

/* Slope along nu of the linear deflection that is w at three corners. */
static double slope(const patch *p, const int corner[3], const double w[3], const double nu[2])
{
    const double *a = p->around.flat + 2 * corner[0], *b = p->around.flat + 2 * corner[1],
                 *c = p->around.flat + 2 * corner[2];
    const double u[2] = {b[0] - a[0], b[1] - a[1]}, v[2] = {c[0] - a[0], c[1] - a[1]};
    const double area2 = u[0] * v[1] - u[1] * v[0], wu = w[1] - w[0], wv = w[2] - w[0];
    return ((wu * v[1] - wv * u[1]) * nu[0] + (wv * u[0] - wu * v[0]) * nu[1]) / area2;
}

/* Slopes along nu of x^2/2, y^2/2 or xy (kind 0, 1, 2) in the two triangles of hinge h: about a point and in
 * units of a length. */
static void slopes(const patch *p, int h, int kind, const double about[2], double unit, const double nu[2],
                   double *inside, double *outside)
{
    const int *n = drape_patch_hinge[h];
    const int in[3] = {n[0], n[1], n[2]}, out[3] = {n[1], n[0], n[3]};
    double w[4];
    for (int i = 0; i < 4; i++) {
        const double x = (p->around.flat[2 * n[i]] - about[0]) / unit,
                     y = (p->around.flat[2 * n[i] + 1] - about[1]) / unit;
        w[i] = kind == 0 ? x * x / 2 : kind == 1 ? y * y / 2 : x * y;
    }
    *inside = slope(p, in, (const double[]){w[0], w[1], w[2]}, nu);
    *outside = slope(p, out, (const double[]){w[1], w[0], w[3]}, nu);
}

/* ---- phi ---- */

/* phi of own edge i from the open hinges of its two triangles. It is exact for quadratic deflections about
 * the middle of the edge, whose slope there is 0. */
static void find_phi(patch *p, int i)
{
    const int near[5] = {i, (i + 1) % 3, (i + 2) % 3, 3 + 2 * i, 4 + 2 * i};
    const double *a = p->around.flat + 2 * drape_patch_hinge[i][0],
                 *b = p->around.flat + 2 * drape_patch_hinge[i][1];
    const double middle[2] = {(a[0] + b[0]) / 2, (a[1] + b[1]) / 2};
    double nu[2], m[15], target[3], c[5], in, out;
    int hinge[5], n = 0;
    const double unit = outward(p, i, nu);
    for (int j = 0; j < 5; j++)
        if (p->open[near[j]])
            hinge[n++] = near[j];
    for (int kind = 0; kind < 3; kind++) {
        slopes(p, i, kind, middle, unit, nu, &in, &out);
        target[kind] = -(in + out) / 2;
        for (int j = 0; j < n; j++) {
            double across[2];
            outward(p, hinge[j], across);
            slopes(p, hinge[j], kind, middle, unit, across, &in, &out);
            m[n * kind + j] = out - in;
        }
    }
    drape_least_solution(m, n, target, c);
    for (int j = 0; j < n; j++)
        p->c[i][hinge[j]] = fabs(c[j]) > sqrt(DBL_EPSILON) ? c[j] : 0; /* smaller ones are rounding errors */
}

/* ---- K ---- */

static void make_squares(patch *p, const double law[9])
{
    const double area = p->cloth->triangle_area[p->triangle];
    double c[9], b[3 * MIDEDGE_HINGES], f[9];
    /* The derivatives of K = (K11, K22, 2 K12) by the angle of each hinge, b (9 x 3), and by the slopes
     * of the free edges, f. */
    int free_edges = 0;
    memset(b, 0, 3 * MIDEDGE_HINGES * sizeof *b);
    for (int i = 0; i < 3; i++) {
        double nu[2];
        const double w = outward(p, i, nu) / area;
        const double column[3] = {w * nu[0] * nu[0], w * nu[1] * nu[1], w * 2 * nu[0] * nu[1]};
        if (p->out->free[i]) {
            memcpy(f + 3 * free_edges++, column, sizeof column);
            continue;
        }
        for (int j = 0; j < MIDEDGE_HINGES; j++) {
            const double own = j != i ? 0 : p->out->clamped[i] ? 1 : 0.5;
            for (int r = 0; r < 3; r++)
                b[3 * j + r] += column[r] * (own + p->c[i][j]);
        }
    }
    drape_midedge *out = p->out;
    out->rank = 3 - free_edges;
    if (out->rank == 0)
        return;
    memcpy(c, law, sizeof c);
    drape_orthotropic_release(c, f, free_edges);
    drape_orthotropic_squares(c, out->rank, out->k, out->l);
    for (int r = 0; r < out->rank; r++) {
        const double *l = out->l + 3 * r;
        out->k[r] *= area;
        for (int j = 0; j < MIDEDGE_HINGES; j++)
            out->c[r][j] = l[0] * b[3 * j] + l[1] * b[3 * j + 1] + l[2] * b[3 * j + 2];
    }
}

bool drape_midedge_of(const drape_cloth_view *cloth, int32_t triangle, const double *values,
                      const double law[9], drape_midedge *out)
{
    patch p = {.cloth = cloth, .out = out, .triangle = triangle};
    double axes[6], flat[6];
    memset(out, 0, sizeof *out);
    if (!drape_orthotropic_frame(values, cloth, triangle, law, axes, flat))
        return false;
    drape_patch_around(cloth, triangle, flat, &p.around);
    memcpy(out->node, p.around.node, sizeof out->node);
    memcpy(out->edge, p.around.edge, sizeof out->edge);
    memcpy(out->turned, p.around.turned, sizeof out->turned);
    memcpy(out->shifted, p.around.shifted, sizeof out->shifted);
    memcpy(out->at_rest, p.around.at_rest, sizeof out->at_rest);
    memcpy(out->shift, p.around.shift, sizeof out->shift);
    for (int h = 0; h < MIDEDGE_HINGES; h++)
        p.open[h] = p.around.beyond[h] >= 0 && !cloth->edge_clamped[out->edge[h]];
    for (int i = 0; i < 3; i++) {
        out->clamped[i] = cloth->edge_clamped[out->edge[i]];
        out->free[i] = p.around.beyond[i] < 0 && !out->clamped[i];
    }
    for (int i = 0; i < 3; i++)
        if (p.open[i])
            find_phi(&p, i);
    make_squares(&p, law);
    return true;
}
