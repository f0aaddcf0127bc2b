/*
 * stretch.patch: a membrane that does not lock. The energy is that of stretch.cst, A/2 e' C e for every
 * triangle, C the law of orthotropic.h, but e is Green's strain of the patch of the triangle and its three
 * neighbours instead of that of its straight edges.
 *
 * Strains that vary. At each edge, F is the mean of the two triangles by area, which is the linear map of the
 * edge d and of the line a between the two apices; at the boundary it is that of the triangle. e is the mean
 * of F'F at the three edges (Flores & Onate 2005, Improvements in the membrane behaviour of the three node
 * rotation-free BST shell triangle using an assumed strain approach; Liu & Nguyen-Thoi 2009, edge-based
 * smoothing). Constant-strain triangles are far too stiff where a strain changes from one to the next, as in
 * the rim of a sheet that is bent in two directions.
 *
 * Curvature. Straight edges of a bent sheet are shorter than at rest. With x,ab the second derivatives of the
 * sheet, an isometric bending has x,a.x,bcd = -x,ab.x,cd, so that
 *     d.d = g(d,d) - |x,dd|^2/12,  a.a = g(a,a) - |x,aa|^2/12,
 *     d.a = g(d,a) - x,da.(x,dd + x,aa)/24 - x,do.x,ao/2
 * up to terms of fourth order, g the metric of the sheet, o from the middle of d to that of a. What is
 * missing differs from edge to edge; in general no displacement in the plane balances it, and triangles
 * resist: membrane locking (Stolarski & Belytschko 1983). Here it is added, with second derivatives that are
 * sums of c_k x_k over the six nodes of the patch, exact for quadratics in the plane of the triangle at rest
 * (Cirak, Ortiz & Schroeder 2000 take curvatures from such patches).
 *
 * Uniform stretching has no second derivatives: its strain is exact, and because the F of the edges by their
 * areas sum up to those of the triangles, so are its forces: the patch test. Every term is a product of two
 * vectors, so e is invariant, and each measure a quadratic form q = 1/2 sum W_kl x_k.x_l: its Hessian is W in
 * each of the three directions, its positive part known at rest.
 *
 * Where a neighbour is missing, the apex of another triangle near by replaces it in the second derivatives.
 * What the nodes do not determine, such as the curvature across a strip of one cell, is taken as 0.
 */
#include "base/lanes.h"
#include "base/vec3.h"
#include "sparse/project.h"
#include "terms/patch.h"
#include "terms/strain.h"

#include <math.h>
#include <string.h>

enum { NODES = 6, FREE = NODES - 1, WEIGHTS = FREE * (FREE + 1) / 2, CANDIDATES = DRAPE_PATCH_NODES - 3 };
enum {
    REST_W = DRAPE_STRAIN_COUNT,      /* W of nodes 1 ... 5: rows of the lower triangle. All sums are zero */
    REST_POSITIVE = REST_W + WEIGHTS, /* the same of its positive semidefinite part */
    REST_COUNT = REST_POSITIVE + WEIGHTS
};

/* Cost of a second derivative that the nodes do not determine, relative to one that they do. */
#define MISSING 1e6

static const drape_param params[DRAPE_STRAIN_LIST] = {DRAPE_STRAIN_PARAMS};

/* ---- Measures ---- */

static int place(int a, int b)
{
    return a >= b ? a * (a + 1) / 2 + b : b * (b + 1) / 2 + a;
}

LANES_DISPATCH static void measure_lanes(const drape_elements *el, const int32_t *element, const double *x,
                                         const double *internal, double *q, double *dq, double *ddq)
{
    lanes d[FREE][3], w[FREE][FREE], force[FREE][3], sum = {0}, first[3] = {{0}}, corner[3];
    int32_t node[LANES];
    (void)internal;
    for (int l = 0; l < LANES; l++)
        node[l] = el->node[NODES * (size_t)element[l]];
    lanes_gather(x, node, corner);
    for (int a = 0; a < FREE; a++) {
        for (int l = 0; l < LANES; l++)
            node[l] = el->node[NODES * (size_t)element[l] + (size_t)a + 1];
        lanes_gather(x, node, d[a]);
        for (int k = 0; k < 3; k++)
            d[a][k] -= corner[k];
        for (int b = 0; b <= a; b++) {
            for (int l = 0; l < LANES; l++)
                w[a][b][l] = drape_rest_of(el, REST_W + a * (a + 1) / 2 + b, element[l]);
            w[b][a] = w[a][b];
        }
    }
    for (int a = 0; a < FREE; a++)
        for (int k = 0; k < 3; k++) {
            force[a][k] = w[a][0] * d[0][k];
            for (int b = 1; b < FREE; b++)
                force[a][k] += w[a][b] * d[b][k];
            first[k] -= force[a][k];
            sum += force[a][k] * d[a][k];
        }
    lanes_store(q, 0.5 * sum);
    for (int k = 0; dq && k < 3; k++) {
        lanes_store(dq + LANES * k, first[k]);
        for (int a = 0; a < FREE; a++)
            lanes_store(dq + LANES * (3 * (a + 1) + k), force[a][k]);
    }
    if (!ddq)
        return;
    for (int a = 0; a < NODES; a++)
        for (int b = 0; b <= a; b++) {
            lanes m = {0};
            for (int i = 0; i < FREE; i++)
                if (b > 0)
                    m = w[a - 1][b - 1];
                else if (a > 0)
                    m -= w[a - 1][i];
                else
                    for (int j = 0; j < FREE; j++)
                        m += w[i][j];
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    lanes_store(ddq + LANES * (3 * NODES * (3 * a + i) + 3 * b + j), i == j ? m : (lanes){0});
        }
}

