/* load.line: a dead force per length on boundary edges: E = -f . (x0 + x1) L/2 with the rest length L.
 * Linear: it has no Hessian. */
#include "terms/load_edges.h"
#include "terms/terms.h"

enum { LIST_FORCE = DRAPE_LOAD_LIST_COUNT, LIST_HISTORY, LIST_RAMP, LIST_COUNT };
enum { PARAM_FORCE = DRAPE_LOAD_COUNT };
enum { REST_HALF_X, REST_HALF_Y, REST_HALF_Z, REST_COUNT }; /* half the force on an edge [N] */

static const drape_param params[LIST_COUNT] = {
    DRAPE_LOAD_PARAMS,
    [LIST_FORCE] = DRAPE_VECTOR("force", "N/m", 0, -1e12, 1e12,
                                "force per length of the edge at rest; it keeps its direction"),
    [LIST_HISTORY] = DRAPE_TERM_HISTORY_PARAM,
    [LIST_RAMP] = DRAPE_TERM_RAMP_PARAM,
};

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    int32_t count, next = 0;
    DRAPE_TRY(drape_load_count(cloth, values, builder, &count));
    DRAPE_TRY(drape_term_reserve(builder, count, REST_COUNT));
    for (int32_t e = 0; e < cloth->edge_count; e++) {
        double half[REST_COUNT];
        if (!drape_load_takes(cloth, values, e))
            continue;
        for (int k = 0; k < REST_COUNT; k++)
            half[k] = values[PARAM_FORCE + k] * cloth->edge_length[e] / 2;
        drape_term_set(builder, next++, cloth->edge + 2 * (size_t)e, half);
    }
    return DRAPE_OK;
}

static void energy(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *internal, double *e, double *g, double *hess)
{
    (void)internal;
    (void)hess;
    for (int32_t i = 0; i < count; i++) {
        const int32_t *node = el->node + 2 * (size_t)(first + i);
        double sum = 0;
        for (int k = 0; k < 6; k++) {
            const double force = el->rest[(size_t)(k % 3) * (size_t)el->count + (size_t)(first + i)];
            sum -= force * x[3 * (size_t)node[k / 3] + (size_t)(k % 3)];
            if (g)
                g[6 * (size_t)i + (size_t)k] = -force;
        }
        if (e)
            e[i] = sum;
    }
}

const drape_term_ops drape_term_load_line = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "load.line",
              .summary = "a force per length of constant direction on boundary edges",
              .reference = "work of a dead load, lumped by halves",
              DRAPE_PARAMS(params)},
    .element_name = "edge",
    .nodes = 2,
    .linear = true,
    .external = true,
    .build = build,
    .energy = energy,
};
