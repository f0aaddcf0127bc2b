/*
 * motion.h: the positions of pinned nodes and colliders at a time: on the tracks of the model, or on paths
 * that a host sets while a sim runs. The model does not change; a motion belongs to one sim.
 */
#ifndef DRAPE_MODEL_MOTION_H
#define DRAPE_MODEL_MOTION_H

#include "base/archive.h"
#include "model/deformation.h"
#include "model/model.h"

/* A cubic from a first to a last moment, at rest before and after, given by x and v at both. x is the
 * position of a pin or the displacement of a collider. */
typedef struct drape_path {
    bool given;     /* if not, the track applies */
    bool smooth;    /* its first velocity continues the motion before it: no kink */
    double t[2];    /* [s] increasing; if equal, at rest at x[1] for good */
    double x[2][3]; /* [m] */
    double v[2][3]; /* [m/s] */
} drape_path;

/* The rotation of a collider on its path, at time t that of a rotation vector after `from`. The vector is a
 * cubic in time, 0 at the beginning, given by its value at the end and its rates at both: a steady turn about
 * one axis if the rates are equal to the value over the time. */
typedef struct drape_turn_path {
    double from[9];    /* rotation, row by row */
    double turn[3];    /* rotation vector [rad] at the end */
    double rate[2][3]; /* [rad/s] of the vector at both ends */
} drape_turn_path;

/* A rigid motion, x -> turn x + shift, by which a host placed cloth or colliders elsewhere. */
typedef struct drape_placement {
    bool given;      /* if not, nothing was placed */
    double turn[9];  /* a rotation, row by row */
    double shift[3]; /* [m] */
} drape_placement;

#define DRAPE_MAX_SPIN 1e4 /* [rad/s] of a collider: a step looks at each part of a turn */

typedef struct drape_motion {
    const drape_model *model;
    int32_t moved_count;  /* pinned nodes with a track or a path */
    int32_t *moved_node;  /* (number of pinned nodes) */
    int32_t *moved_track; /* (number of pinned nodes) -1: no track */
    int32_t *place;       /* (node_count) number among the moved nodes, -1: none */
    drape_path *pin_path; /* (number of pinned nodes) */
    drape_ride *ride;     /* (number of pinned nodes) the collider that carries it, unless it has a path */
    drape_path *collider_path;        /* (collider_count) */
    drape_deformation *deformation;   /* (collider_count) */
    drape_turn_path *collider_turn;   /* (collider_count) with the times of collider_path, if that is given */
    drape_placement *cloth_placed;    /* (cloth_count) of rest positions and tracks; paths have it in them */
    drape_placement *collider_placed; /* (collider_count) of displacements on tracks; its turn also of
                                         rotations */
} drape_motion;

drape_status drape_motion_create(drape_arena *arena, const drape_model *model, drape_motion **out);

/* Archives the paths that a host set, and which pins have one. */
void drape_motion_archive(drape_motion *motion, drape_archive *archive);

/* Writes the positions of moved pins at time t; other entries of x (node_count x 3) are unchanged. */
void drape_motion_place_pins(const drape_motion *motion, double t, double *x);

/* Writes the velocity of moved pin i at time t, on that piece of its track or path which contains the time
 * `within`: at a kink there are two velocities, and the velocity at the kink itself is the later one. */
void drape_motion_pin_velocity(const drape_motion *motion, int32_t i, double t, double within, double v[3]);

/* Whether a collider ever moves; whether its pivot does; whether it turns on its track or path; and the
 * displacement of its pivot at time t. */
bool drape_motion_moves_collider(const drape_motion *motion, int32_t collider);
bool drape_motion_shifts_collider(const drape_motion *motion, int32_t collider);
bool drape_motion_turns_collider(const drape_motion *motion, int32_t collider);
void drape_motion_collider(const drape_motion *motion, int32_t collider, double t, double displacement[3]);

/* The velocity of that, `within` as above. */
void drape_motion_collider_velocity(const drape_motion *motion, int32_t collider, double t, double within,
                                    double v[3]);

/* The pose of a collider at time t: with its velocities there, `within` as above; or with the mean ones from
 * span[0] to span[1], 0 if these are equal. */
void drape_motion_pose(const drape_motion *motion, int32_t collider, double t, double within,
                       drape_collider_pose *pose);
void drape_motion_mean_pose(const drape_motion *motion, int32_t collider, double t, const double span[2],
                            drape_collider_pose *pose);

/* Its rotation about the pivot, and its angular velocity [rad/s]. */
void drape_motion_rotation(const drape_motion *motion, int32_t collider, double t, double rotation[9]);
void drape_motion_spin(const drape_motion *motion, int32_t collider, double t, double within, double w[3]);

/* An upper bound of its angular velocity [rad/s] from t0 to t1, between which there is no kink. */
double drape_motion_fastest_spin(const drape_motion *motion, int32_t collider, double t0, double t1);

