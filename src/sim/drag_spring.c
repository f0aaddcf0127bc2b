/* drag_spring.c: a spring by which a host drags a node. Setting it changes the energy of the present state;
 * the account counts this as work of the host, like a pin's. */
#include "sim/sim.h"

#include <math.h>

static drape_status check(const drape_sim *sim, int32_t node, double stiffness, const double *target)
{
    const drape_model *m = sim->model;
    if (node < 0 || node >= m->node_count)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_set_drag_spring: node %d; there are 0 to %d",
                          (int)node, (int)m->node_count - 1);
    if (m->pinned[node])
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_set_drag_spring: node %d is pinned; only free nodes can be dragged",
                          (int)node);
    if (!(stiffness >= 0 && isfinite(stiffness)))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_set_drag_spring: stiffness = %g N/m; it is finite, 0 or more",
                          stiffness);
    for (int k = 0; k < 3; k++)
        if (stiffness > 0 && (!target || !isfinite(target[k])))
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                              "drape_sim_set_drag_spring: the target must be finite");
    return DRAPE_OK;
}

drape_status drape_sim_set_drag_spring(drape_sim *sim, int32_t node, double stiffness, const double target[3])
{
    drape_status guarded = drape_sim_guard(sim, "drape_sim_set_drag_spring");
    if (guarded)
        return guarded;
    drape_status status = check(sim, node, stiffness, target);
    if (status)
        return status;
    const double *x = drape_sim_state(sim)->x;
    drape_drag_spring spring = {.node = node, .stiffness = stiffness};
    for (int k = 0; stiffness > 0 && k < 3; k++)
        spring.target[k] = target[k];
    double work = drape_drag_spring_energy(&spring, x) -
                  drape_drag_spring_energy(drape_system_drag_spring(sim->system), x);
    drape_system_set_drag_spring(sim->system, &spring);
    sim->audit.pin_work += work;
    sim->audit.offered += fabs(work);
    sim->energy_known = sim->attempted_known = false;
    sim->chosen.integrator->restart(sim->integrator, drape_sim_state(sim));
    return DRAPE_OK;
}

void drape_sim_drag_spring_force(const drape_sim *sim, double force[3])
{
    const drape_drag_spring *spring = sim ? drape_system_drag_spring(sim->system) : NULL;
    for (int k = 0; k < 3; k++)
        force[k] = spring && spring->stiffness > 0
                       ? spring->stiffness * (spring->target[k] -
                                              drape_sim_state(sim)->x[3 * (size_t)spring->node + (size_t)k])
                       : 0;
}