DRAPE_MEASURE_BY(measure_lanes)

/* The positive part of W if the force is a tension, the rest of it if it is a compression. */
static void positive(const drape_elements *el, int32_t first, int32_t count, const double *x,
                     const double *internal, const double *force, double *ddq)
{
    (void)x, (void)internal;
    for (int32_t i = 0; i < count; i++) {
        double w[WEIGHTS], full[NODES * NODES], *to = ddq + (size_t)i * 9 * NODES * NODES;
        for (int k = 0; k < WEIGHTS; k++) {
            const double plus = drape_rest_of(el, REST_POSITIVE + k, first + i);
            w[k] = force[i] > 0 ? plus : drape_rest_of(el, REST_W + k, first + i) - plus;
        }
        /* W of all nodes, from W of nodes 1 ... 5. */
        memset(full, 0, NODES * NODES * sizeof *full);
        for (int a = 1; a < NODES; a++)
            for (int b = 1; b < NODES; b++) {
                const double v = w[place(a - 1, b - 1)];
                full[NODES * a + b] = v;
                full[NODES * a] -= v;
                full[b] -= v;
                full[0] += v;
            }
        memset(to, 0, 9 * NODES * NODES * sizeof *to);
        for (int a = 0; a < NODES; a++)
            for (int b = 0; b < NODES; b++)
                for (int k = 0; k < 3; k++)
                    to[3 * NODES * (3 * a + k) + 3 * b + k] = full[NODES * a + b];
    }
}

/* ---- Second derivatives ---- */

/* The second derivatives of the sheet at a triangle. They are taken in coordinates in which it is
 * equilateral, so that a mesh of thin triangles is fitted as well as one of good ones. */
typedef struct fit {
    const drape_patch *patch;
    int extra[3];       /* places in the patch of the nodes besides those of the triangle; 0: none */
    double c[3][NODES]; /* x,11 x,22 and 2 x,12 as sums of c x, first of the nodes of the triangle */
    double cost;        /* squares of the c of the others, and of what they do not determine */
} fit;

/* A vector of the plane in these coordinates; lambda (2) are its components along two sides of the
 * triangle. */
static void transform(const double *flat, const double v[2], double lambda[2], double to[2])
{
    const double a[2] = {flat[2] - flat[0], flat[3] - flat[1]}, b[2] = {flat[4] - flat[0], flat[5] - flat[1]};
    const double twice = a[0] * b[1] - a[1] * b[0];
    lambda[0] = (v[0] * b[1] - v[1] * b[0]) / twice;
    lambda[1] = (a[0] * v[1] - a[1] * v[0]) / twice;
    to[0] = lambda[0] + lambda[1] / 2;
    to[1] = lambda[1] * sqrt(3) / 2;
}

/* A function is larger at another node than continued linearly from the triangle by x,11 m0 + x,22 m1 + 2
 * x,12 m2: equations for c. */
