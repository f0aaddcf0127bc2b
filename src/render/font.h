/* font.h: Drape's own letters, strokes on a small grid that are drawn at any size: ASCII and the few signs
 * that units need. */
#ifndef DRAPE_RENDER_FONT_H
#define DRAPE_RENDER_FONT_H

#include "base/arena.h"

#define DRAPE_FONT_CELLS 128 /* glyphs in an atlas, side by side */

typedef struct drape_font {
    float height;                /* of a capital [pixels] */
    int cell_width, cell_height; /* pixels */
    float origin[2];             /* left end of a glyph's base line, from its cell's upper left [pixels] */
    uint8_t *alpha;              /* (cell_height x DRAPE_FONT_CELLS cell_width) */
} drape_font;

/* Draws all glyphs, into an arena. Errors: DRAPE_E_MEMORY. */
drape_status drape_font_create(drape_arena *arena, float height, drape_font *font);

/* The next glyph of a UTF-8 text and its advance [pixels]; *text moves on. -1 at the end of the text. A
 * character that the font does not have is a box. */
int drape_font_next(const drape_font *font, const char **text, float *advance);
float drape_font_width(const drape_font *font, const char *text);

#endif
