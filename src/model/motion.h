/*
 * motion.h: where pinned nodes and colliders are at a time: on the tracks of the model, or on a path that a
 * host gives them while a sim runs. The model does not change; a motion belongs to one sim.
 */
#ifndef DRAPE_MODEL_MOTION_H
#define DRAPE_MODEL_MOTION_H

#include "base/archive.h"
#include "model/model.h"

/* A cubic from its first moment to its last, at rest before and after: x and v at both. x is a position of a
 * pin, a displacement of a collider. */
typedef struct drape_path {
    bool given;     /* else the track counts */
    bool smooth;    /* its first velocity is that which led there: no kink */
    double t[2];    /* [s] increasing, or equal: at rest at x[1] for good */
    double x[2][3]; /* [m] */
    double v[2][3]; /* [m/s] */
} drape_path;

typedef struct drape_motion {
    const drape_model *model;
    int32_t moved_count;       /* pinned nodes with a track or a path */
    int32_t *moved_node;       /* (as many as are pinned) */
    int32_t *moved_track;      /* the same; -1: none */
    int32_t *place;            /* (node_count) number among the moved ones, -1: none */
    drape_path *pin_path;      /* (as many as are pinned) */
    drape_path *collider_path; /* (collider_count) */
} drape_motion;

drape_status drape_motion_create(drape_arena *arena, const drape_model *model, drape_motion **out);

/* The paths that a host gave, and which pins have one. */
void drape_motion_archive(drape_motion *motion, drape_archive *archive);

/* Writes the positions of moved pins at time t; other entries of x (node_count x 3) stay. */
void drape_motion_place_pins(const drape_motion *motion, double t, double *x);

/* The velocity at time t of moved pin i, of the piece of its track or path that the time `within` lies in: at
 * a kink there are two, and the later one is that at the kink. */
void drape_motion_pin_velocity(const drape_motion *motion, int32_t i, double t, double within, double v[3]);

/* Whether a collider moves at all, its displacement, and its velocity as above. */
bool drape_motion_moves_collider(const drape_motion *motion, int32_t collider);
void drape_motion_collider(const drape_motion *motion, int32_t collider, double t, double displacement[3]);
void drape_motion_collider_velocity(const drape_motion *motion, int32_t collider, double t, double within,
                                    double v[3]);

/* The next time after t, before end, at which some velocity jumps; else end. */
double drape_motion_next_kink(const drape_motion *motion, double t, double end);
bool drape_motion_at_kink(const drape_motion *motion, double t);

/* From now on a pinned node moves on a user-defined path: from where it is at time t, on a cubic, to the
 * position x and the velocity v at t + span [s]; v NULL: straight, at one speed. A collider: to the
 * displacement x. */
void drape_motion_send_pin(drape_motion *motion, int32_t node, double t, double span, const double x[3],
                           const double *v);
void drape_motion_send_collider(drape_motion *motion, int32_t collider, double t, double span,
                                const double x[3], const double *v);

/* Pins that a host moved rest from now on where these positions (node_count x 3) have them. */
void drape_motion_hold_pins(drape_motion *motion, const double *x);

#endif
