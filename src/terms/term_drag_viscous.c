/*
 * drag.viscous: linear drag of a medium at rest on every node: g = c A v with the node's share A of the area.
 * It acts on rigid motion by design; damp.kelvin_voigt does not. dg/dv = c A I, dg/dx = 0.
 */
#include "terms/terms.h"

#include <math.h>
#include <string.h>

enum { PARAM_COEFFICIENT, PARAM_AREA, PARAM_COUNT };
enum { AREA_LUMPED, AREA_UNIFORM };

static const char *const area_choices[] = {[AREA_LUMPED] = "lumped", [AREA_UNIFORM] = "uniform", NULL};

static const drape_param params[PARAM_COUNT] = {
    [PARAM_COEFFICIENT] =
        DRAPE_NUMBER("coefficient", "kg/(m2 s)", DRAPE_REQUIRED, 0, 1e9,
                     "drag per area and speed: a node loses speed at the rate coefficient / areal density"),
    [PARAM_AREA] = DRAPE_CHOICE("area", AREA_LUMPED, area_choices,
                                "a node's share; lumped: a third of each triangle; uniform: the same for "
                                "every node, as Boson's drag"),
};

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    DRAPE_TRY(drape_term_reserve(builder, cloth->node_count, 1));
    double mean = 0;
    for (int32_t i = 0; i < cloth->node_count; i++)
        mean += cloth->node_area[i] / cloth->node_count;
    for (int32_t i = 0; i < cloth->node_count; i++) {
        double area = values[PARAM_AREA] == AREA_UNIFORM ? mean : cloth->node_area[i];
        double rest = values[PARAM_COEFFICIENT] * area;
        drape_term_set(builder, i, &i, &rest);
    }
    return DRAPE_OK;
}

static void dissipation(const drape_elements *el, int32_t first, int32_t count, const double *x,
                        const double *v, double *g, double *dg_dx, double *dg_dv)
{
    (void)x;
    for (int32_t i = 0; i < count; i++) {
        double c = el->rest[first + i];
        for (int k = 0; k < 3; k++)
            g[3 * (size_t)i + (size_t)k] = c * v[3 * (size_t)el->node[first + i] + (size_t)k];
        if (dg_dv)
            for (int k = 0; k < 9; k++)
                dg_dv[9 * (size_t)i + (size_t)k] = k % 4 == 0 ? c : 0;
    }
    if (dg_dx)
        memset(dg_dx, 0, 9 * (size_t)count * sizeof *dg_dx);
}

const drape_term_ops drape_term_drag_viscous = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "drag.viscous",
              .summary = "viscous drag of a medium at rest on every node: force -c A v",
              .reference = "linear drag; Boson's air drag is this with c A = 0.3 kg/s a node",
              DRAPE_PARAMS(params)},
    .element_name = "node",
    .nodes = 1,
    .build = build,
    .dissipation = dissipation,
    .dissipative = true,
    .in_medium = true,
};
