/* track.h: the displacement of a pin or a collider as a piecewise linear function of time, and the
 * rotation of a collider as a piecewise steady one. */
#ifndef DRAPE_MODEL_TRACK_H
#define DRAPE_MODEL_TRACK_H

#include "model/model.h"

int64_t drape_track_key_before(const drape_track_key *keys, size_t key_count, double t); /* -1: none */

/* Computes the displacement [m] at time t [s]: linear between keys, constant before the first and after the
 * last, 0 without keys. */
void drape_track_displacement(const drape_track_key *keys, size_t key_count, double t,
                              double displacement[3]);

/* Computes the slope [m/s] at a time between two keys; 0 before the first and after the last. */
void drape_track_velocity(const drape_track_key *keys, size_t key_count, double t, double velocity[3]);

/* Computes the rotation (3 x 3, row by row) at time t [s]; I without keys. */
void drape_turns_rotation(const drape_turns *turns, double t, double rotation[9]);

/* Computes the angular velocity [rad/s] at a time between two keys; 0 before the first and after the last. */
void drape_turns_velocity(const drape_turns *turns, double t, double velocity[3]);

/* Whether a track moves pins at all. */
bool drape_track_moves(const drape_track *track);

/* Computes the position [m] at time t [s] of a pinned node: turned about the pivot, then displaced; and its
 * velocity [m/s] at t, with the slopes of a time `within` that lies between two keys. */
void drape_track_point(const drape_track *track, const double start[3], double t, double x[3]);
void drape_track_point_velocity(const drape_track *track, const double start[3], double t, double within,
                                double v[3]);

/* Whether the path of a host from span[0] to span[1] has just come to its end: the next moment that a host
 * computes may differ by rounding. */
static inline bool drape_has_arrived(const double span[2], double t)
{
    return t >= span[1] && t - span[1] <= 1e-9 * (span[1] - span[0]);
}

/* The largest angular velocity between keys [rad/s]. */
double drape_turns_fastest(const drape_turns *turns);

#endif
