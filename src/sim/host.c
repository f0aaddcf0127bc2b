/* host.c: what a host may change while a sim runs: pins, colliders, forces and the medium; and the forces
 * that it may read. */
#include "base/finite.h"
#include "sim/place.h"

#include <math.h>

#define MAX_SECONDS  1e9 /* [s] the limit of a scene's duration */
#define MAX_DISTANCE 1e9 /* [m], [m/s] the limit of a track's keys */

static bool is_within_limits(const double *x, const double *v)
{
    bool good = x != NULL;
    for (int k = 0; good && k < 3; k++)
        good = fabs(x[k]) <= MAX_DISTANCE && (!v || fabs(v[k]) <= MAX_DISTANCE);
    return good;
}

static drape_status check_seconds(const drape_sim *sim, const char *function, double seconds)
{
    double t = drape_sim_state(sim)->t;
    if (seconds > 0 && seconds <= MAX_SECONDS && t + seconds > t)
        return DRAPE_OK;
    return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                      "%s: seconds = %g; it is in (0, %g], and large enough to change the time", function,
                      seconds, MAX_SECONDS);
}

/* ---- Pins ---- */

static drape_status check_pin(const drape_sim *sim, int32_t node, const double *x, const double *v)
{
    const drape_model *m = sim->model;
    if (node < 0 || node >= m->node_count)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_move_pins: node %d; there are 0 to %d",
                          (int)node, (int)m->node_count - 1);
    if (!m->pinned[node])
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_move_pins: node %d is free; only pinned nodes can be moved", (int)node);
    if (!is_within_limits(x, v))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_move_pins: position and velocity of node %d must be within %g m and m/s",
                          (int)node, MAX_DISTANCE);
    return DRAPE_OK;
}

drape_status drape_sim_move_pins(drape_sim *sim, int32_t count, const int32_t *nodes, double seconds,
                                 const double *positions, const double *velocities)
{
    drape_status guarded = drape_sim_guard(sim, "drape_sim_move_pins");
    if (guarded)
        return guarded;
    if (count < 0 || (count > 0 && (!nodes || !positions)))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_move_pins: %d nodes, but no list of them or of positions", (int)count);
    drape_status status = check_seconds(sim, "drape_sim_move_pins", seconds);
    for (int32_t i = 0; !status && i < count; i++)
        status = check_pin(sim, nodes[i], positions + 3 * (size_t)i,
                           velocities ? velocities + 3 * (size_t)i : NULL);
    if (!status)
        status = drape_sim_teleport_pins(sim, count, nodes, seconds, positions, velocities);
    for (int32_t i = 0; !status && i < count; i++)
        drape_motion_send_pin(drape_system_steer(sim->system), nodes[i], drape_sim_state(sim)->t, seconds,
                              positions + 3 * (size_t)i, velocities ? velocities + 3 * (size_t)i : NULL);
    return status;
}

/* ---- Colliders ---- */

static drape_status check_collider(const drape_sim *sim, const char *function, int32_t collider)
{
    if (collider >= 0 && collider < sim->model->collider_count)
        return DRAPE_OK;
    return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: collider %d; the model has %d", function,
                      (int)collider, (int)sim->model->collider_count);
}

drape_status drape_sim_move_collider(drape_sim *sim, int32_t collider, double seconds,
                                     const double displacement[3], const double *velocity)
{
    drape_status guarded = drape_sim_guard(sim, "drape_sim_move_collider");
    if (guarded)
        return guarded;
    drape_status status = check_collider(sim, "drape_sim_move_collider", collider);
    if (!status)
        status = check_seconds(sim, "drape_sim_move_collider", seconds);
    if (!status && !is_within_limits(displacement, velocity))
        status = drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                            "drape_sim_move_collider: displacement and velocity must be within %g m and m/s",
                            MAX_DISTANCE);
    if (!status)
        status = drape_sim_teleport_collider(sim, collider, seconds, displacement, velocity);
    if (!status)
        drape_motion_send_collider(drape_system_steer(sim->system), collider, drape_sim_state(sim)->t,
                                   seconds, displacement, velocity);
    return status;
}

