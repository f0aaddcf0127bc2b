/* canvas.h: the framebuffer that pictures are drawn into, in sRGB with 4 samples per pixel. */
#ifndef DRAPE_RENDER_CANVAS_H
#define DRAPE_RENDER_CANVAS_H

#include "render/gl.h"

#define DRAPE_MAX_PICTURE 8192 /* largest width and height [pixels] */

typedef struct drape_canvas {
    int width, height;
    GLuint many, colour, depth; /* framebuffer with several samples per pixel */
    GLuint one, resolved;       /* framebuffer with one sample per pixel */
    GLuint aside, copied;       /* the same as a texture; 0: not made yet */
} drape_canvas;

/* Errors: DRAPE_E_MEMORY, DRAPE_E_FILE (the driver has no framebuffer of this size). */
drape_status drape_canvas_create(drape_context *ctx, int width, int height, drape_canvas *canvas);
void drape_canvas_free(drape_canvas *canvas); /* may be empty */

/* Clears it and directs drawing to it. */
void drape_canvas_begin(const drape_canvas *canvas);

/* A texture of the picture so far; drawing into the canvas continues. */
GLuint drape_canvas_copy(drape_canvas *canvas);

/* Reads the pixels (width x height x 4; top row first, sRGB, alpha 255). */
drape_status drape_canvas_read(drape_context *ctx, const drape_canvas *canvas, uint8_t *pixels);

/* Copies the picture into the framebuffer of a window of this size. */
void drape_canvas_show(const drape_canvas *canvas, int width, int height);

#endif
