/* repin.c: nodes that are let go, and nodes that are pinned where they are. Which nodes are free decides the
 * size of everything: the unknowns, the pattern of the matrix, what integrators keep. So a sim is made for a
 * model with these pins, beside the present one, as when a checkpoint is restored. */
#include "sim/sim.h"

#include <string.h>

drape_status drape_sim_repin(drape_sim *sim, const uint8_t *pinned)
{
    const drape_model *base = drape_sim_base_model(sim);
    const bool as_compiled = memcmp(pinned, base->pinned, (size_t)base->node_count * sizeof *pinned) == 0;
    return drape_sim_remake(sim, base, as_compiled ? NULL : pinned, sim->masses);
}

drape_status drape_sim_set_pins(drape_sim *sim, int32_t count, const int32_t *nodes, uint8_t pin)
{
    bool differs = false;
    for (int32_t i = 0; i < count && !differs; i++)
        differs = sim->model->pinned[nodes[i]] != pin;
    if (!differs)
        return DRAPE_OK;
    const size_t size = (size_t)sim->model->node_count * sizeof *sim->pinned;
    uint8_t *pinned = drape_alloc(sim->ctx, size, 1);
    if (!pinned)
        return DRAPE_E_MEMORY;
    memcpy(pinned, sim->model->pinned, size);
    for (int32_t i = 0; i < count; i++)
        pinned[nodes[i]] = pin;
    const drape_status status = drape_sim_repin(sim, pinned);
    drape_free(sim->ctx, pinned);
    return status;
}

/* ---- For hosts ---- */

static drape_status set_pins(drape_sim *sim, const char *function, int32_t count, const int32_t *nodes,
                             uint8_t pin)
{
    drape_status status = drape_sim_guard(sim, function);
    if (!status)
        status = drape_sim_check_nodes(sim, function, count, nodes);
    return status ? status : drape_sim_set_pins(sim, count, nodes, pin);
}

drape_status drape_sim_pin(drape_sim *sim, int32_t count, const int32_t *nodes)
{
    return set_pins(sim, "drape_sim_pin", count, nodes, 1);
}

drape_status drape_sim_unpin(drape_sim *sim, int32_t count, const int32_t *nodes)
{
    return set_pins(sim, "drape_sim_unpin", count, nodes, 0);
}
