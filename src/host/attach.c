/* attach.c: pins that a host gives to colliders to carry, and takes from them. */
#include "host/host.h"
#include "sim/rides.h"

static drape_status check_triangles(const drape_sim *sim, int32_t collider, int32_t count,
                                    const int32_t *triangles)
{
    const drape_collider *c = &sim->model->colliders[collider];
    if (triangles && c->frames.frame_count == 0)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_attach: triangles, but %s is a %s, which is rigid and carries pins as a "
                          "whole",
                          c->name, c->ops->entry.name);
    for (int32_t i = 0; triangles && i < count; i++)
        if (triangles[i] < 0 || triangles[i] >= c->shape.triangle_count)
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                              "drape_sim_attach: triangle %d; %s has the triangles 0 to %d",
                              (int)triangles[i], c->name, (int)c->shape.triangle_count - 1);
    return DRAPE_OK;
}

static drape_status carry(drape_sim *sim, int32_t collider, int32_t count, const int32_t *nodes,
                          const int32_t *triangles)
{
    /* contact may need memory for its energy; a sim that was made for new pins has it */
    const drape_energy before = drape_sim_account(sim);
    if (drape_system_status(sim->system) == DRAPE_E_MEMORY) {
        sim->energy_known = false;
        return DRAPE_E_MEMORY;
    }
    for (int32_t i = 0; i < count; i++)
        drape_sim_ride(sim, nodes[i], collider, triangles ? triangles[i] : -1, true);
    /* Pins move with their colliders at once. */
    const drape_motion *motion = drape_system_motion(sim->system);
    drape_state *now = &sim->states[sim->now];
    for (int32_t i = 0; i < count; i++)
        drape_motion_pin_velocity(motion, motion->place[nodes[i]], now->t, now->t,
                                  now->v + 3 * (size_t)nodes[i]);
    sim->chosen.integrator->restart(sim->integrator, now);
    drape_sim_shift_energy(sim, &before, DRAPE_BY_HOST);
    return DRAPE_OK;
}

drape_status drape_sim_attach(drape_sim *sim, int32_t collider, int32_t count, const int32_t *nodes,
                              const int32_t *triangles)
{
    drape_status status = drape_sim_guard(sim, "drape_sim_attach");
    if (status)
        return status;
    status = drape_host_check_collider(sim, "drape_sim_attach", collider);
    if (!status)
        status = drape_sim_check_nodes(sim, "drape_sim_attach", count, nodes);
    if (!status)
        status = check_triangles(sim, collider, count, triangles);
    int32_t *nearest = NULL;
    if (!status && !triangles && sim->model->colliders[collider].frames.frame_count > 0)
        status = drape_sim_ride_triangles(sim, collider, count, nodes, &nearest);
    if (!status)
        status = drape_sim_set_pins(sim, count, nodes, 1);
    if (!status)
        status = carry(sim, collider, count, nodes, nearest ? nearest : triangles);
    drape_free(sim->ctx, nearest);
    return status;
}

drape_status drape_sim_detach(drape_sim *sim, int32_t count, const int32_t *nodes)
{
    drape_status status = drape_sim_guard(sim, "drape_sim_detach");
    if (!status)
        status = drape_sim_check_nodes(sim, "drape_sim_detach", count, nodes);
    for (int32_t i = 0; !status && i < count; i++)
        if (drape_sim_carrier(sim, nodes[i]) < 0)
            status = drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                                "drape_sim_detach: no collider carries node %d, which is %s", (int)nodes[i],
                                sim->model->pinned[nodes[i]] ? "pinned otherwise" : "free");
    return status ? status : drape_sim_set_pins(sim, count, nodes, 0);
}

int32_t drape_sim_attached(const drape_sim *sim, int32_t node)
{
    return sim && node >= 0 && node < sim->model->node_count ? drape_sim_carrier(sim, node) : -1;
}
