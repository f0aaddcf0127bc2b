/* pose.c: see pose.h. */
#include "model/pose.h"

#include "base/elementary.h"
#include "base/rotation.h"
#include "base/vec3.h"

#include <string.h>

static const double none[9] = DRAPE_NO_ROTATION;

static const double *turn_of(const drape_collider_pose *pose)
{
    return pose->turned ? pose->turn : none;
}

void drape_pose_point(const drape_collider_pose *pose, const double *own, double *x)
{
    double at[3] = {own[0], own[1], own[2]};
    if (pose->turned)
        drape_rotation_turn(pose->turn, at, at);
    for (int k = 0; k < 3; k++)
        x[k] = at[k] + pose->displacement[k];
}

void drape_pose_own(const drape_collider_pose *pose, const double *x, double *own)
{
    vec3_sub(x, pose->displacement, own);
    if (pose->turned)
        drape_rotation_turn_back(pose->turn, own, own);
}

void drape_pose_direction(const drape_collider_pose *pose, double *n)
{
    if (pose->turned)
        drape_rotation_turn(pose->turn, n, n);
}

void drape_pose_tensor(const drape_collider_pose *pose, double *tensor)
{
    double half[9];
    if (!pose->turned)
        return;
    drape_rotation_product(pose->turn, tensor, half);
    drape_rotation_between(half, pose->turn, tensor);
}

void drape_pose_velocity(const drape_collider_pose *pose, const double *x, double *v)
{
    double from[3];
    memcpy(v, pose->velocity, 3 * sizeof *v);
    if (!pose->spins)
        return;
    vec3_sub(x, pose->displacement, from);
    for (int k = 0; k < 3; k++)
        v[k] += vec3_dot(pose->gradient + 3 * k, from);
}

void drape_pose_point_velocity(const drape_collider_pose *pose, const double *own, const double *own_velocity,
                               double *v)
{
    double x[3], further[3] = {own_velocity[0], own_velocity[1], own_velocity[2]};
    drape_pose_point(pose, own, x);
    drape_pose_velocity(pose, x, v);
    drape_pose_direction(pose, further);
    vec3_add_scaled(1, further, v);
}

void drape_pose_set_turn(drape_collider_pose *pose, const double turn[9])
{
    memcpy(pose->turn, turn, sizeof pose->turn);
    pose->turned = !drape_rotation_is_none(turn);
}

void drape_pose_set_gradient(drape_collider_pose *pose, const double gradient[9])
{
    memcpy(pose->gradient, gradient, sizeof pose->gradient);
    pose->spins = false;
    for (int i = 0; i < 9; i++)
        pose->spins = pose->spins || gradient[i] != 0;
}

void drape_pose_about(drape_collider_pose *pose, const double pivot[3], const double turn[9],
                      const double displacement[3], const double v[3], const double w[3])
{
    double turned[3], gradient[9], moves[3];
    drape_rotation_cross(w, gradient);
    drape_pose_set_turn(pose, turn);
    drape_pose_set_gradient(pose, gradient);
    memcpy(pose->displacement, displacement, sizeof pose->displacement);
    memcpy(pose->velocity, v, sizeof pose->velocity);
    drape_rotation_turn(turn, pivot, turned);
    for (int k = 0; pose->turned && k < 3; k++)
        pose->displacement[k] += pivot[k] - turned[k];
    if (!pose->spins)
        return;
    vec3_cross(w, turned, moves); /* of the pivot relative to the origin of its own coordinates */
    vec3_add_scaled(-1, moves, pose->velocity);
}

/* A point x of the present pose is X = turn' (x - displacement) of the body, which moves by
 * (turn1 - turn0) X + displacement1 - displacement0. */
void drape_pose_set_mean_velocities(drape_collider_pose *pose, const drape_collider_pose *from,
                                    const drape_collider_pose *to, double h)
{
    double change[9], gradient[9];
    for (int k = 0; k < 3; k++)
        pose->velocity[k] = (to->displacement[k] - from->displacement[k]) / h;
    for (int i = 0; i < 9; i++)
        change[i] = (turn_of(to)[i] - turn_of(from)[i]) / h;
    drape_rotation_between(change, turn_of(pose), gradient);
    drape_pose_set_gradient(pose, gradient);
}

