/*
 * body.h: the surface of a collider as it is drawn. It is found from the collider's signed distance alone, so
 * that every row has one, a host's too: where the distance changes its sign between the corners of a grid, a cell
 * gets the point that fits the planes there best (dual contouring: Ju, Losasso, Schaefer & Warren 2002), which lies
 * on edges and corners where there are some.
 */
#ifndef DRAPE_RENDER_BODY_H
#define DRAPE_RENDER_BODY_H

#include "colliders/colliders.h"

typedef struct drape_body {
    float *
        vertex; /* (vertex_count x 6): position in the collider's own coordinates [m], normal; three a triangle */
    size_t vertex_count;
    bool endless;           /* it does not end in the box that it was sought in, as a plane */
    double low[3], high[3]; /* [m] its box, where it ends */
} drape_body;

/* An endless one is cut off at a distance of reach [m] from center. Errors: DRAPE_E_MEMORY. */
drape_status drape_body_create(drape_context *ctx, const drape_collider *collider, const double center[3],
                               double reach, drape_body *body);
void drape_body_free(drape_context *ctx, drape_body *body); /* an empty one is fine */

#endif