/* The work of forces on colliders (collider_count; NULL: none) while they go from where they are at t0 to
 * where they are at t1 [J], and their power at time t [W], `within` as above. */
double drape_motion_collider_work(const drape_motion *motion, const drape_load *load, double t0, double t1);
double drape_motion_collider_power(const drape_motion *motion, const drape_load *load, double t,
                                   double within);

/* Writes the positions of the points of a collider with frames at time t, in its own coordinates, and their
 * velocities there as above. */
static inline void drape_motion_points(const drape_motion *motion, int32_t collider, double t, double *x)
{
    drape_deformation_points(&motion->deformation[collider], t, x);
}
static inline void drape_motion_point_velocities(const drape_motion *motion, int32_t collider, double t,
                                                 double within, double *v)
{
    drape_deformation_velocities(&motion->deformation[collider], t, within, v);
}

/* Sends the points of a collider with frames (drape_deformation_send). */
static inline void drape_motion_deform(drape_motion *motion, int32_t collider, double t, double span,
                                       const double *x, const double *v)
{
    drape_deformation_send(&motion->deformation[collider], t, span, x, v);
}

/* Whether the points of a collider ever move in its own coordinates. */
static inline bool drape_motion_deforms(const drape_motion *motion, int32_t collider)
{
    return drape_deformation_moves(&motion->deformation[collider]);
}

/* Returns the next time after t and before end at which some velocity or the course of a load jumps;
 * otherwise end. drape_motion_at_kink: whether a velocity does, after which a method that follows the
 * solution starts anew; loads are continuous. */
double drape_motion_next_kink(const drape_motion *motion, double t, double end);
bool drape_motion_at_kink(const drape_motion *motion, double t);

/* Move a pinned node on a user-defined path from now on: from its position at time t, on a cubic, to the
 * position x and the velocity v at t + span [s]; if v is NULL, on a straight line at constant speed. For a
 * collider x is the displacement of its pivot. It turns by the shortest turn to the given rotation, with
 * the angular velocity w at the end, or steadily if v is NULL; if the rotation is NULL, it keeps that of
 * time t. */
void drape_motion_send_pin(drape_motion *motion, int32_t node, double t, double span, const double x[3],
                           const double *v);
void drape_motion_send_collider(drape_motion *motion, int32_t collider, double t, double span,
                                const double x[3], const double *v, const double *rotation, const double *w);

/* The velocities with which a pinned node and the pivot of a collider come to where they are at time t, and
 * the angular velocity w of the collider; 0 at a key of a track. */
void drape_motion_pin_arrival(const drape_motion *motion, int32_t node, double t, double v[3]);
void drape_motion_collider_arrival(const drape_motion *motion, int32_t collider, double t, double v[3],
                                   double w[3]);

/* Places the pins of a cloth, or a collider, elsewhere: their rest positions, tracks and paths, past and
 * future, are moved as one. For a collider the placement acts on displacements, and its turn on
 * rotations. */
void drape_motion_place_cloth(drape_motion *motion, int32_t cloth, const drape_placement *by);
void drape_motion_place_collider(drape_motion *motion, int32_t collider, const drape_placement *by);

/* y = turn x + shift, and y = turn x; y may be x. */
void drape_placement_move(const drape_placement *by, const double x[3], double y[3]);
void drape_placement_turn(const drape_placement *by, const double x[3], double y[3]);

/* The position of a pinned node that neither a track nor a path moves. */
void drape_motion_place_fixed(const drape_motion *motion, int32_t node, double x[3]);

/* Takes the paths and placements at time t of another motion of the same cloth, in which other nodes may be
 * pinned. before (collider_count): the number that each collider has there; -1: it is new. A
 * collider whose pivot has changed, and is given in either scene, is where it would be about the former
 * pivot. */
void drape_motion_copy(drape_motion *motion, const drape_motion *from, const int32_t *before, double t);

/* The collider that carries a moved pin; -1: none. */
int32_t drape_motion_carrier(const drape_motion *motion, int32_t i);

/* The ride by which a collider carries a point of space from time t on. triangle: the one that carries it,
 * of a collider with frames, else unused. */
void drape_motion_ride_from(const drape_motion *motion, int32_t collider, int32_t triangle, double t,
                            const double x[3], drape_ride *ride);

/* A pinned node goes on with this ride, and with no path. */
void drape_motion_take_ride(drape_motion *motion, int32_t node, const drape_ride *ride);

/* The position of a pinned node at time t. */
void drape_motion_place_pin(const drape_motion *motion, int32_t node, double t, double x[3]);

/* A pinned node rests at x from now on. */
void drape_motion_hold_pin(drape_motion *motion, int32_t node, const double x[3]);

/* Pins that a host has moved rest from now on at these positions (node_count x 3). */
void drape_motion_hold_pins(drape_motion *motion, const double *x);

#endif