static void fit_nodes(const drape_patch *patch, const int extra[3], fit *out)
{
    const double *flat = patch->flat;
    double lambda[3][2], m[9] = {0};
    int count = 0;
    *out = (fit){.patch = patch};
    memcpy(out->extra, extra, sizeof out->extra);
    for (; count < 3 && extra[count]; count++) {
        const double *at = flat + 2 * extra[count], v[2] = {at[0] - flat[0], at[1] - flat[1]};
        double *l = lambda[count], r[2];
        transform(flat, v, l, r);
        m[count] = (r[0] * r[0] - l[0] - l[1] / 4) / 2;
        m[3 + count] = (r[1] * r[1] - l[1] * 3 / 4) / 2;
        m[6 + count] = (r[0] * r[1] - l[1] * sqrt(3) / 4) / 2;
    }
    for (int k = 0; k < 3; k++) {
        const double target[3] = {k == 0, k == 1, k == 2};
        double g[3] = {0};
        drape_least_solution(m, 3, target, g);
        for (int i = 0; i < 3; i++) {
            const double rest = target[i] - m[3 * i] * g[0] - m[3 * i + 1] * g[1] - m[3 * i + 2] * g[2];
            out->cost += MISSING * rest * rest;
        }
        for (int n = 0; n < count; n++) {
            out->cost += g[n] * g[n];
            out->c[k][3 + n] = g[n];
            out->c[k][0] -= g[n] * (1 - lambda[n][0] - lambda[n][1]);
            out->c[k][1] -= g[n] * lambda[n][0];
            out->c[k][2] -= g[n] * lambda[n][1];
        }
    }
}

/* By the apices of the neighbours, and the best of the others for those that are missing. */
static void fit_patch(const drape_patch *patch, fit *best)
{
    int candidate[CANDIDATES] = {0}, own = 0, count = 0; /* places in the patch around the triangle */
    for (int n = 3; n < DRAPE_PATCH_NODES; n++) {
        int k = 0;
        while (k < n && patch->node[k] != patch->node[n])
            k++;
        if (patch->node[n] >= 0 && k == n)
            candidate[count++] = n;
    }
    while (own < count && candidate[own] < 6)
        own++;
    fit_nodes(patch, candidate, best);
    for (int i = 0; own < 3 && i < (own > 0 ? 1 : count); i++)
        for (int j = own > 1 ? 1 : i + 1; j < (own > 1 ? 2 : count); j++)
            for (int k = j + 1; k < count; k++) {
                fit other;
                fit_nodes(patch, (const int[3]){candidate[i], candidate[j], candidate[k]}, &other);
                if (other.cost < best->cost)
                    *best = other;
            }
}

/* x,uv as a sum of c x. */
static void second_derivative(const fit *f, const double u[2], const double v[2], double c[NODES])
{
    double lambda[2], p[2], q[2];
    transform(f->patch->flat, u, lambda, p);
    transform(f->patch->flat, v, lambda, q);
    for (int n = 0; n < NODES; n++)
        c[n] = p[0] * q[0] * f->c[0][n] + p[1] * q[1] * f->c[1][n] +
               (p[0] * q[1] + p[1] * q[0]) / 2 * f->c[2][n];
}

/* ---- W ---- */

/* Where node n of the patch, one of the first six, is in the element. On small closed meshes several of them
 * are the same. */
static int place_in(const fit *f, int n)
{
    const int32_t *node = f->patch->node;
    int k = 0;
    while (k < NODES - 1 && node[k < 3 ? k : f->extra[k - 3]] != node[n])
        k++;
    return k;
}

/* Adds the Hessian of weight u.v for the vectors u = sum u_k x_k, v = sum v_k x_k. */
static void add_product(double weight, const double u[NODES], const double v[NODES], double w[NODES * NODES])
{
    for (int k = 0; k < NODES; k++)
        for (int l = 0; l < NODES; l++)
            w[NODES * k + l] += weight * (u[k] * v[l] + v[k] * u[l]);
}

/* The vector between two nodes of the patch: at rest, and as a sum of x. */
static void difference(const fit *f, int from, int to, double rest[2], double of[NODES])
{
    memset(of, 0, NODES * sizeof *of);
    of[place_in(f, from)] -= 1;
    of[place_in(f, to)] += 1;
    for (int k = 0; k < 2; k++)
        rest[k] = f->patch->flat[2 * to + k] - f->patch->flat[2 * from + k];
}

/* Adds `share` times the square l of the strain at an edge between two triangles. */
static void add_inner_edge(const fit *f, int edge, const double l[3], double share, double w[NODES * NODES])
{
    const int *hinge = drape_patch_hinge[edge];
    double flat[6] = {0}, o[2], weight[3], d[NODES], a[NODES], dd[NODES], da[NODES], aa[NODES], od[NODES],
           oa[NODES];
    difference(f, hinge[0], hinge[1], flat + 2, d);
    difference(f, hinge[3], hinge[2], flat + 4, a);
    for (int k = 0; k < 2; k++)
        o[k] = (f->patch->flat[2 * hinge[2] + k] + f->patch->flat[2 * hinge[3] + k] -
                f->patch->flat[2 * hinge[0] + k] - f->patch->flat[2 * hinge[1] + k]) /
               2;
    second_derivative(f, flat + 2, flat + 2, dd);
    second_derivative(f, flat + 2, flat + 4, da);
    second_derivative(f, flat + 4, flat + 4, aa);
    second_derivative(f, o, flat + 2, od);
    second_derivative(f, o, flat + 4, oa);
    drape_strain_weights(l, flat, weight);
    for (int k = 0; k < 3; k++)
        weight[k] *= share;
    add_product(weight[0] / 2, d, d, w);
    add_product(weight[1], d, a, w);
    add_product(weight[2] / 2, a, a, w);
    add_product(weight[0] / 24, dd, dd, w);
    add_product(weight[1] / 24, da, dd, w);
    add_product(weight[1] / 24, da, aa, w);
    add_product(weight[1] / 2, od, oa, w);
    add_product(weight[2] / 24, aa, aa, w);
}

