/*
 * deformed.h: a collider with frames (drape_collider.frames) at one time, as a rigid collider whose distance
 * is that of this time, in the collider's own coordinates.
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

/* Moves its points to `points` (point_count x 3), and refits the tree, unless they are there already. */
void drape_deformed_move(drape_deformed *deformed, const double *points);

/* The collider at time t, moved by the motion of a sim, or by its frames if motion is NULL; *out is the
 * collider itself if it is rigid. The arena holds what is made. Errors: DRAPE_E_MEMORY. */
drape_status drape_deformed_at(drape_arena *arena, const drape_model *model, const drape_motion *motion,
                               int32_t collider, double t, const drape_collider **out);

/* For each of some nodes (count), at positions x (node_count x 3) in space, writes the nearest triangle of a
 * collider with frames at time t, of several the first one; -1 if the collider is rigid. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_deformed_nearest(drape_context *ctx, const drape_motion *motion, int32_t collider,
                                    double t, int32_t count, const int32_t *nodes, const double *x,
                                    int32_t *triangles);

#endif
