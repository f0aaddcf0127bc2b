/* gravity: E = -m g . x of every node, with its lumped mass m. Linear: no Hessian, no sparsity. Modelled when
 * the scene's vector is not zero. */
#include "terms/terms.h"

enum { REST_FORCE_X, REST_FORCE_Y, REST_FORCE_Z, REST_COUNT };

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    (void)values;
    drape_status status = drape_term_reserve(builder, cloth->node_count, REST_COUNT);
    for (int32_t i = 0; !status && i < cloth->node_count; i++) {
        double m = cloth->node_mass[i];
        double force[REST_COUNT] = {m * cloth->gravity[0], m * cloth->gravity[1], m * cloth->gravity[2]};
        drape_term_set(builder, i, &i, force);
    }
    return status;
}

static void one(const drape_elements *el, int32_t element, const double *x, double *e, double *g,
                double *hess)
{
    (void)hess;
    double energy = 0;
    for (int k = 0; k < 3; k++) {
        double force = el->rest[(size_t)k * (size_t)el->count + (size_t)element];
        energy -= force * x[k];
        if (g)
            g[k] = -force;
    }
    if (e)
        *e = energy;
}

static void energy(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *internal, double *e, double *g, double *hess)
{
    (void)internal;
    drape_energy_range(el, first, count, x, e, g, hess, one);
}

const drape_term_ops drape_term_gravity = {
    .struct_size = sizeof(drape_term_ops),
    .name = "gravity",
    .summary = "weight of every node: E = -m g . x; modelled when the scene's gravity is not zero",
    .reference = "lumped masses: a third of each triangle to each of its nodes",
    .element_name = "node",
    .nodes = 1,
    .linear = true,
    .potential_of_gravity = true,
    .build = build,
    .energy = energy,
};
