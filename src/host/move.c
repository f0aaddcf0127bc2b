/* move.c: what a host moves and pushes while a sim runs: pins, colliders, forces and the medium. */
#include "base/finite.h"
#include "base/rotation.h"
#include "base/vec3.h"
#include "colliders/colliders.h"
#include "geometry/mesh_distance.h"
#include "host/host.h"
#include "sim/rescue.h"

#include <math.h>
#include <string.h>

#define MAX_SPIN   DRAPE_MAX_SPIN
#define LENGTH_OFF 0.01 /* of a quaternion that is meant to have length 1: far beyond rounding in float */

static bool is_within_limits(const double *x, const double *v)
{
    bool good = x != NULL;
    for (int k = 0; good && k < 3; k++)
        good = fabs(x[k]) <= DRAPE_MOST && (!v || fabs(v[k]) <= DRAPE_MOST);
    return good;
}

static drape_status check_seconds(const drape_sim *sim, const char *function, double seconds)
{
    double t = drape_sim_state(sim)->t;
    if (seconds > 0 && seconds <= DRAPE_MOST && t + seconds > t)
        return DRAPE_OK;
    return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                      "%s: seconds = %g; it is in (0, %g], and large enough to change the time", function,
                      seconds, DRAPE_MOST);
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
                          (int)node, DRAPE_MOST);
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
        status = drape_realtime_rescue.send_pins(sim, count, nodes, seconds, positions, velocities);
    for (int32_t i = 0; !status && i < count; i++)
        drape_motion_send_pin(drape_system_steer(sim->system), nodes[i], drape_sim_state(sim)->t, seconds,
                              positions + 3 * (size_t)i, velocities ? velocities + 3 * (size_t)i : NULL);
    return status;
}

/* ---- Colliders ---- */

drape_status drape_host_check_collider(const drape_sim *sim, const char *function, int32_t collider)
{
    if (collider >= 0 && collider < sim->model->collider_count)
        return DRAPE_OK;
    return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: collider %d; the model has %d", function,
                      (int)collider, (int)sim->model->collider_count);
}

void drape_host_pivot(const drape_sim *sim, int32_t collider, double pivot[3])
{
    drape_motion_collider(drape_system_motion(sim->system), collider, drape_sim_state(sim)->t, pivot);
    vec3_add_scaled(1, sim->model->colliders[collider].pivot, pivot);
}

/* A turn that is sent within a moment implies an angular velocity, as well. One that is placed instead turns
 * only as it does on arrival. */
static drape_status check_spin(const drape_sim *sim, const char *function, int32_t collider, double seconds,
                               const drape_sent *to)
{
    double now[9], between[9], turn[3] = {0};
    if (!to->rotation)
        return DRAPE_OK;
    drape_motion_rotation(drape_system_motion(sim->system), collider, drape_sim_state(sim)->t, now);
    drape_rotation_between(to->rotation, now, between);
    drape_rotation_log(between, turn);
    if (vec3_norm(turn) <= MAX_SPIN * seconds)
        return DRAPE_OK;
    return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                      "%s: %s would turn by %.4g rad in %g s; its angular velocity is within %g rad/s",
                      function, sim->model->colliders[collider].name, vec3_norm(turn), seconds, MAX_SPIN);
}

static drape_status send_collider(drape_sim *sim, const char *function, int32_t collider, double seconds,
                                  const drape_sent *to)
{
    drape_status status = drape_host_check_collider(sim, function, collider);
    if (!status)
        status = check_seconds(sim, function, seconds);
    if (!status && !is_within_limits(to->displacement, to->velocity))
        status =
            drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                       "%s: displacement and velocity must be within %g m and m/s", function, DRAPE_MOST);
    if (!status)
        status = drape_realtime_rescue.send_collider(sim, collider, seconds, to);
    if (!status)
        status = check_spin(sim, function, collider, seconds, to);
    if (!status)
        drape_motion_send_collider(drape_system_steer(sim->system), collider, drape_sim_state(sim)->t,
                                   seconds, to->displacement, to->velocity, to->rotation,
                                   to->angular_velocity);
    return status;
}

drape_status drape_sim_move_collider(drape_sim *sim, int32_t collider, double seconds,
                                     const double displacement[3], const double *velocity)
{
    const drape_sent to = {.displacement = displacement, .velocity = velocity};
    const drape_status guarded = drape_sim_guard(sim, "drape_sim_move_collider");
    return guarded ? guarded : send_collider(sim, "drape_sim_move_collider", collider, seconds, &to);
}

