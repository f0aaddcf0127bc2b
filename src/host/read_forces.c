/* read_forces.c: the forces that a host reads between steps. */
#include "base/finite.h"
#include "base/vec3.h"
#include "host/host.h"

#include <string.h>

/* The point of the present state; colliders move as in the last step. */
static drape_status place(drape_sim *sim, drape_point *point)
{
    const drape_state *now = drape_sim_state(sim);
    double before = sim->before >= 0 ? sim->states[sim->before].t : now->t;
    *point = (drape_point){.x = now->x,
                           .v = now->v,
                           .internal = now->internal,
                           .t = now->t,
                           .span = {before, now->t},
                           .instant = !sim->chosen.integrator->mean_velocities};
    return drape_sim_begin_reading(sim);
}

/* Checks the arguments of a function that reads into an array. */
static drape_status check_array(const drape_sim *sim, const char *function, const double *array)
{
    if (!sim)
        return DRAPE_E_ARGUMENT;
    return array ? DRAPE_OK : drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: the array is NULL", function);
}

drape_status drape_sim_reactions(drape_sim *sim, double *forces)
{
    drape_point point;
    drape_status status = check_array(sim, "drape_sim_reactions", forces);
    if (!status)
        status = place(sim, &point);
    return status ? status : drape_sim_reactions_at(sim, &point, forces);
}

static drape_status check_has_contact(const drape_sim *sim, const char *function)
{
    const drape_model *m = sim->model;
    if (!sim->chosen.integrator->projects_contact || (m->collider_count == 0 && !m->contact.self))
        return DRAPE_OK;
    return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                      "%s: the integrator \"%s\" resolves contact by moving nodes and has no contact force",
                      function, sim->chosen.integrator->entry.name);
}

drape_status drape_sim_contact_forces(drape_sim *sim, double *forces)
{
    drape_point point;
    drape_status status = check_array(sim, "drape_sim_contact_forces", forces);
    if (!status)
        status = check_has_contact(sim, "drape_sim_contact_forces");
    if (!status)
        status = place(sim, &point);
    if (status)
        return status;
    drape_system_contact_part(sim->system, &point, true, forces, NULL);
    for (size_t i = 0; i < 3 * (size_t)sim->model->node_count; i++)
        forces[i] = forces[i] != 0 ? -forces[i] : 0;
    return drape_sim_read_status(sim);
}

/* What the pins that a collider carries put on it: the sum of their forces and its moment about a point. */
static drape_status add_carried(drape_sim *sim, const drape_point *point, int32_t collider,
                                const double about[3], double force[3], double moment[3])
{
    const drape_motion *motion = drape_system_motion(sim->system);
    double *forces = sim->query_scratch, arm[3], turning[3];
    bool carries = false;
    for (int32_t i = 0; i < motion->moved_count && !carries; i++)
        carries = drape_motion_carrier(motion, i) == collider;
    if (!carries)
        return DRAPE_OK;
    const drape_status status = drape_sim_reactions_at(sim, point, forces);
    for (int32_t i = 0; !status && i < motion->moved_count; i++) {
        const size_t node = (size_t)motion->moved_node[i];
        if (drape_motion_carrier(motion, i) != collider)
            continue;
        vec3_sub(point->x + 3 * node, about, arm);
        vec3_cross(arm, forces + 3 * node, turning);
        vec3_add_scaled(-1, forces + 3 * node, force);
        vec3_add_scaled(-1, turning, moment);
    }
    return status;
}

/* All that cloth does to a collider now: force, and torque about a point or, NULL, its pivot. */
static drape_status read_wrench(drape_sim *sim, const char *function, int32_t collider, const double *about,
                                double force[3], double torque[3])
{
    drape_point point;
    drape_load load;
    drape_collider_pose pose;
    double center[3];
    drape_status status = drape_host_check_collider(sim, function, collider);
    if (!status)
        status = check_has_contact(sim, function);
    if (!status)
        status = place(sim, &point);
    if (!status) {
        /* The forces of contact on a collider, with the sign of g. */
        drape_system_contact_part(sim->system, &point, true, sim->query_scratch, NULL);
        const drape_load *on = drape_system_on_colliders(sim->system);
        load = on ? on[collider] : (drape_load){.force = {0}};
        status = drape_sim_read_status(sim);
    }
    if (status)
        return status;
    drape_motion_pose(drape_system_motion(sim->system), collider, point.t, point.t, &pose);
    drape_host_pivot(sim, collider, center);
    drape_load_torque(&load, &pose, about ? about : center, torque);
    for (int k = 0; k < 3; k++) {
        force[k] = load.force[k] != 0 ? -load.force[k] : 0;
        torque[k] = torque[k] != 0 ? -torque[k] : 0;
    }
    return add_carried(sim, &point, collider, about ? about : center, force, torque);
}

drape_status drape_sim_contacts(drape_sim *sim, int32_t room, drape_contact_point *contacts, int32_t *count)
{
    drape_point point;
    if (!sim)
        return DRAPE_E_ARGUMENT;
    if (!count || room < 0 || (room > 0 && !contacts))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_contacts: room for %d, but no array or no count", (int)room);
    drape_status status = check_has_contact(sim, "drape_sim_contacts");
    if (!status)
        status = place(sim, &point);
    if (status)
        return status;
    drape_system_contact_part(sim->system, &point, true, sim->query_scratch, NULL);
    const drape_contact *contact = drape_system_contact(sim->system);
    *count = contact ? drape_contact_points(contact, room, contacts) : 0;
    return drape_sim_read_status(sim);
}

drape_status drape_sim_collider_force(drape_sim *sim, int32_t collider, double force[3])
{
    double sum[3], torque[3];
    drape_status status = check_array(sim, "drape_sim_collider_force", force);
    if (!status)
        status = read_wrench(sim, "drape_sim_collider_force", collider, NULL, sum, torque);
    if (!status)
        memcpy(force, sum, sizeof sum);
    return status;
}

drape_status drape_sim_collider_torque(drape_sim *sim, int32_t collider, const double *about,
                                       double torque[3])
{
    double force[3], sum[3];
    drape_status status = check_array(sim, "drape_sim_collider_torque", torque);
    if (!status && about && !drape_all_finite(about, 3))
        status = drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_collider_torque: the point is not finite");
    if (!status)
        status = read_wrench(sim, "drape_sim_collider_torque", collider, about, force, sum);
    if (!status)
        memcpy(torque, sum, sizeof sum);
    return status;
}
