/*
 * gap.h: the geometry of an active contact of up to four points, evaluated once where the contact is found,
 * and read by forces, energy, friction and Jacobian.
 */
#ifndef DRAPE_CONTACT_GAP_H
#define DRAPE_CONTACT_GAP_H

#include "geometry/closest.h"

#include <stdbool.h>

enum { DRAPE_GAP_DOFS = 3 * 4 }; /* coordinates of its points */

typedef struct drape_gap {
    double value; /* [m] */
    drape_closest
        closest;       /* d gap / dx_i = c_i normal for its points; with 1 point c is 1, params and dcdt 0 */
    bool fixed_normal; /* the normal and c do not change with the points: a sharp feature is touched */
    bool mollified;    /* m and dm are set; else m = 1 and dm = 0 */
    double m, dm[DRAPE_GAP_DOFS]; /* mollifier of nearly parallel edges, and its derivative */
    double curvature
        [9]; /* of a smooth surface, dn/dx (3 x 3 [1/m]); the weights of the points are of one place */
} drape_gap;

/* How the geometry changes with the points. Column 3 i + k belongs to coordinate k of point i. */
typedef struct drape_gap_derivatives {
    drape_closest_derivatives closest;          /* dc/dx and dn/dx */
    double ddm[DRAPE_GAP_DOFS][DRAPE_GAP_DOFS]; /* of the mollifier, if there is one */
} drape_gap_derivatives;

#endif
