/* layout.h: where panels, legend and lines are on a picture, and what of it lies flat: legend, lines, labels. */
#ifndef DRAPE_RENDER_LAYOUT_H
#define DRAPE_RENDER_LAYOUT_H

#include "render/overlay.h"
#include "render/painter.h"

/* In pixels, from below. */
typedef struct drape_rectangle {
    int left, bottom, width, height;
} drape_rectangle;

/* Of a panel: what its camera frames, and what is drawn: at the sides of a picture the scene goes on beneath lines and
 * legend. */
drape_rectangle drape_layout_inner(const drape_overlay *overlay, const drape_picture *picture, int panel);
drape_rectangle drape_layout_whole(const drape_overlay *overlay, const drape_picture *picture, int panel);

/* Puts legend, labels, lines and caption on the overlay. */
void drape_layout_put(drape_overlay *overlay, const drape_picture *picture);

#endif
