/*
 * deformation.h: where the points of a collider that deforms are at a time, in its own coordinates: between
 * its frames, linear in time, or on paths that a host set. It is part of the motion (motion.h) of one sim.
 */
#ifndef DRAPE_MODEL_DEFORMATION_H
#define DRAPE_MODEL_DEFORMATION_H

#include "base/archive.h"
#include "model/model.h"

typedef struct drape_deformation {
    const drape_sequence *frames; /* without frames, the collider is rigid and all below is unused */
    bool given;                   /* a host sends the points; if not, the frames apply */
    bool smooth;                  /* their first velocities continue the motion before: no kink */
    double t[2];                  /* [s] increasing; at rest before and after */
    double *x[2];                 /* (points x 3) [m] at both ends of a cubic */
    double *v[2];                 /* (points x 3) [m/s] */
    double *spare[2];             /* (points x 3) workspace */
} drape_deformation;

drape_status drape_deformation_create(drape_arena *arena, const drape_sequence *frames,
                                      drape_deformation *out);

/* Whether the points ever move. */
bool drape_deformation_moves(const drape_deformation *d);

/* Writes the positions of the points (points x 3 [m]) at time t, and their velocities [m/s] on the piece that
 * contains the time `within`. */
void drape_deformation_points(const drape_deformation *d, double t, double *x);
void drape_deformation_velocities(const drape_deformation *d, double t, double within, double *v);

/* The same of the three points of a triangle alone. */
void drape_deformation_corners(const drape_deformation *d, const int32_t *triangle, double t, double x[9]);
void drape_deformation_corner_velocities(const drape_deformation *d, const int32_t *triangle, double t,
                                         double within, double v[9]);

/* `count` numbers of a cubic with the values x and the rates v at the times t0 < t1, and their rates: Hermite
 * interpolation at s = (t - t0)/(t1 - t0). At rest before and after; `within` as above. */
void drape_cubic_values(const double times[2], const double *const x[2], const double *const v[2], double t,
                        size_t count, double *out);
void drape_cubic_rates(const double times[2], const double *const x[2], const double *const v[2], double t,
                       double within, size_t count, double *out);

/* As drape_motion_next_kink and drape_motion_at_kink. */
double drape_deformation_next_kink(const drape_deformation *d, double t, double end);
bool drape_deformation_at_kink(const drape_deformation *d, double t);

/* Sends the points, from where they are at time t, on cubics to x and velocities v (points x 3) at t + span;
 * v NULL: on straight lines at constant speed. */
void drape_deformation_send(drape_deformation *d, double t, double span, const double *x, const double *v);

/* Takes the path of another deformation of the same collider. */
void drape_deformation_copy(drape_deformation *d, const drape_deformation *from);

void drape_deformation_archive(drape_deformation *d, drape_archive *a);

/* The positions between the frames alone, for the points of a sequence. */
void drape_sequence_points(const drape_sequence *frames, double t, double *x);

#endif
