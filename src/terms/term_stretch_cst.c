/*
 * stretch.cst: a membrane of constant-strain triangles with the law of Saint Venant and Kirchhoff,
 *     E = A/2 e' C e,  e = (E11, E22, 2 E12),  Green's strain E = (F'F - I)/2,  F = sum x_a grad N_a,
 * C the law of orthotropic.h, grad N_a at rest. C = sum k l l', so E = A/2 sum k (q - q0)^2, and each square
 * is an element, three per triangle. With d1 = x1 - x0, d2 = x2 - x0 and the gradients B_a of N_a:
 *     q = 1/2 (W11 d1.d1 + W22 d2.d2) + W12 d1.d2,
 *     W_ab = l1 B_a1 B_b1 + l2 B_a2 B_b2 + l3 (B_a1 B_b2 + B_a2 B_b1)
 * so the Hessian of q is constant, W in each of the three directions. (Bonet & Wood 2008, Nonlinear Continuum
 * Mechanics for Finite Element Analysis, 6.3; Volino, Magnenat-Thalmann & Faure 2009.)
 *
 * f W is the geometric stiffness of the stress f l: W = B' L B with L = (l1 l3; l3 l2). Its positive part is
 * that of f L, the tension part of the stress, which is known at rest: L = L+ + L-, by the eigenvalues.
 * Without it, Newton's matrix of a sheet under tension would be as soft sideways as without tension, and
 * steps too long by the ratio of the two.
 */
#include "base/elementary.h"
#include "base/lanes.h"
#include "base/vec3.h"
#include "terms/strain.h"

#include <math.h>
#include <string.h>

enum {
    REST_W11 = DRAPE_STRAIN_COUNT,
    REST_W12,
    REST_W22,
    REST_TENSION11, /* W of L+ */
    REST_TENSION12,
    REST_TENSION22,
    REST_COUNT
};

static const drape_param params[DRAPE_STRAIN_LIST] = {DRAPE_STRAIN_PARAMS};

/* The blocks of x1 and x2 are multiples W of the identity; those of x0 make the sums zero. */
static void hessian(const double w[3], double *ddq)
{
    const double m[9] = {w[0] + 2 * w[1] + w[2], -w[0] - w[1], -w[1] - w[2], -w[0] - w[1], w[0], w[1],
                         -w[1] - w[2],           w[1],         w[2]};
    memset(ddq, 0, 81 * sizeof *ddq);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            for (int i = 0; i < 3; i++)
                ddq[9 * (3 * a + i) + 3 * b + i] = m[3 * a + b];
}

/* The same for the elements in lanes: their blocks on and below the diagonal. */
LANES_INLINE void hessian_lanes(const lanes w[3], double *ddq)
{
    const lanes m[3][3] = {{w[0] + 2 * w[1] + w[2]}, {-w[0] - w[1], w[0]}, {-w[1] - w[2], w[1], w[2]}};
    for (int a = 0; a < 3; a++)
        for (int b = 0; b <= a; b++)
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    lanes_store(ddq + LANES * (9 * (3 * a + i) + 3 * b + j), i == j ? m[a][b] : (lanes){0});
}

LANES_DISPATCH static void measure_lanes(const drape_elements *el, const int32_t *element, const double *x,
                                         const double *internal, double *q, double *dq, double *ddq)
{
    lanes corner[3][3], w[3], d1[3], d2[3];
    (void)internal;
    for (int a = 0; a < 3; a++) {
        int32_t node[LANES];
        for (int l = 0; l < LANES; l++) {
            node[l] = el->node[3 * (size_t)element[l] + (size_t)a];
            w[a][l] = drape_rest_of(el, REST_W11 + a, element[l]);
        }
        lanes_gather(x, node, corner[a]);
    }
    for (int k = 0; k < 3; k++) {
        d1[k] = corner[1][k] - corner[0][k];
        d2[k] = corner[2][k] - corner[0][k];
    }
    lanes_store(q, 0.5 * (w[0] * lanes_dot(d1, d1) + w[2] * lanes_dot(d2, d2)) + w[1] * lanes_dot(d1, d2));
    for (int k = 0; dq && k < 3; k++) {
        const lanes by_1 = w[0] * d1[k] + w[1] * d2[k], by_2 = w[1] * d1[k] + w[2] * d2[k];
        lanes_store(dq + LANES * k, -by_1 - by_2);
        lanes_store(dq + LANES * (3 + k), by_1);
        lanes_store(dq + LANES * (6 + k), by_2);
    }
    if (ddq)
        hessian_lanes(w, ddq);
}

