/*
 * body.h: the surface of a collider as it is drawn. It is found from the collider's signed distance alone, so
 * every collider has one, user-defined ones too: each cell of a grid in which the distance changes its sign
 * gets the point that fits the tangent planes of the surface there best (dual contouring: Ju, Losasso,
 * Schaefer & Warren 2002). On edges and corners of the collider that point lies on them.
 */
#ifndef DRAPE_COLLIDERS_BODY_H
#define DRAPE_COLLIDERS_BODY_H

#include "base/arena.h"
#include "colliders/colliders.h"

typedef struct drape_body {
    float *vertex;          /* (vertex_count x 6) position in the collider's own coordinates [m], normal */
    size_t vertex_count;    /* three for each triangle */
    double *sum;            /* (points of the shape x 3) workspace for normals; NULL: no triangles */
    bool endless;           /* unbounded, as a plane is */
    double low[3], high[3]; /* bounding box [m]; an endless body is cut off there */
} drape_body;

/* Updates a body that was made of the triangles of a shape to the present points of the shape. */
void drape_body_follow(const drape_collider_shape *shape, drape_body *body);

/* Makes the body in an arena. An endless one is cut off at twice `reach` [m] from center. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_body_create(drape_arena *arena, const drape_collider *collider, const double center[3],
                               double reach, drape_body *body);

#endif
