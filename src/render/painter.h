/*
 * painter.h: draws pictures: one panel for each run, side by side, with one camera and one shading. All
 * functions here need a current OpenGL 3.3 core context.
 */
#ifndef DRAPE_RENDER_PAINTER_H
#define DRAPE_RENDER_PAINTER_H

#include "render/overlay.h"
#include "render/shading.h"
#include "render/stage.h"

#define DRAPE_MAX_PANELS 16

typedef struct drape_painter drape_painter;

typedef struct drape_painter_def {
    int width, height;                           /* pixels, 16 to DRAPE_MAX_PICTURE */
    int fine;                                    /* pixels along a side of one that will be seen, from 1 */
    const char *pattern, *heights, *environment; /* PNG files; NULL: the built-in ones */
} drape_painter_def;

/* The file names are not kept. Errors: DRAPE_E_FILE (a PNG, a shader, the driver),
 * DRAPE_E_MEMORY. */
drape_status drape_painter_create(drape_context *ctx, const drape_painter_def *def, drape_painter **out);
void drape_painter_destroy(drape_painter **painter);

typedef struct drape_panel {
    drape_stage *stage; /* finished */
    drape_moment moment;
    const char *label; /* NULL: none */
} drape_panel;

typedef struct drape_picture {
    const drape_panel *panels; /* 1 to DRAPE_MAX_PANELS */
    int panel_count;
    const drape_shading *shading;
    double low, high; /* range of its field, in the field's unit */
    drape_camera camera;
    float column;             /* pixels at the left that the camera leaves free for the lines */
    const char *caption;      /* at the lower left; NULL: none */
    const char *const *lines; /* at the upper left, one below the other; NULL-ended; NULL: none */
} drape_picture;

/* Width over height of the part of a panel that the camera frames: without the column of lines and the strip
 * of the legend. Panels, camera and lines of the picture need not be set. */
float drape_painter_aspect(const drape_painter *painter, const drape_picture *picture);

/* The view of a panel. */
drape_view drape_painter_view(const drape_painter *painter, const drape_picture *picture, int panel);

/* Draws into the canvas, from which drape_canvas_read and drape_canvas_show take the picture. Errors:
 * DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_painter_draw(drape_painter *painter, const drape_picture *picture);
const drape_canvas *drape_painter_canvas(const drape_painter *painter);

/* For marks to be drawn over the next picture. */
drape_overlay *drape_painter_overlay(drape_painter *painter);

#endif
