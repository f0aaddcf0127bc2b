/*
 * painter.h: draws pictures: one panel for each run, side by side, under one camera and one shading. An OpenGL 3.3
 * core context is current in all functions here.
 */
#ifndef DRAPE_RENDER_PAINTER_H
#define DRAPE_RENDER_PAINTER_H

#include "render/canvas.h"
#include "render/overlay.h"
#include "render/shading.h"
#include "render/stage.h"

#define DRAPE_MAX_PANELS 16

typedef struct drape_painter drape_painter;

typedef struct drape_painter_def {
    int width, height;                           /* pixels, 16 to DRAPE_MAX_PICTURE */
    const char *pattern, *heights, *environment; /* PNG files; NULL: the program's own */
} drape_painter_def;

/* The names of files need only live until it returns. Errors: DRAPE_E_FILE (a PNG, a shader, the driver),
 * DRAPE_E_MEMORY. */
drape_status drape_painter_create(drape_context *ctx, const drape_painter_def *def, drape_painter **out);
void drape_painter_destroy(drape_painter **painter);

typedef struct drape_panel {
    drape_stage *stage; /* of this context, settled */
    drape_moment moment;
    const char *label; /* NULL: none */
} drape_panel;

typedef struct drape_picture {
    const drape_panel *panels; /* 1 to DRAPE_MAX_PANELS */
    int panel_count;
    const drape_shading *shading;
    double low, high; /* of its field, in the field's unit */
    drape_camera camera;
    float column;             /* pixels at the left that the camera leaves to the lines */
    const char *caption;      /* below, at the left; NULL: none */
    const char *const *lines; /* above, at the left, one below the other; NULL-ended; NULL: none */
} drape_picture;

/* Width over height of what a camera frames: a panel, without the column of lines and the strip of the legend. Of the
 * picture panels, camera and lines are not asked for. */
float drape_painter_aspect(const drape_painter *painter, const drape_picture *picture);

/* How a panel is seen. */
drape_view drape_painter_view(const drape_painter *painter, const drape_picture *picture, int panel);

/* Draws; drape_canvas_read and drape_canvas_show take it from the canvas. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_painter_draw(drape_painter *painter, const drape_picture *picture);
const drape_canvas *drape_painter_canvas(const drape_painter *painter);

/* For marks on the next picture: what is put there lies over it. */
drape_overlay *drape_painter_overlay(drape_painter *painter);

#endif
