/* overlay.h: what is drawn over a picture in two dimensions: text, boxes, the legend of a field. Coordinates
 * are pixels from the upper left. Items are collected and drawn at once. */
#ifndef DRAPE_RENDER_OVERLAY_H
#define DRAPE_RENDER_OVERLAY_H

#include "render/font.h"
#include "render/gl.h"

#define DRAPE_OVERLAY_QUADS 4096 /* further ones are not drawn */

typedef struct drape_overlay {
    int width, height; /* of the picture */
    float unit;        /* pixels that correspond to one pixel of a picture 720 rows high */
    drape_font font;
    GLuint program, ramp, letters;
    drape_gl_mesh mesh;
    float *quads; /* (DRAPE_OVERLAY_QUADS x 6 vertices) */
    size_t count;
} drape_overlay;

/* fine: pixels along a side of one that will be seen, for the smallest text. Takes its memory from an arena.
 * Errors: DRAPE_E_MEMORY, DRAPE_E_FILE. */
drape_status drape_overlay_create(drape_arena *arena, int width, int height, int fine,
                                  drape_overlay *overlay);
void drape_overlay_free(drape_overlay *overlay); /* its OpenGL objects; may be empty */

typedef enum drape_align { DRAPE_LEFT, DRAPE_MIDDLE, DRAPE_RIGHT } drape_align;

/* colour: linear RGBA. The y of a text is its base line. */
void drape_overlay_box(drape_overlay *overlay, float x, float y, float width, float height,
                       const float *colour);
void drape_overlay_text(drape_overlay *overlay, float x, float y, drape_align align, const float *colour,
                        const char *text);

/* The ramp from low to high with ticks at round numbers and a title above. Its right end is at `right`, its
 * lower end at `bottom`. */
void drape_overlay_legend(drape_overlay *overlay, float right, float bottom, float tall, const char *title,
                          double low, double high);

/* The width of a legend, an upper bound for all numbers. */
float drape_overlay_legend_width(const drape_overlay *overlay, const char *title);

/* Draws the collected items and clears them. */
void drape_overlay_draw(drape_overlay *overlay);

extern const float drape_ink[4], drape_faint[4];

#endif
