/*
 * deformed.h: a collider with frames (drape_collider.frames) at one moment, as a rigid collider of its own,
 * whose distance is that of the moment. Its coordinates are the collider's own.
 */
#ifndef DRAPE_COLLIDERS_DEFORMED_H
#define DRAPE_COLLIDERS_DEFORMED_H

#include "colliders/colliders.h"
#include "model/motion.h"

typedef struct drape_deformed {
    drape_collider collider;              /* without frames */
    struct drape_mesh_distance *distance; /* what its shape keeps */
} drape_deformed;

/* *out is the collider as it is at rest; the arena holds what it has of its own. Errors: DRAPE_E_MEMORY. */
drape_status drape_deformed_create(drape_arena *arena, const drape_collider *collider, drape_deformed **out);

/* Moves its points (point_count x 3) there: its tree is refitted, unless they are there already. */
void drape_deformed_move(drape_deformed *deformed, const double *points);

/* The collider at time t, on the motion of a sim, or, motion NULL, on its frames: the collider itself if it
 * is rigid. The arena holds the rest. Errors: DRAPE_E_MEMORY. */
drape_status drape_deformed_at(drape_arena *arena, const drape_model *model, const drape_motion *motion,
                               int32_t collider, double t, const drape_collider **out);

/* Writes the triangles (count) of a collider with frames that are nearest to nodes (count) at the positions x
 * (node_count x 3) of space at time t, of several the first one; -1 if the collider is rigid. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_deformed_nearest(drape_context *ctx, const drape_motion *motion, int32_t collider,
                                    double t, int32_t count, const int32_t *nodes, const double *x,
                                    int32_t *triangles);

#endif
