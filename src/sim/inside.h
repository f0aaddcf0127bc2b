/* inside.h: what of the cloth reaches into a collider, at any positions and any pose. */
#ifndef DRAPE_SIM_INSIDE_H
#define DRAPE_SIM_INSIDE_H

#include "colliders/colliders.h"
#include "drape/drape.h"

typedef struct drape_inside {
    int32_t triangles; /* of cloth that reach into the collider: a sample is inside, or something crosses */
    double deepest;    /* [m] depth of the deepest point found: of samples, and between crossings */
    int64_t intersections; /* edges of one through triangles of the other */
} drape_inside;

/* The collider is one of the model or, if that deforms, what it is at the moment (colliders/deformed.h). x
 * (node_count x 3) must be finite. Of each triangle 28 points are tested. Edges of the collider are the
 * segments of its shape; a round collider has its axis, if it has one. Errors: DRAPE_E_MEMORY,
 * DRAPE_E_STOPPED (the context's cancel function). */
drape_status drape_find_inside(drape_context *ctx, const drape_model *model, const drape_collider *collider,
                               const drape_collider_pose *pose, const double *x, drape_inside *found);

/* Counts the triangles of cloth without a pinned node that an edge of the collider passes through, or with a
 * side that passes through a triangle of it. Errors as before. */
drape_status drape_find_pierced(drape_context *ctx, const drape_model *model, const drape_collider *collider,
                                const drape_collider_pose *pose, const double *x, int32_t *pierced);

/* The same in the present state of a sim. Errors: DRAPE_E_ARGUMENT (no such collider), and those above. */
drape_status drape_sim_find_inside(const drape_sim *sim, int32_t collider, drape_inside *found);

#endif