bool drape_pose_differs(const drape_collider_pose *a, const drape_collider_pose *b)
{
    bool differs = false;
    for (int k = 0; k < 3; k++)
        differs = differs || a->displacement[k] != b->displacement[k];
    for (int i = 0; (a->turned || b->turned) && i < 9; i++)
        differs = differs || turn_of(a)[i] != turn_of(b)[i];
    return differs;
}

/* ---- Forces on a body ---- */

/* A point X moves by the change of turn X + displacement. */
void drape_load_add_work(const drape_load *load, const drape_collider_pose *from,
                         const drape_collider_pose *to, double *sum)
{
    for (int k = 0; k < 3; k++)
        *sum += load->force[k] * (to->displacement[k] - from->displacement[k]);
    for (int i = 0; (from->turned || to->turned) && i < 9; i++)
        *sum += load->moment[i] * (turn_of(to)[i] - turn_of(from)[i]);
}

void drape_load_add_power(const drape_load *load, const drape_collider_pose *pose, double *sum)
{
    double rate[9];
    for (int k = 0; k < 3; k++)
        *sum += load->force[k] * pose->velocity[k];
    if (!pose->spins)
        return;
    drape_rotation_product(pose->gradient, turn_of(pose), rate);
    for (int i = 0; i < 9; i++)
        *sum += load->moment[i] * rate[i];
}

void drape_load_torque(const drape_load *load, const drape_collider_pose *pose, const double about[3],
                       double torque[3])
{
    double moment[9], arm[3]; /* moment: sum of f (x - displacement)' */
    drape_rotation_between(load->moment, turn_of(pose), moment);
    vec3_sub(pose->displacement, about, arm);
    vec3_cross(arm, load->force, torque);
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        torque[k] += moment[3 * j + i] - moment[3 * i + j];
    }
}

/* ---- From one pose to another ---- */

void drape_swing_between(const drape_collider_pose *from, const drape_collider_pose *to,
                         const double pivot[3], drape_swing *out)
{
    double between[9], vector[3], end[3];
    *out = (drape_swing){.turn = from->turned ? from->turn : NULL};
    memcpy(out->own, pivot, sizeof out->own);
    drape_pose_point(from, pivot, out->from);
    vec3_sub(to->displacement, from->displacement, out->shift);
    if (!from->turned && !to->turned)
        return;
    drape_pose_point(to, pivot, end);
    vec3_sub(end, out->from, out->shift);
    drape_rotation_between(turn_of(to), turn_of(from), between);
    drape_rotation_log(between, vector);
    out->angle = vec3_norm(vector);
    out->turns = out->angle > 0;
    for (int k = 0; k < 3; k++)
        out->axis[k] = out->turns ? vector[k] / out->angle : 0;
}

void drape_swing_own(const drape_swing *swing, const double *x, const double *move, double s, double *own)
{
    double to[3], sine, cosine;
    for (int k = 0; k < 3; k++)
        to[k] = x[k] + s * move[k] - (swing->from[k] + s * swing->shift[k]);
    if (swing->turns) {
        double across[3];
        const double along = vec3_dot(swing->axis, to);
        drape_sin_cos(-s * swing->angle, &sine, &cosine);
        vec3_cross(swing->axis, to, across);
        for (int k = 0; k < 3; k++)
            to[k] = cosine * to[k] + sine * across[k] + (1 - cosine) * along * swing->axis[k];
    }
    if (swing->turn)
        drape_rotation_turn_back(swing->turn, to, to);
    for (int k = 0; k < 3; k++)
        own[k] = to[k] + swing->own[k];
}

/* With the place q + s u of the point relative to the pivot, its velocity in the turning frame has the length
 * |u - angle axis x (q + s u)|: that of an affine function of s, so it is largest at one of the ends. */
double drape_swing_speed(const drape_swing *swing, const double *x, const double *move)
{
    double u[3], q[3], largest = 0;
    vec3_sub(move, swing->shift, u);
    if (!swing->turns)
        return vec3_norm(u);
    for (int end = 0; end < 2; end++) {
        double velocity[3];
        for (int k = 0; k < 3; k++)
            q[k] = x[k] - swing->from[k] + end * u[k];
        vec3_cross(swing->axis, q, velocity);
        for (int k = 0; k < 3; k++)
            velocity[k] = u[k] - swing->angle * velocity[k];
        largest = fmax(largest, vec3_norm(velocity));
    }
    return largest;
}
