/*
 * stretch.edge: a spring along each edge. With u = (x1 - x0)/|x1 - x0| and rest length L:
 *     q = |x1 - x0|/L - 1,  dq/dx1 = -dq/dx0 = u/L,  d2q/dx1 dx1 = (I - u u')/(L |x1 - x0|)
 *     E = 1/2 k q^2
 *
 * consistent: k = E h (A1 + A2), that is the spring constant K = k/L^2 = E h (A1 + A2)/L^2 of Van Gelder
 *     (1998); each triangle has half a spring, so a boundary edge has K/2. On an equilateral mesh
 *     K = sqrt(3)/2 E h, and the lattice equals constant-strain triangles of a sheet with nu = 1/3.
 * report: as the code of the DEP report, where k_s = sqrt(3)/2 E h L^2 [J] is used as a force [N]:
 *     E = 1/2 k_s L q^2, too soft by a factor of the edge length, with boundary edges as stiff as the others.
 *     It is there
 *     to reproduce the trajectories of the report.
 *
 * A periodic edge has an element on each of its sides, each with what its own triangle gives, or half of the
 * stiffness of the report.
 */
#include "base/vec3.h"
#include "terms/terms.h"

#include <math.h>

enum { PARAM_STIFFNESS, PARAM_COUNT };
enum { STIFFNESS_CONSISTENT, STIFFNESS_REPORT };
enum { REST_K, REST_Q0, REST_INVERSE_LENGTH, REST_COUNT };

static const char *const stiffness_choices[] = {"consistent", "report", NULL};

static const drape_param params[PARAM_COUNT] = {
    [PARAM_STIFFNESS] = DRAPE_CHOICE("stiffness", STIFFNESS_CONSISTENT, stiffness_choices,
                                     "consistent: that of a sheet of the material; report: that of the code "
                                     "of the DEP report, on edges too soft by the factor of one edge length"),
};

static double element_stiffness(const drape_cloth_view *cloth, int32_t edge, double choice)
{
    double length = cloth->edge_length[edge], membrane = cloth->material->membrane_stiffness;
    const int32_t *beside = cloth->edge_triangle + 2 * (size_t)edge;
    const bool halved = cloth->edge_image && cloth->edge_image[edge] >= 0;
    if (choice == STIFFNESS_REPORT)
        return (halved ? 0.5 : 1) * sqrt(3.0) / 2 * membrane * length * length * length;
    double area = cloth->triangle_area[beside[0]];
    if (beside[1] >= 0)
        area += cloth->triangle_area[beside[1]];
    return membrane * area;
}

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    DRAPE_TRY(drape_term_reserve(builder, cloth->edge_count, REST_COUNT));
    for (int32_t e = 0; e < cloth->edge_count; e++) {
        double rest[REST_COUNT] = {[REST_K] = element_stiffness(cloth, e, values[PARAM_STIFFNESS]),
                                   [REST_Q0] = 0,
                                   [REST_INVERSE_LENGTH] = 1 / cloth->edge_length[e]};
        drape_term_set(builder, e, cloth->edge + 2 * (size_t)e, rest);
    }
    return DRAPE_OK;
}

static void measure(const drape_elements *el, int32_t first, int32_t count, const double *x,
                    const double *internal, double *q, double *dq, double *ddq)
{
    (void)internal;
    const double *inverse = el->rest + (size_t)REST_INVERSE_LENGTH * (size_t)el->count + first;
    for (int32_t i = 0; i < count; i++) {
        const int32_t *node = el->node + 2 * (size_t)(first + i);
        double u[3];
        vec3_sub(x + 3 * (size_t)node[1], x + 3 * (size_t)node[0], u);
        double length = vec3_norm(u);
        q[i] = length * inverse[i] - 1;
        for (int k = 0; k < 3; k++)
            u[k] /= length;
        for (int k = 0; dq && k < 3; k++) {
            dq[6 * i + 3 + k] = u[k] * inverse[i];
            dq[6 * i + k] = -dq[6 * i + 3 + k];
        }
        const double scale = ddq ? inverse[i] / length : 0;
        double p[9];
        for (int k = 0; ddq && k < 9; k++)
            p[k] = scale * ((k % 4 == 0) - u[k / 3] * u[k % 3]);
        if (ddq)
            drape_pair_block(p, ddq + 36 * (size_t)i);
    }
}

/* dq = (-d, d)/(L l) */
static void pair(const drape_elements *el, int32_t first, int32_t count, const double *x, double *q,
                 double *d, double *c)
{
    const double *inverse = el->rest + (size_t)REST_INVERSE_LENGTH * (size_t)el->count + first;
    drape_pair_distance(el, first, count, x, q, d);
    for (int32_t i = 0; i < count; i++) {
        c[i] = inverse[i] / q[i];
        q[i] = q[i] * inverse[i] - 1;
    }
}

/* Length over rest length. */
static double ratio_of(const drape_elements *el, int32_t e, const double *x)
{
    return drape_pair_length(el, e, x) * drape_rest_of(el, REST_INVERSE_LENGTH, e);
}

static drape_status check(const drape_elements *el, const double *x, const double *before,
                          const double *internal, drape_fault *fault)
{
    (void)internal;
    return drape_check_ratios(el, x, before, 1, ratio_of, DRAPE_REASON_EDGE_COLLAPSE,
                              "edge length / rest length", fault);
}

const drape_term_ops drape_term_stretch_edge = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "stretch.edge",
              .summary = "stretching of every edge: E = 1/2 k (|e|/L - 1)^2",
              .reference = "Van Gelder 1998; DEP report (Grinspun et al. 2003, Discrete Shells)",
              DRAPE_PARAMS(params)},
    .element_name = "edge",
    .nodes = 2,
    .build = build,
    .convex = true,
    .measure = measure,
    .pair = pair,
    .check = check,
    .periodic = true,
};
