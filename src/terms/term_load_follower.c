/*
 * load.follower: a pressure p that follows the surface, as a force on every triangle: with m = (x1 - x0) x
 * (x2 - x0), twice the area times the normal,
 *     F = p A n = p m/2,   a third of it on each node,   dF/dx = p/2 dm/dx
 * (Hibbitt 1979, Some follower forces and load stiffness; Schweizerhof & Ramm 1984, Displacement dependent
 * pressure loads in nonlinear finite element analyses). Its resultant is p times the vector area of the cloth
 * whatever the boundary does: a pinned rim carries all of it, and an open edge is pressed by no more than the
 * triangles at it. The derivative is not symmetric at such edges, where the load has no potential: its work
 * is counted with that of drag. load.pressure has the same forces on nodes inside the cloth, and a potential.
 */
#include "base/vec3.h"
#include "terms/load_edges.h"
#include "terms/terms.h"

#include <string.h>

enum { PARAM_PRESSURE, LIST_HISTORY, LIST_RAMP, PARAM_COUNT };
enum { D = 9 };

static const drape_param params[PARAM_COUNT] = {
    [PARAM_PRESSURE] = DRAPE_NUMBER("pressure", "Pa", DRAPE_REQUIRED, -1e12, 1e12,
                                    "by which it is higher on the side from which triangles turn clockwise"),
    [LIST_HISTORY] = DRAPE_TERM_HISTORY_PARAM,
    [LIST_RAMP] = DRAPE_TERM_RAMP_PARAM,
};

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    (void)values;
    DRAPE_TRY(drape_load_check_faces(cloth, builder));
    DRAPE_TRY(drape_term_reserve(builder, cloth->triangle_count, 0));
    for (int32_t t = 0; t < cloth->triangle_count; t++)
        drape_term_set(builder, t, cloth->triangle + 3 * (size_t)t, NULL);
    return DRAPE_OK;
}

/* The same 3 x 9 rows for each node: m = X0 x X1 + X1 x X2 + X2 x X0, so that dm/dX_a turns dX_a about the
 * opposite edge, dm = dX_a x (X_b - X_c) with b after a. */
static void derive(double s, const double *const x[3], double *h)
{
    memset(h, 0, (size_t)(D * D) * sizeof *h);
    for (int a = 0; a < 3; a++) {
        double edge[3];
        vec3_sub(x[(a + 1) % 3], x[(a + 2) % 3], edge);
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3; /* (dX x e)_i = dX_j e_k - dX_k e_j */
            for (int node = 0; node < 3; node++) {
                h[D * (3 * node + i) + 3 * a + j] = -s * edge[k];
                h[D * (3 * node + i) + 3 * a + k] = s * edge[j];
            }
        }
    }
}

static void dissipation(const drape_elements *el, int32_t first, int32_t count, const double *x,
                        const double *v, double *g, double *dg_dx, double *dg_dv)
{
    const double s = el->params[PARAM_PRESSURE] / 6;
    (void)v;
    for (int32_t i = 0; i < count; i++) {
        const int32_t *node = el->node + 3 * (size_t)(first + i);
        const double *at[3];
        double a[3], b[3], m[3];
        for (int k = 0; k < 3; k++)
            at[k] = x + 3 * (size_t)node[k];
        vec3_sub(at[1], at[0], a);
        vec3_sub(at[2], at[0], b);
        vec3_cross(a, b, m);
        for (int k = 0; g && k < D; k++)
            g[D * (size_t)i + (size_t)k] = -s * m[k % 3];
        if (dg_dx)
            derive(s, at, dg_dx + (size_t)(D * D) * (size_t)i);
        if (dg_dv)
            memset(dg_dv + (size_t)(D * D) * (size_t)i, 0, (size_t)(D * D) * sizeof *dg_dv);
    }
}

const drape_term_ops drape_term_load_follower = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "load.follower",
              .summary = "a pressure that follows the surface, as the force p A n on every triangle, also at "
                         "open edges",
              .reference = "Hibbitt 1979, Some follower forces and load stiffness",
              DRAPE_PARAMS(params)},
    .element_name = "triangle",
    .nodes = 3,
    .external = true,
    .build = build,
    .dissipation = dissipation,
};