drape_status drape_sim_move_collider_pose(drape_sim *sim, int32_t collider, double seconds,
                                          const double displacement[3], const double rotation[4],
                                          const double *velocity, const double *angular_velocity)
{
    static const char function[] = "drape_sim_move_collider_pose";
    double squares = 0, matrix[9];
    const drape_sent to = {displacement, velocity, matrix, angular_velocity};
    const drape_status guarded = drape_sim_guard(sim, function);
    if (guarded)
        return guarded;
    if (!rotation)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: the rotation is NULL", function);
    for (int i = 0; i < 4; i++)
        squares += rotation[i] * rotation[i];
    if (!(fabs(sqrt(squares) - 1) <= LENGTH_OFF))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "%s: the rotation has length %g; it is a quaternion w x y z of length %g to %g",
                          function, sqrt(squares), 1 - LENGTH_OFF, 1 + LENGTH_OFF);
    if (!velocity != !angular_velocity)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "%s: velocity and angular velocity are given both, or neither", function);
    for (int k = 0; angular_velocity && k < 3; k++)
        if (!(fabs(angular_velocity[k]) <= MAX_SPIN))
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                              "%s: angular_velocity[%d] = %g rad/s; it is within %g", function, k,
                              angular_velocity[k], MAX_SPIN);
    drape_rotation_of_quaternion(rotation, matrix);
    return send_collider(sim, function, collider, seconds, &to);
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
    drape_status status = drape_host_check_collider(sim, function, collider);
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
    const double no_velocity[3] = {0};
    if (points != c->shape.point_count || !positions)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "%s: %d points%s; %s has %d", function, (int)points,
                          positions ? "" : ", but no positions", c->name, (int)c->shape.point_count);
    for (size_t i = 0; i < (size_t)points; i++)
        if (!is_within_limits(positions + 3 * i, velocities ? velocities + 3 * i : NULL)) {
            const double *x = positions + 3 * i, *v = velocities ? velocities + 3 * i : no_velocity;
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                              "%s: point %zu is at (%g, %g, %g) m with (%g, %g, %g) m/s; they must be finite "
                              "and within %g m and m/s",
                              function, i, x[0], x[1], x[2], v[0], v[1], v[2], DRAPE_MOST);
        }
    double *x = drape_alloc(sim->ctx, 3 * (size_t)points, sizeof *x);
    if (!x)
        return DRAPE_E_MEMORY;
    memcpy(x, positions, 3 * (size_t)points * sizeof *x);
    const drape_mesh mesh = {
        .triangle_count = c->shape.triangle_count, .triangle = c->shape.triangle, .x = x};
    const drape_mesh_source source = {.pointer = "", .part = "drape_sim_deform_collider: "};
    drape_status status = drape_mesh_validate_shapes(sim->ctx, &source, &mesh);
    if (!status && drape_mesh_distance_side(c->shape.kept) != DRAPE_SIDE_NONE)
        status = drape_shape_check_volume(sim->ctx, &source, &mesh);
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

drape_status drape_sim_collider_points(drape_sim *sim, int32_t collider, double *positions,
                                       double *velocities)
{
    if (!sim)
        return DRAPE_E_ARGUMENT;
    drape_status status = check_deforms(sim, "drape_sim_collider_points", collider);
    if (!status && !positions)
        status = drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_collider_points: positions is NULL");
    if (status)
        return status;
    const drape_motion *motion = drape_system_motion(sim->system);
    const size_t points = (size_t)sim->model->colliders[collider].shape.point_count;
    const double t = drape_sim_state(sim)->t;
    drape_collider_pose pose;
    drape_motion_pose(motion, collider, t, t, &pose);
    drape_motion_points(motion, collider, t, positions);
    if (velocities)
        drape_motion_point_velocities(motion, collider, t, t, velocities);
    for (size_t i = 0; i < points; i++) {
        double *x = positions + 3 * i, *v = velocities ? velocities + 3 * i : NULL;
        if (v)
            drape_pose_point_velocity(&pose, x, v, v);
        drape_pose_point(&pose, x, x);
    }
    return DRAPE_OK;
}

int32_t drape_model_collider_points(const drape_model *model, int32_t collider)
{
    if (!model || collider < 0 || collider >= model->collider_count)
        return -1;
    return model->colliders[collider].frames.frame_count > 0 ? model->colliders[collider].shape.point_count
                                                             : 0;
}

bool drape_sim_collider_rotation(const drape_sim *sim, int32_t collider, double rotation[4],
                                 double angular_velocity[3], double pivot[3])
{
    double matrix[9];
    if (!sim || collider < 0 || collider >= sim->model->collider_count)
        return false;
    const double t = drape_sim_state(sim)->t;
    const drape_motion *motion = drape_system_motion(sim->system);
    drape_motion_rotation(motion, collider, t, matrix);
    if (rotation)
        drape_rotation_quaternion(matrix, rotation);
    if (angular_velocity)
        drape_motion_spin(motion, collider, t, t, angular_velocity);
    if (pivot)
        drape_host_pivot(sim, collider, pivot);
    return true;
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
    for (size_t i = 0; forces && i < (size_t)sim->model->node_count; i++) {
        const double *f = forces + 3 * i;
        if (!drape_all_finite(f, 3))
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                              "drape_sim_push: the force on node %zu is (%g, %g, %g) N; it must be finite", i,
                              f[0], f[1], f[2]);
    }
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
