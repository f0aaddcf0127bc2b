/* load.point: a dead force on each of some nodes: E = -f . x. Linear: it has no Hessian. */
#include "terms/load_edges.h"
#include "terms/terms.h"

enum { LIST_NODE, LIST_BOX_MIN, LIST_BOX_MAX, LIST_FORCE, LIST_HISTORY, LIST_RAMP, LIST_COUNT };
enum { PARAM_NODE, PARAM_BOX_MIN, PARAM_BOX_MAX = PARAM_BOX_MIN + 3, PARAM_FORCE = PARAM_BOX_MAX + 3 };

static const drape_param params[LIST_COUNT] = {
    [LIST_NODE] = DRAPE_INTEGER("node", "1", DRAPE_DERIVED("all nodes in the box"), 0, 2147483647,
                                "number of the node that is loaded"),
    [LIST_BOX_MIN] = DRAPE_VECTOR(
        "box_min", "m", -1e9, -1e9, 1e9,
        "corner of a box; only nodes in it, at rest, are loaded, and edges with both ends in it"),
    [LIST_BOX_MAX] = DRAPE_VECTOR("box_max", "m", 1e9, -1e9, 1e9, "opposite corner of the box"),
    [LIST_FORCE] = DRAPE_VECTOR("force", "N", 0, -1e12, 1e12, "on each of the nodes; it keeps its direction"),
    [LIST_HISTORY] = DRAPE_TERM_HISTORY_PARAM,
    [LIST_RAMP] = DRAPE_TERM_RAMP_PARAM,
};

static bool takes(const drape_cloth_view *cloth, const double *values, int32_t i)
{
    return !(values[PARAM_NODE] >= 0 && values[PARAM_NODE] != i) &&
           drape_load_in_box(cloth->rest + 3 * (size_t)i, values + PARAM_BOX_MIN, values + PARAM_BOX_MAX);
}

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    int32_t count = 0, next = 0;
    if (values[PARAM_NODE] >= cloth->given_count)
        return drape_term_refuse(builder,
                                 "there is no node %d; the mesh has the nodes 0 to "
                                 "%d",
                                 (int)values[PARAM_NODE], (int)cloth->given_count - 1);
    for (int32_t i = 0; i < cloth->given_count; i++)
        count += takes(cloth, values, i);
    if (count == 0)
        return drape_term_refuse(builder, "no such node of the mesh lies in the box");
    DRAPE_TRY(drape_term_reserve(builder, count, 0));
    for (int32_t i = 0; i < cloth->given_count; i++)
        if (takes(cloth, values, i))
            drape_term_set(builder, next++, &i, NULL);
    return DRAPE_OK;
}

static void energy(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *internal, double *e, double *g, double *hess)
{
    const double *force = el->params + PARAM_FORCE;
    (void)internal;
    (void)hess;
    for (int32_t i = 0; i < count; i++) {
        const double *at = x + 3 * (size_t)el->node[first + i];
        double work = 0;
        for (int k = 0; k < 3; k++) {
            work += force[k] * at[k];
            if (g)
                g[3 * (size_t)i + (size_t)k] = -force[k];
        }
        if (e)
            e[i] = -work;
    }
}

const drape_term_ops drape_term_load_point = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "load.point",
              .summary = "a force of constant direction on each of some nodes",
              .reference = "work of a dead load",
              DRAPE_PARAMS(params)},
    .element_name = "node",
    .nodes = 1,
    .linear = true,
    .external = true,
    .build = build,
    .energy = energy,
};
