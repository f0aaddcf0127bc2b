/* intersect.h: counts the cloth edges that pass through triangles with which they share no node. */
#ifndef DRAPE_GEOMETRY_INTERSECT_H
#define DRAPE_GEOMETRY_INTERSECT_H

#include "model/model.h"

typedef struct drape_intersections {
    int64_t count;
    int32_t edge[2], triangle[3]; /* nodes of the first pair; -1 if there is none */
} drape_intersections;

/* x (node_count x 3) [m] must be finite. An edge that only touches a triangle does not count: its ends must
 * be on different sides. Errors: DRAPE_E_MEMORY. */
drape_status drape_find_intersections(drape_context *ctx, const drape_model *model, const double *x,
                                      drape_intersections *found);

#endif
