/*
 * stretch.tension: a membrane without compression. The energy of every triangle is A W(E) of Green's strain
 * E = (F'F - I)/2, F = sum x_a grad N_a, as of stretch.cst, with the relaxed law W of tension.h in place of
 * that of Saint Venant and Kirchhoff: tension fields with wrinkles that the mesh need not resolve, and slack
 * cloth (Pipkin 1986, 1994; Steigmann 1990). With the columns p, q of F,
 *     e = ((p.p - 1)/2, (q.q - 1)/2, p.q),  gradient A T . de/dx,
 *     Hessian A (de' dT/de de + T . d2e),
 * both parts of which are positive semidefinite, as T and dT/de are: the energy is a convex function of x.
 */
#include "base/vec3.h"
#include "terms/orthotropic.h"
#include "terms/tension.h"
#include "terms/terms.h"

#include <string.h>

/* REST_11 and so on: 2 E + 1 at rest, with its rounding errors, so that the force at rest is exactly 0. */
enum { REST_AREA, REST_P1, REST_P2, REST_Q1, REST_Q2, REST_11, REST_22, REST_12, REST_COUNT };

static const drape_param params[DRAPE_ORTHOTROPIC_DIRECTION + 1] = {DRAPE_ORTHOTROPIC_PARAMS(
    "N/m", "of the material: its fabric, or E h", "shear", "shear stiffness, a force per length")};

/* By how much the columns p and q of F change with each corner: w (2 x 3). x (3 x 3). */
static void columns(double w[2][3], const double *x, double p[3], double q[3])
{
    for (int i = 0; i < 3; i++) {
        const double d1 = x[3 + i] - x[i], d2 = x[6 + i] - x[i];
        p[i] = w[0][1] * d1 + w[0][2] * d2;
        q[i] = w[1][1] * d1 + w[1][2] * d2;
    }
}

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    DRAPE_TRY(drape_term_reserve(builder, cloth->triangle_count, REST_COUNT));
    double *c = drape_term_share(builder, 9);
    if (!c)
        return DRAPE_E_MEMORY;
    drape_orthotropic_law(values, cloth->tension, cloth->material->membrane_stiffness,
                          cloth->material->poisson_ratio, c);
    for (int32_t t = 0; t < cloth->triangle_count; t++) {
        const int32_t *node = cloth->triangle + 3 * (size_t)t;
        double axes[6], flat[6], x[9], p[3], q[3];
        if (!drape_orthotropic_frame(values, cloth, t, c, axes, flat))
            return drape_orthotropic_refuse(builder, t);
        const double twice = flat[2] * flat[5] - flat[3] * flat[4];
        double w[2][3] = {{0, flat[5] / twice, -flat[3] / twice}, {0, -flat[4] / twice, flat[2] / twice}};
        for (int a = 0; a < 3; a++)
            memcpy(x + 3 * a, cloth->rest + 3 * (size_t)node[a], 3 * sizeof *x);
        columns(w, x, p, q);
        drape_term_set(builder, t, node,
                       (const double[REST_COUNT]){[REST_AREA] = cloth->triangle_area[t],
                                                  [REST_P1] = w[0][1],
                                                  [REST_P2] = w[0][2],
                                                  [REST_Q1] = w[1][1],
                                                  [REST_Q2] = w[1][2],
                                                  [REST_11] = vec3_dot(p, p),
                                                  [REST_22] = vec3_dot(q, q),
                                                  [REST_12] = vec3_dot(p, q)});
    }
    return DRAPE_OK;
}

static void triangle(const drape_elements *el, int32_t element, const double *x, double *e, double *g,
                     double *hess)
{
    const double area = drape_rest_of(el, REST_AREA, element);
    double w[2][3], p[3], q[3], by[3][9];
    drape_tension r;
    for (int k = 0; k < 2; k++) {
        w[k][1] = drape_rest_of(el, k ? REST_Q1 : REST_P1, element);
        w[k][2] = drape_rest_of(el, k ? REST_Q2 : REST_P2, element);
        w[k][0] = -w[k][1] - w[k][2];
    }
    columns(w, x, p, q);
    const double strain[3] = {(vec3_dot(p, p) - drape_rest_of(el, REST_11, element)) / 2,
                              (vec3_dot(q, q) - drape_rest_of(el, REST_22, element)) / 2,
                              vec3_dot(p, q) - drape_rest_of(el, REST_12, element)};
    drape_tension_relax(el->shared, strain, &r);
    if (e)
        *e = area * r.energy;
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 3; i++) {
            by[0][3 * a + i] = w[0][a] * p[i];
            by[1][3 * a + i] = w[1][a] * q[i];
            by[2][3 * a + i] = w[0][a] * q[i] + w[1][a] * p[i];
        }
    for (int i = 0; g && i < 9; i++)
        g[i] = area * (r.stress[0] * by[0][i] + r.stress[1] * by[1][i] + r.stress[2] * by[2][i]);
    for (int i = 0; hess && i < 9; i++) {
        double row[3]; /* of dT/dx */
        for (int k = 0; k < 3; k++)
            row[k] = r.tangent[3 * k] * by[0][i] + r.tangent[3 * k + 1] * by[1][i] +
                     r.tangent[3 * k + 2] * by[2][i];
        for (int j = 0; j <= i; j++) {
            const int a = i / 3, b = j / 3;
            double value = row[0] * by[0][j] + row[1] * by[1][j] + row[2] * by[2][j];
            if (i % 3 == j % 3)
                value += r.stress[0] * w[0][a] * w[0][b] + r.stress[1] * w[1][a] * w[1][b] +
                         r.stress[2] * (w[0][a] * w[1][b] + w[1][a] * w[0][b]);
            hess[9 * i + j] = hess[9 * j + i] = area * value;
        }
    }
}

DRAPE_ENERGY_BY(triangle)

const drape_term_ops drape_term_stretch_tension = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "stretch.tension",
              .summary = "a membrane that wrinkles instead of bearing compression: stretch.cst with the "
                         "relaxed energy of a tension field",
              .reference = "Pipkin 1986, 1994; Steigmann 1990",
              DRAPE_PARAMS(params)},
    .element_name = "triangle",
    .nodes = 3,
    .convex = true,
    .build = build,
    .energy = energy,
};
