/* images.h: PNG files, textures of files, and the built-in textures. */
#ifndef DRAPE_RENDER_IMAGES_H
#define DRAPE_RENDER_IMAGES_H

#include "io/folder.h"
#include "render/gl.h"

/* Writes pixels (width x height x 4, top row first) to a PNG, completely or not at all: into a folder, or
 * with folder NULL to a path that the user named. small: compresses as well as zlib can instead of fast.
 * Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_png_write(drape_context *ctx, drape_folder *folder, const char *path,
                             const uint8_t *pixels, int width, int height, bool small);

typedef enum drape_texture_kind {
    DRAPE_PATTERN, /* colour of the cloth; built-in: checks with the letter F, upright along v */
    DRAPE_HEIGHTS, /* red: the height, 0 to 1; alpha: 1 where the thread is metal; built-in: a woven relief */
    DRAPE_ENVIRONMENT /* the surroundings by longitude and latitude, linear; built-in: a room with lamps */
} drape_texture_kind;

/* A repeating texture with mipmaps, of a file, or the built-in one if path is NULL. *out is unchanged on
 * failure. Errors: DRAPE_E_FILE (also if the file is not a PNG), DRAPE_E_MEMORY. */
drape_status drape_texture(drape_context *ctx, drape_texture_kind kind, const char *path, GLuint *out);

/* The colours of fields, for s from 0 (low) to 1 (high), in linear RGB: even steps of lightness in OKLab
 * (Ottosson 2020) from a dark violet over blue and green to a light yellow, which differ in brightness
 * for readers who do not see colours. */
void drape_ramp(double s, float rgb[3]);
GLuint drape_texture_ramp(void);

#endif
