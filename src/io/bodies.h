/* bodies.h: the surfaces of colliders, as objects of their own beside the cloth, for frame formats that have
 * them. */
#ifndef DRAPE_IO_BODIES_H
#define DRAPE_IO_BODIES_H

#include "model/model.h"

/* A collider. Its vertices are in its own coordinates, and are where its pose puts them in a frame; those of
 * a collider that deforms are the points of its shape, which each frame has. */
typedef struct drape_export_body {
    const char *name;
    bool deforms, moves; /* moves: its pose may differ from that of the first frame */
    int32_t vertex_count, triangle_count;
    float *vertex;       /* (vertex_count x 6) position [m] and normal; NULL if it deforms */
    int32_t *triangle;   /* (triangle_count x 3), counterclockwise from outside */
    int32_t first_point; /* of its points among those of all colliders that deform */
} drape_export_body;

/* Makes those of all colliders (collider_count). An endless one, as a plane, is cut off at two diagonals of
 * the cloth at rest from the point nearest to its middle. Errors: DRAPE_E_MEMORY. */
drape_status drape_export_bodies_create(drape_arena *arena, const drape_model *model,
                                        drape_export_body **bodies);

/* The number of points of all colliders that deform. */
size_t drape_export_points(const drape_model *model);

#endif
