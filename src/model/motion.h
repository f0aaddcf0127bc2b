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

/* A rigid motion, x -> turn x + shift, by which a host placed cloth or colliders elsewhere. */
typedef struct drape_placement {
    bool given;      /* if not, nothing was placed */
    double turn[9];  /* a rotation, row by row */
    double shift[3]; /* [m] */
} drape_placement;

typedef struct drape_motion {
    const drape_model *model;
    int32_t moved_count;              /* pinned nodes with a track or a path */
    int32_t *moved_node;              /* (number of pinned nodes) */
    int32_t *moved_track;             /* (number of pinned nodes) -1: no track */
    int32_t *place;                   /* (node_count) number among the moved nodes, -1: none */
    drape_path *pin_path;             /* (number of pinned nodes) */
    drape_path *collider_path;        /* (collider_count) */
    drape_deformation *deformation;   /* (collider_count) */
    drape_placement *cloth_placed;    /* (cloth_count) of rest positions and tracks; paths have it in them */
    drape_placement *collider_placed; /* (collider_count) of displacements on tracks */
} drape_motion;

drape_status drape_motion_create(drape_arena *arena, const drape_model *model, drape_motion **out);

/* Archives the paths that a host set, and which pins have one. */
void drape_motion_archive(drape_motion *motion, drape_archive *archive);

/* Writes the positions of moved pins at time t; other entries of x (node_count x 3) are unchanged. */
void drape_motion_place_pins(const drape_motion *motion, double t, double *x);

/* Writes the velocity of moved pin i at time t, on that piece of its track or path which contains the time
 * `within`: at a kink there are two velocities, and the velocity at the kink itself is the later one. */
void drape_motion_pin_velocity(const drape_motion *motion, int32_t i, double t, double within, double v[3]);

/* Whether a collider ever moves; its displacement; and its velocity, as above. */
bool drape_motion_moves_collider(const drape_motion *motion, int32_t collider);
void drape_motion_collider(const drape_motion *motion, int32_t collider, double t, double displacement[3]);
void drape_motion_collider_velocity(const drape_motion *motion, int32_t collider, double t, double within,
                                    double v[3]);

/* Writes the positions of the points of a collider with frames at time t, in its own coordinates, and their
 * velocities there as above. */
void drape_motion_points(const drape_motion *motion, int32_t collider, double t, double *x);
void drape_motion_point_velocities(const drape_motion *motion, int32_t collider, double t, double within,
                                   double *v);

/* Sends the points of a collider with frames (drape_deformation_send). */
void drape_motion_deform(drape_motion *motion, int32_t collider, double t, double span, const double *x,
                         const double *v);

/* Whether the points of a collider ever move in its own coordinates. */
bool drape_motion_deforms(const drape_motion *motion, int32_t collider);

/* Returns the next time after t and before end at which some velocity jumps; otherwise end. */
double drape_motion_next_kink(const drape_motion *motion, double t, double end);
bool drape_motion_at_kink(const drape_motion *motion, double t);

/* Move a pinned node on a user-defined path from now on: from its position at time t, on a cubic, to the
 * position x and the velocity v at t + span [s]; if v is NULL, on a straight line at constant speed. For a
 * collider x is a displacement. */
void drape_motion_send_pin(drape_motion *motion, int32_t node, double t, double span, const double x[3],
                           const double *v);
void drape_motion_send_collider(drape_motion *motion, int32_t collider, double t, double span,
                                const double x[3], const double *v);

/* The velocities with which a pinned node and a collider come to where they are at time t; 0 at a key of a
 * track. */
void drape_motion_pin_arrival(const drape_motion *motion, int32_t node, double t, double v[3]);
void drape_motion_collider_arrival(const drape_motion *motion, int32_t collider, double t, double v[3]);

/* Places the pins of a cloth, or a collider, elsewhere: their rest positions, tracks and paths, past and
 * future, are moved as one. For a collider the placement acts on displacements. */
void drape_motion_place_cloth(drape_motion *motion, int32_t cloth, const drape_placement *by);
void drape_motion_place_collider(drape_motion *motion, int32_t collider, const drape_placement *by);

/* y = turn x + shift, and y = turn x; y may be x. */
void drape_placement_move(const drape_placement *by, const double x[3], double y[3]);
void drape_placement_turn(const drape_placement *by, const double x[3], double y[3]);

/* The position of a pinned node that neither a track nor a path moves. */
void drape_motion_place_fixed(const drape_motion *motion, int32_t node, double x[3]);

/* Takes the paths and placements of another motion of the same scene, in which more nodes may be pinned. */
void drape_motion_copy(drape_motion *motion, const drape_motion *from);

/* Pins that a host has moved rest from now on at these positions (node_count x 3). */
void drape_motion_hold_pins(drape_motion *motion, const double *x);

#endif
