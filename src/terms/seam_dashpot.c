/*
 * dashpot: a dashpot between each node of one side and that of the other, along the line d between them,
 * with the relative velocity w:
 *     force c (d . w) d / (l^2 + s^2),    l = |d|,
 * which is c times the rate of l where l is much larger than s. It has no torque, takes nothing from a
 * motion of both nodes as one body, and is smooth where the nodes meet: there it vanishes, as a direction
 * along d does.
 */
#include "terms/terms.h"

#include <math.h>

enum { REST_COEFFICIENT, REST_SMOOTHING, REST_COUNT };

#define SHARE 1e-3 /* s, of the distance between neighbouring nodes: the root of a node's mean area */

static const drape_param params[] = {
    DRAPE_NUMBER("coefficient", "N s/m", DRAPE_REQUIRED, 0, 1e12,
                 "c of each pair of nodes: force over the rate of their distance; less where they are nearer "
                 "than 0.001 of that of neighbours"),
};

static drape_status build(const drape_seam_view *seam, const double *values, drape_term_builder *builder)
{
    double area = 0; /* the mean of the nodes that the seam joins */
    for (int32_t i = 0; i < 2 * seam->pair_count; i++) {
        const int side = i % 2;
        area += seam->cloth[side]->node_area[seam->pair[i] - seam->first_node[side]] / (2 * seam->pair_count);
    }
    const double rest[REST_COUNT] = {[REST_COEFFICIENT] = *values, [REST_SMOOTHING] = SHARE * sqrt(area)};
    DRAPE_TRY(drape_term_reserve(builder, seam->pair_count, REST_COUNT));
    for (int32_t i = 0; i < seam->pair_count; i++)
        drape_term_set(builder, i, seam->pair + 2 * (size_t)i, rest);
    return DRAPE_OK;
}

static void dissipation(const drape_elements *el, int32_t first, int32_t count, const double *x,
                        const double *v, double *g, double *dg_dx, double *dg_dv)
{
    for (int32_t i = 0; i < count; i++) {
        const size_t a = 3 * (size_t)el->node[2 * (first + i)], b = 3 * (size_t)el->node[2 * (first + i) + 1],
                     row = (size_t)i;
        double d[3], w[3];
        for (int k = 0; k < 3; k++) {
            d[k] = x[b + (size_t)k] - x[a + (size_t)k];
            w[k] = v[b + (size_t)k] - v[a + (size_t)k];
        }
        const double c = drape_rest_of(el, REST_COEFFICIENT, first + i),
                     s = drape_rest_of(el, REST_SMOOTHING, first + i),
                     q = 1 / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + s * s),
                     rate = q * (d[0] * w[0] + d[1] * w[1] + d[2] * w[2]); /* force c rate d */
        double by_x[9], by_v[9];
        for (int k = 0; k < 3; k++) {
            g[6 * row + (size_t)k] = -c * rate * d[k];
            g[6 * row + 3 + (size_t)k] = c * rate * d[k];
            for (int j = 0; j < 3; j++) {
                by_v[3 * k + j] = c * q * d[k] * d[j];
                by_x[3 * k + j] = c * (d[k] * (q * w[j] - 2 * rate * q * d[j]) + (k == j ? rate : 0));
            }
        }
        if (dg_dx)
            drape_pair_block(by_x, dg_dx + 36 * row);
        if (dg_dv)
            drape_pair_block(by_v, dg_dv + 36 * row);
    }
}

const drape_term_ops drape_seam_dashpot = {
    .struct_size = sizeof(drape_term_ops),
    .entry =
        {.name = "dashpot",
         .summary =
             "dashpots that damp the distance of the nodes of both sides: force c (d . w) d / (l^2 + s^2)",
         .reference = "Provot 1995, Deformation constraints in a mass-spring model to describe rigid cloth "
                      "behavior: a viscous damper, here along the line between the nodes",
         DRAPE_PARAMS(params)},
    .element_name = "dashpot",
    .nodes = 2,
    .build_seam = build,
    .dissipation = dissipation,
    .dissipative = true,
};
