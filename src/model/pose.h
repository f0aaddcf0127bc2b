/*
 * pose.h: where a rigid body is at one instant, and how it moves: the point X of its own coordinates is at x
 * = turn X + displacement and has the velocity `velocity` + gradient (x - displacement). And the motion of a
 * body from one pose to another in which its pivot moves straight and it turns about one axis, both steadily.
 */
#ifndef DRAPE_MODEL_POSE_H
#define DRAPE_MODEL_POSE_H

#include <stdbool.h>

/* A pose of zeros is that of a body at rest in its own coordinates. */
typedef struct drape_collider_pose {
    double displacement[3]; /* [m] of the origin of its own coordinates */
    double velocity[3];     /* [m/s] of that point of the body */
    double turn[9];         /* a rotation, row by row, if `turned` */
    double gradient[9]; /* [1/s] of the velocity in space, row by row, if `spins`; of a mean velocity over a
                               finite time it is not quite antisymmetric */
    bool turned, spins; /* turn differs from I, gradient from 0 */
    double t;           /* [s] */
} drape_collider_pose;

/* x = turn X + displacement, and its inverse; out may be the input. */
void drape_pose_point(const drape_collider_pose *pose, const double *own, double *x);
void drape_pose_own(const drape_collider_pose *pose, const double *x, double *own);

/* Turns a direction, or a symmetric tensor (3 x 3), of the body's own coordinates to space. */
void drape_pose_direction(const drape_collider_pose *pose, double *n);
void drape_pose_tensor(const drape_collider_pose *pose, double *tensor);

/* The velocity of the body at a point of space. */
void drape_pose_velocity(const drape_collider_pose *pose, const double *x, double *v);

/* The velocity in space of a point that moves in the body's own coordinates. */
void drape_pose_point_velocity(const drape_collider_pose *pose, const double *own, const double *own_velocity,
                               double *v);

/* Sets turn and gradient, and the flags with them. */
void drape_pose_set_turn(drape_collider_pose *pose, const double turn[9]);
void drape_pose_set_gradient(drape_collider_pose *pose, const double gradient[9]);

/* The pose of a body turned about a pivot of its own coordinates, which is then displaced, with the
 * velocity v of the pivot and the angular velocity w; pose->t is unchanged. */
void drape_pose_about(drape_collider_pose *pose, const double pivot[3], const double turn[9],
                      const double displacement[3], const double v[3], const double w[3]);

/* The mean velocities of a motion in h [s] from one pose to another, by which each point of the body gets
 * from its place in the first to that in the second one. */
void drape_pose_set_mean_velocities(drape_collider_pose *pose, const drape_collider_pose *from,
                                    const drape_collider_pose *to, double h);

/* Whether the body is elsewhere, or turned otherwise. */
bool drape_pose_differs(const drape_collider_pose *a, const drape_collider_pose *b);

/* ---- Forces on a body ---- */

/* Forces f on points X of a body, in its own coordinates. */
typedef struct drape_load {
    double force[3];  /* [N] sum of f */
    double moment[9]; /* [N m] sum of f X', row by row */
    const double
        *on_points; /* (points x 3) [N] f in space on each point of a body that deforms; NULL: rigid */
} drape_load;

/* Add the work of the load while the body goes from one pose to another, and its power at a pose, to *sum. */
void drape_load_add_work(const drape_load *load, const drape_collider_pose *from,
                         const drape_collider_pose *to, double *sum);
void drape_load_add_power(const drape_load *load, const drape_collider_pose *pose, double *sum);

/* The torque [N m] of the load about a point of space. */
void drape_load_torque(const drape_load *load, const drape_collider_pose *pose, const double about[3],
                       double torque[3]);

/* ---- From one pose to another ---- */

typedef struct drape_swing {
    bool turns;         /* if not, the body only shifts, and only `shift` counts */
    double shift[3];    /* [m] of the pivot */
    double axis[3];     /* of length 1 */
    double angle;       /* [rad] in [0, pi] */
    double from[3];     /* [m] the pivot at the beginning, */
    double own[3];      /* and in the body's own coordinates */
    const double *turn; /* of the first pose; NULL: none */
} drape_swing;

/* The first pose must outlive the swing. */
void drape_swing_between(const drape_collider_pose *from, const drape_collider_pose *to,
                         const double pivot[3], drape_swing *out);

/* The body's own coordinates at the fraction s of the motion of a point of space that moves straight from
 * x by `move`; and an upper bound of its speed in them, per fraction. */
void drape_swing_own(const drape_swing *swing, const double *x, const double *move, double s, double *own);
double drape_swing_speed(const drape_swing *swing, const double *x, const double *move);

#endif