drape_collider_motion drape_sim_collider(const drape_sim *sim, int32_t collider)
{
    if (!sim || collider < 0 || collider >= sim->model->collider_count)
        return (drape_collider_motion){.name = "", .type = ""};
    double t = drape_sim_state(sim)->t;
    const drape_motion *motion = drape_system_motion(sim->system);
    drape_collider_motion at = drape_model_collider(sim->model, collider, t);
    drape_motion_collider(motion, collider, t, at.displacement);
    drape_motion_collider_velocity(motion, collider, t, t, at.velocity);
    return at;
}

/* ---- Colliders that deform ---- */

static drape_status check_deforms(const drape_sim *sim, const char *function, int32_t collider)
{
    drape_status status = check_collider(sim, function, collider);
    const drape_collider *c = status ? NULL : &sim->model->colliders[collider];
    if (!status && c->frames.frame_count == 0)
        status = drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                            "%s: collider %d is a %s, which is rigid; an animated_mesh deforms", function,
                            (int)collider, c->ops->entry.name);
    return status;
}

static drape_status check_points(const drape_sim *sim, const drape_collider *c, int32_t points,
                                 const double *positions, const double *velocities)
{
    const char *const function = "drape_sim_deform_collider";
    if (points != c->shape.point_count || !positions)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: %d points%s; %s has %d", function, (int)points,
                          positions ? "" : ", but no positions", c->name, (int)c->shape.point_count);
    for (size_t i = 0; i < (size_t)points; i++)
        if (!is_within_limits(positions + 3 * i, velocities ? velocities + 3 * i : NULL))
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                              "%s: position and velocity of point %zu must be within %g m and m/s", function,
                              i, MAX_DISTANCE);
    double *x = drape_alloc(sim->ctx, 3 * (size_t)points, sizeof *x);
    if (!x)
        return DRAPE_E_MEMORY;
    memcpy(x, positions, 3 * (size_t)points * sizeof *x);
    const drape_mesh mesh = {
        .triangle_count = c->shape.triangle_count, .triangle = c->shape.triangle, .x = x};
    const drape_mesh_source source = {.pointer = "", .part = "drape_sim_deform_collider: "};
    const drape_status status = drape_mesh_validate_shapes(sim->ctx, &source, &mesh);
    drape_free(sim->ctx, x);
    return status;
}

drape_status drape_sim_deform_collider(drape_sim *sim, int32_t collider, double seconds, int32_t points,
                                       const double *positions, const double *velocities)
{
    drape_status status = drape_sim_guard(sim, "drape_sim_deform_collider");
    if (status)
        return status;
    status = check_deforms(sim, "drape_sim_deform_collider", collider);
    if (!status)
        status = check_seconds(sim, "drape_sim_deform_collider", seconds);
    if (!status)
        status = check_points(sim, &sim->model->colliders[collider], points, positions, velocities);
    if (!status)
        drape_motion_deform(drape_system_steer(sim->system), collider, drape_sim_state(sim)->t, seconds,
                            positions, velocities);
    return status;
}

int32_t drape_model_collider_points(const drape_model *model, int32_t collider)
{
    if (!model || collider < 0 || collider >= model->collider_count)
        return -1;
    return model->colliders[collider].frames.frame_count > 0 ? model->colliders[collider].shape.point_count
                                                             : 0;
}

/* ---- Forces ---- */

/* Integrators that extrapolate forces from earlier steps restart; others need not. */
static void announce_new_forces(drape_sim *sim)
{
    if (sim->chosen.integrator->smooth_forces)
        sim->chosen.integrator->restart(sim->integrator, drape_sim_state(sim));
}