/* The same at an edge of the boundary: of the triangle alone, whose strain the lengths of its edges give. */
static void add_outer_edge(const fit *f, const double l[3], double share, double w[NODES * NODES])
{
    double weight[3];
    drape_strain_weights(l, f->patch->flat, weight);
    const double of[3] = {weight[0] + weight[1], -weight[1], weight[1] + weight[2]};
    for (int i = 0; i < 3; i++) {
        double rest[2], d[NODES], dd[NODES];
        difference(f, i, (i + 1) % 3, rest, d);
        second_derivative(f, rest, rest, dd);
        add_product(share * of[i] / 2, d, d, w);
        add_product(share * of[i] / 24, dd, dd, w);
    }
}

static void quadratic_form(const fit *f, const double l[3], double w[NODES * NODES])
{
    memset(w, 0, NODES * NODES * sizeof *w);
    for (int i = 0; i < 3; i++)
        if (f->patch->beyond[i] >= 0)
            add_inner_edge(f, i, l, 1.0 / 3, w);
        else
            add_outer_edge(f, l, 1.0 / 3, w);
}

/* ---- Building ---- */

static void set_square(drape_term_builder *builder, int32_t element, const int32_t node[NODES],
                       const double w[NODES * NODES], const double *x, double k, double area)
{
    static const int32_t same[LANES] = {0}, local[NODES] = {0, 1, 2, 3, 4, 5};
    double rest[REST_COUNT] = {[DRAPE_STRAIN_K] = k, [DRAPE_STRAIN_AREA] = area}, plus[NODES * NODES];
    double at[3 * NODES], q[LANES];
    memcpy(plus, w, sizeof plus);
    drape_project(NODES, plus);
    for (int a = 1; a < NODES; a++)
        for (int b = 1; b <= a; b++) {
            rest[REST_W + place(a - 1, b - 1)] = w[NODES * a + b];
            rest[REST_POSITIVE + place(a - 1, b - 1)] = plus[NODES * a + b];
        }
    for (int a = 0; a < NODES; a++)
        memcpy(at + 3 * a, x + 3 * (size_t)node[a], 3 * sizeof *x);
    /* By the function that steps use, so that a cloth at rest has no force to the last bit. */
    measure_lanes(&(drape_elements){.count = 1, .nodes = NODES, .node = local, .rest = rest}, same, at, NULL,
                  q, NULL, NULL);
    rest[DRAPE_STRAIN_Q0] = q[0];
    drape_term_set(builder, element, node, rest);
}

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    double c[9], k[3], l[9];
    DRAPE_TRY(drape_strain_begin(cloth, values, builder, REST_COUNT, c, k, l));
    for (int32_t t = 0; t < cloth->triangle_count; t++) {
        double axes[6], flat[6], w[NODES * NODES];
        int32_t node[NODES];
        drape_patch patch;
        fit f;
        if (!drape_orthotropic_frame(values, cloth, t, c, axes, flat))
            return drape_orthotropic_refuse(builder, t);
        drape_patch_around(cloth, t, flat, &patch);
        fit_patch(&patch, &f);
        for (int a = 0; a < NODES; a++)
            node[a] = patch.node[a < 3 ? a : f.extra[a - 3]];
        for (int r = 0; r < 3; r++) {
            quadratic_form(&f, l + 3 * r, w);
            set_square(builder, 3 * t + r, node, w, cloth->rest, k[r] * cloth->triangle_area[t],
                       cloth->triangle_area[t]);
        }
    }
    return DRAPE_OK;
}

const drape_term_ops drape_term_stretch_patch = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "stretch.patch",
              .summary = "stretching and shear as stretch.cst, with strains of every triangle and its "
                         "neighbours: does not lock in bending",
              .reference = "Flores & Onate 2005, assumed strains of a patch of four triangles, with the "
                           "curvature of the patch",
              DRAPE_PARAMS(params)},
    .element_name = "square",
    .nodes = NODES,
    .build = build,
    .measure = measure,
    .lanes = measure_lanes,
    .positive = positive,
    .check = drape_strain_check,
};
