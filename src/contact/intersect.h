/* intersect.h: how many edges of the cloths pass through triangles that they share no node with, in any
 * state. */
#ifndef DRAPE_CONTACT_INTERSECT_H
#define DRAPE_CONTACT_INTERSECT_H

#include "model/model.h"

typedef struct drape_intersections {
    int64_t count;
    int32_t edge[2], triangle[3]; /* nodes of the first one; -1 where there is none */
} drape_intersections;

/* x (node_count x 3) [m], finite. Touching counts only where the edge changes sides. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_find_intersections(drape_context *ctx, const drape_model *model, const double *x,
                                      drape_intersections *found);

#endif
