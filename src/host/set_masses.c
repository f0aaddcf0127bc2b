/* set_masses.c: nodes that get other masses while the sim runs. Integrators keep masses in many places, so
 * the sim is made anew for a model with these, beside the present one, as when pins change. */
#include "sim/sim.h"

#include <string.h>

#define MAX_MASS 1e12 /* [kg] the limit of a scene's masses */

static drape_status check_masses(const drape_sim *sim, int32_t count, const int32_t *nodes,
                                 const double *masses)
{
    const drape_status status = drape_sim_check_nodes(sim, "drape_sim_set_masses", count, nodes);
    if (!status && count > 0 && !masses)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_set_masses: %d nodes, but no list of masses",
                          (int)count);
    for (int32_t i = 0; !status && i < count; i++)
        if (!(masses[i] > 0 && masses[i] <= MAX_MASS))
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                              "drape_sim_set_masses: mass of node %d = %g kg; it is in (0, %g]",
                              (int)nodes[i], masses[i], MAX_MASS);
    return status;
}

drape_status drape_sim_set_masses(drape_sim *sim, int32_t count, const int32_t *nodes, const double *masses)
{
    drape_status status = drape_sim_guard(sim, "drape_sim_set_masses");
    if (!status)
        status = check_masses(sim, count, nodes, masses);
    if (status)
        return status;
    const size_t size = (size_t)sim->model->node_count * sizeof *masses;
    double *changed = drape_alloc(sim->ctx, size, 1);
    if (!changed)
        return DRAPE_E_MEMORY;
    memcpy(changed, sim->model->mass, size);
    for (int32_t i = 0; i < count; i++)
        changed[nodes[i]] = masses[i];
    if (memcmp(changed, sim->model->mass, size) != 0) {
        const drape_model *base = drape_sim_base_model(sim);
        const bool as_compiled = memcmp(changed, base->mass, (size_t)base->node_count * sizeof *changed) == 0;
        status = drape_sim_remake(sim, base, sim->pinned, as_compiled ? NULL : changed);
        if (!status)
            drape_events_forget(sim);
    }
    drape_free(sim->ctx, changed);
    return status;
}
