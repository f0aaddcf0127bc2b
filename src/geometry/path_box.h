/*
 * path_box.h: boxes around elements at both ends of their straight paths, four at once. Two convex pieces
 * stay apart on their paths if one axis separates them at both ends with the same piece in front: the
 * difference of any two of their points along that axis is then linear in the step fraction and positive at
 * both ends.
 */
#ifndef DRAPE_GEOMETRY_PATH_BOX_H
#define DRAPE_GEOMETRY_PATH_BOX_H

#include "base/lanes.h"

typedef struct drape_path_boxes {
    double low[2][3][LANES], high[2][3][LANES]; /* by end and axis */
} drape_path_boxes;

/* A box that is compared with four others: the same number in all lanes. */
typedef struct drape_path_box {
    lanes low[2][3], high[2][3];
} drape_path_box;

/* One of four boxes, enlarged by reach. */
LANES_INLINE void drape_path_box_of(const drape_path_boxes *boxes, int32_t lane, double reach, int ends,
                                    drape_path_box *box)
{
    for (int end = 0; end < ends; end++)
        for (int k = 0; k < 3; k++) {
            box->low[end][k] = boxes->low[end][k][lane] - reach - (lanes){0};
            box->high[end][k] = boxes->high[end][k][lane] + reach - (lanes){0};
        }
}

/* Which boxes an axis separates from another one: -1 in their lanes. */
LANES_INLINE lanes_mask drape_path_boxes_apart(const drape_path_boxes *boxes, const drape_path_box *from,
                                               int ends)
{
    lanes_mask apart = {0};
    for (int k = 0; k < 3; k++) {
        lanes_mask above = lanes_load(boxes->low[0][k]) > from->high[0][k],
                   below = lanes_load(boxes->high[0][k]) < from->low[0][k];
        if (ends > 1) {
            above &= lanes_load(boxes->low[1][k]) > from->high[1][k];
            below &= lanes_load(boxes->high[1][k]) < from->low[1][k];
        }
        apart |= above | below;
    }
    return apart;
}

#endif
