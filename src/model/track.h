/* track.h: the displacement of a pin or a collider as a piecewise linear function of time. */
#ifndef DRAPE_MODEL_TRACK_H
#define DRAPE_MODEL_TRACK_H

#include "drape/drape.h"

/* Computes the displacement [m] at time t [s]: linear between keys, constant before the first and after the
 * last. */
void drape_track_displacement(const drape_track_key *keys, size_t key_count, double t,
                              double displacement[3]);

/* Computes the slope [m/s] at a time between two keys; 0 before the first and after the last. */
void drape_track_velocity(const drape_track_key *keys, size_t key_count, double t, double velocity[3]);

#endif