DRAPE_MEASURE_BY(measure_lanes)

/* W of L+ if the force is a tension, of L- = L - L+ if it is a compression. */
static void positive(const drape_elements *el, int32_t first, int32_t count, const double *x,
                     const double *internal, const double *force, double *ddq)
{
    (void)x, (void)internal;
    for (int32_t i = 0; i < count; i++) {
        double w[3];
        for (int k = 0; k < 3; k++) {
            const double tension = drape_rest_of(el, REST_TENSION11 + k, first + i);
            w[k] = force[i] > 0 ? tension : drape_rest_of(el, REST_W11 + k, first + i) - tension;
        }
        hessian(w, ddq + 81 * (size_t)i);
    }
}

/* L+ of L, both as (L11, L22, L12). The eigenvalues are mean +- radius; L+ is a linear combination of L and
 * the identity. */
static void tension_part(const double l[3], double plus[3])
{
    const double mean = (l[0] + l[1]) / 2, radius = drape_hypot((l[0] - l[1]) / 2, l[2]);
    const double high = fmax(0, mean + radius), low = fmax(0, mean - radius);
    const double share = radius > 0 ? (high - low) / (2 * radius) : 0, rest = (high + low) / 2 - share * mean;
    plus[0] = share * l[0] + rest;
    plus[1] = share * l[1] + rest;
    plus[2] = share * l[2];
}

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    double c[9], k[3], l[9];
    DRAPE_TRY(drape_strain_begin(cloth, values, builder, REST_COUNT, c, k, l));
    for (int32_t t = 0; t < cloth->triangle_count; t++) {
        const int32_t *node = cloth->triangle + 3 * (size_t)t;
        double axes[6], flat[6], w[3], plus[3], tension[3], d1[3], d2[3];
        if (!drape_orthotropic_frame(values, cloth, t, c, axes, flat))
            return drape_orthotropic_refuse(builder, t);
        vec3_triangle_sides(node, cloth->rest, d1, d2);
        for (int r = 0; r < 3; r++) {
            const double area = cloth->triangle_area[t];
            drape_strain_weights(l + 3 * r, flat, w);
            tension_part(l + 3 * r, plus);
            drape_strain_weights(plus, flat, tension);
            drape_term_set(
                builder, 3 * t + r, node,
                (const double[REST_COUNT]){k[r] * area,
                                           0.5 * (w[0] * vec3_dot(d1, d1) + w[2] * vec3_dot(d2, d2)) +
                                               w[1] * vec3_dot(d1, d2),
                                           area, w[0], w[1], w[2], tension[0], tension[1], tension[2]});
        }
    }
    return DRAPE_OK;
}

const drape_term_ops drape_term_stretch_cst = {
    .struct_size = sizeof(drape_term_ops),
    .entry =
        {.name = "stretch.cst",
         .summary =
             "stretching and shear of every triangle, isotropic or woven: E = A/2 e'C e of Green's strain",
         .reference = "Bonet & Wood 2008, 6.3; Volino, Magnenat-Thalmann & Faure 2009",
         DRAPE_PARAMS(params)},
    .element_name = "square",
    .nodes = 3,
    .build = build,
    .measure = measure,
    .lanes = measure_lanes,
    .positive = positive,
    .check = drape_strain_check,
};
