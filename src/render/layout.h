/* layout.h: the places of panels, legend and lines in a picture, and the overlay of legend, lines and
 * labels. */
#ifndef DRAPE_RENDER_LAYOUT_H
#define DRAPE_RENDER_LAYOUT_H

#include "render/overlay.h"
#include "render/painter.h"

/* In pixels from the lower left. */
typedef struct drape_rectangle {
    int left, bottom, width, height;
} drape_rectangle;

/* The part of a panel that its camera frames, and the whole of it: at the sides of a picture the scene
 * continues beneath lines and legend. */
drape_rectangle drape_layout_inner(const drape_overlay *overlay, const drape_picture *picture, int panel);
drape_rectangle drape_layout_whole(const drape_overlay *overlay, const drape_picture *picture, int panel);

/* Puts legend, labels, lines and caption on the overlay. */
void drape_layout_put(drape_overlay *overlay, const drape_picture *picture);

#endif
