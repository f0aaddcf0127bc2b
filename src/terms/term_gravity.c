/* gravity: E = -m g . x of every node, with its lumped mass m. Linear: it has no Hessian. It is modelled if
 * the gravity of the scene is not zero. */
#include "terms/terms.h"

enum { REST_FORCE_X, REST_FORCE_Y, REST_FORCE_Z, REST_COUNT };

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    (void)values;
    DRAPE_TRY(drape_term_reserve(builder, cloth->node_count, REST_COUNT));
    for (int32_t i = 0; i < cloth->node_count; i++) {
        double m = cloth->node_mass[i];
        double force[REST_COUNT] = {m * cloth->gravity[0], m * cloth->gravity[1], m * cloth->gravity[2]};
        drape_term_set(builder, i, &i, force);
    }
    return DRAPE_OK;
}

static void energy(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *internal, double *e, double *g, double *hess)
{
    (void)internal;
    (void)hess;
    size_t n = (size_t)el->count;
    const double *force = el->rest + first;
    for (size_t i = 0; i < (size_t)count; i++) {
        const double f[3] = {force[i], force[n + i], force[2 * n + i]};
        const double *at = x + 3 * (size_t)el->node[(size_t)first + i];
        if (e)
            e[i] = -(f[0] * at[0] + f[1] * at[1] + f[2] * at[2]);
        for (size_t k = 0; g && k < 3; k++)
            g[3 * i + k] = -f[k];
    }
}

const drape_term_ops drape_term_gravity = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "gravity",
              .summary = "weight of every node: E = -m g . x; acts whenever the scene's gravity is not zero, "
                         "multiplied by its \"gravity_history\"",
              .reference = "lumped masses: a third of each triangle to each of its nodes"},
    .element_name = "node",
    .nodes = 1,
    .linear = true,
    .external = true,
    .from_scene_gravity = true,
    .build = build,
    .energy = energy,
};
