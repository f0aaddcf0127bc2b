/* images.h: pictures as files and as textures; those that the program makes itself. */
#ifndef DRAPE_RENDER_IMAGES_H
#define DRAPE_RENDER_IMAGES_H

#include "render/gl.h"

/* Writes pixels (width x height x 4, upper row first) to a PNG, whole or not at all. small: as small as zlib makes
 * it, else fast. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_png_write(drape_context *ctx, const char *path, const uint8_t *pixels, int width,
                             int height, bool small);

/* Reads a PNG of any kind as RGBA; *pixels is freed by drape_free. Errors: DRAPE_E_FILE (also of what is no
 * PNG), DRAPE_E_MEMORY. */
drape_status drape_png_read(drape_context *ctx, const char *path, uint8_t **pixels, int *width, int *height);

/* Textures with mipmaps that repeat, of a file, or where path is NULL the program's own. *out is 0 on failure.
 *   pattern      colour of cloth, with an F in it to read: its foot is at v = 0
 *   heights      red is the height, 0 to 1: a woven relief; alpha is 1 where the thread is metal
 *   environment  the world around as longitude and latitude, linear: a room with lamps */
drape_status drape_texture_pattern(drape_context *ctx, const char *path, GLuint *out);
drape_status drape_texture_heights(drape_context *ctx, const char *path, GLuint *out);
drape_status drape_texture_environment(drape_context *ctx, const char *path, GLuint *out);

/* The colours of fields, from low to high: even steps of lightness in OKLab (Ottosson 2020), from a dark violet over
 * blue and green to a light yellow, so that they can be told apart without seeing colours. s: 0 to 1; linear RGB. */
void drape_ramp(double s, float rgb[3]);
GLuint drape_texture_ramp(void);

#endif
