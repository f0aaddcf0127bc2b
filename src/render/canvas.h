/* canvas.h: what is drawn into: a framebuffer with 4 samples a pixel, in sRGB. */
#ifndef DRAPE_RENDER_CANVAS_H
#define DRAPE_RENDER_CANVAS_H

#include "render/gl.h"

#define DRAPE_MAX_PICTURE 8192 /* pixels of a side */

typedef struct drape_canvas {
    int width, height;
    GLuint many, colour, depth; /* with samples */
    GLuint one, resolved;       /* a sample a pixel */
    GLuint aside, copied;       /* the same with a texture; 0: not made yet */
} drape_canvas;

/* Errors: DRAPE_E_MEMORY, DRAPE_E_FILE (the driver has no such framebuffer). */
drape_status drape_canvas_create(drape_context *ctx, int width, int height, drape_canvas *canvas);
void drape_canvas_free(drape_canvas *canvas); /* an empty one is fine */

/* What follows is drawn into it. */
void drape_canvas_begin(const drape_canvas *canvas);

/* A texture of what was drawn so far; drawing goes on. */
GLuint drape_canvas_copy(drape_canvas *canvas);

/* Reads the pixels (width x height x 4, the upper row first, sRGB, alpha 255). */
drape_status drape_canvas_read(drape_context *ctx, const drape_canvas *canvas, uint8_t *pixels);

/* Shows them in the framebuffer of a window of this size. */
void drape_canvas_show(const drape_canvas *canvas, int width, int height);

#endif