drape_status drape_sim_push(drape_sim *sim, const double *forces)
{
    drape_status guarded = drape_sim_guard(sim, "drape_sim_push");
    if (guarded)
        return guarded;
    if (forces && !drape_all_finite(forces, 3 * (size_t)sim->model->node_count))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_push: a force is not finite");
    drape_system_set_push(sim->system, forces);
    announce_new_forces(sim);
    return DRAPE_OK;
}

drape_status drape_sim_set_wind(drape_sim *sim, drape_wind_field *field, void *user)
{
    drape_status guarded = drape_sim_guard(sim, "drape_sim_set_wind");
    if (guarded)
        return guarded;
    if (field && !drape_wind_is_felt(sim->model))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_set_wind: the model has no term that feels the wind, such as drag.wind");
    drape_system_set_wind(sim->system, field, user);
    announce_new_forces(sim);
    return DRAPE_OK;
}

/* ---- Reading forces ---- */

/* The point of the present state; colliders move as in the last step. */
static drape_status place(drape_sim *sim, drape_point *point)
{
    const drape_state *now = drape_sim_state(sim);
    double before = sim->before >= 0 ? sim->states[sim->before].t : now->t;
    *point = (drape_point){
        .x = now->x, .v = now->v, .internal = now->internal, .t = now->t, .span = {before, now->t}};
    /* otherwise the last step has begun there */
    return sim->before < 0 ? drape_system_begin(sim->system, now) : DRAPE_OK;
}

/* A pending request to cancel the next advance is not an error of reading. */
static drape_status read_status(const drape_sim *sim)
{
    drape_status status = drape_system_status(sim->system);
    return status == DRAPE_E_STOPPED ? DRAPE_OK : status;
}

drape_status drape_sim_reactions_at(drape_sim *sim, const drape_point *point, double *forces)
{
    drape_system_force(sim->system, point, forces);
    for (int32_t f = 0; f < sim->model->free_count; f++)
        for (int k = 0; k < 3; k++)
            forces[3 * (size_t)sim->model->node_of_free[f] + (size_t)k] = 0;
    return read_status(sim);
}

drape_status drape_sim_reactions(drape_sim *sim, double *forces)
{
    drape_point point;
    drape_status status = drape_sim_guard(sim, "drape_sim_reactions");
    if (status)
        return status;
    if (!forces)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_reactions: the array is NULL");
    status = place(sim, &point);
    if (status)
        return status;
    return drape_sim_reactions_at(sim, &point, forces);
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
    drape_status status = drape_sim_guard(sim, "drape_sim_contact_forces");
    if (status)
        return status;
    if (!forces)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_contact_forces: the array is NULL");
    status = check_has_contact(sim, "drape_sim_contact_forces");
    if (!status)
        status = place(sim, &point);
    if (status)
        return status;
    drape_system_contact_part(sim->system, &point, true, forces, NULL);
    for (size_t i = 0; i < 3 * (size_t)sim->model->node_count; i++)
        forces[i] = forces[i] != 0 ? -forces[i] : 0;
    return read_status(sim);
}

drape_status drape_sim_collider_force(drape_sim *sim, int32_t collider, double force[3])
{
    drape_point point;
    drape_status status = drape_sim_guard(sim, "drape_sim_collider_force");
    if (status)
        return status;
    if (!force)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_collider_force: the array is NULL");
    status = check_collider(sim, "drape_sim_collider_force", collider);
    if (!status)
        status = check_has_contact(sim, "drape_sim_collider_force");
    if (!status)
        status = place(sim, &point);
    if (status)
        return status;
    drape_system_contact_part(sim->system, &point, true, sim->query_scratch, NULL);
    const double *on = drape_system_on_colliders(sim->system);
    for (int k = 0; k < 3; k++)
        force[k] = on && on[3 * collider + k] != 0 ? -on[3 * collider + k] : 0;
    return read_status(sim);
}
