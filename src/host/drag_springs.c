/* drag_springs.c: springs by which a host drags nodes. Setting them changes the energy of the present state;
 * the account counts this as work of the host, like a pin's. */
#include "base/finite.h"
#include "sim/sim.h"

#include <math.h>
#include <string.h>

static drape_status check(const drape_sim *sim, const char *function, int32_t node, double stiffness,
                          const double *target)
{
    const drape_model *m = sim->model;
    if (node < 0 || node >= m->node_count)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: node %d; there are 0 to %d", function, (int)node,
                          (int)m->node_count - 1);
    if (m->pinned[node])
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: node %d is pinned; only free nodes can be dragged",
                          function, (int)node);
    if (!(stiffness >= 0 && isfinite(stiffness)))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: stiffness = %g N/m; it is finite, 0 or more",
                          function, stiffness);
    if (stiffness > 0 && !target)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: node %d has no target", function, (int)node);
    if (stiffness > 0 && !drape_all_finite(target, 3))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "%s: the target of node %d is (%g, %g, %g) m; it must be finite", function,
                          (int)node, target[0], target[1], target[2]);
    return DRAPE_OK;
}

/* Springs without stiffness are left out. */
static drape_status set(drape_sim *sim, const char *function, int32_t count, const int32_t *nodes,
                        const double *stiffness, const double *targets)
{
    drape_drag_springs springs = {.count = 0};
    drape_status status = drape_sim_guard(sim, function);
    for (int32_t i = 0; !status && i < count; i++) {
        const double *target = targets ? targets + 3 * (size_t)i : NULL;
        status = check(sim, function, nodes[i], stiffness[i], target);
        if (status || !(stiffness[i] > 0))
            continue;
        drape_drag_spring *spring = &springs.spring[springs.count++];
        spring->node = nodes[i];
        spring->stiffness = stiffness[i];
        memcpy(spring->target, target, sizeof spring->target);
    }
    if (!status) {
        const double *x = drape_sim_state(sim)->x;
        const double work = drape_drag_springs_energy(&springs, x) -
                            drape_drag_springs_energy(drape_system_drag_springs(sim->system), x);
        drape_system_set_drag_springs(sim->system, &springs);
        sim->work[DRAPE_BY_HOST] += work;
        sim->audit.offered += fabs(work);
        sim->energy_known = sim->attempted_known = false;
        sim->chosen.integrator->restart(sim->integrator, drape_sim_state(sim));
    }
    return status;
}

drape_status drape_sim_set_drag_spring(drape_sim *sim, int32_t node, double stiffness, const double target[3])
{
    return set(sim, "drape_sim_set_drag_spring", 1, &node, &stiffness, target);
}

drape_status drape_sim_set_drag_springs(drape_sim *sim, int32_t count, const int32_t *nodes,
                                        const double *stiffness, const double *targets)
{
    if (!sim)
        return DRAPE_E_ARGUMENT;
    if (count < 0 || count > DRAPE_MAX_DRAG_SPRINGS)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_set_drag_springs: %d springs; 0 to %d",
                          (int)count, DRAPE_MAX_DRAG_SPRINGS);
    if (count > 0 && (!nodes || !stiffness || !targets))
        return drape_fail(
            sim->ctx, DRAPE_E_ARGUMENT,
            "drape_sim_set_drag_springs: %d springs, but no list of nodes, stiffness or targets", (int)count);
    return set(sim, "drape_sim_set_drag_springs", count, nodes, stiffness, targets);
}

void drape_sim_drag_spring_force(const drape_sim *sim, double force[3])
{
    const drape_drag_springs *springs = sim ? drape_system_drag_springs(sim->system) : NULL;
    if (!force)
        return;
    memset(force, 0, 3 * sizeof *force);
    for (int32_t i = 0; springs && i < springs->count; i++) {
        const drape_drag_spring *spring = &springs->spring[i];
        const double *x = drape_sim_state(sim)->x + 3 * (size_t)spring->node;
        for (int k = 0; k < 3; k++)
            force[k] += spring->stiffness * (spring->target[k] - x[k]);
    }
}
