/* images.c: see images.h. */
#include "render/images.h"

#include "base/arena.h"
#include "io/export.h"

#include <math.h>
#include <png.h>
#include <stdio.h>
#include <string.h>

#define PATTERN  1024 /* pixels along a side */
#define SKY      1024 /* pixels wide, and half as many high */
#define RAMP     256
#define CHECKS   8  /* along a side of the pattern */
#define WEAVES   64 /* threads along a side of the relief */
#define DIAMONDS 9
#define PI       3.14159265358979323846

/* ---- Files ---- */

drape_status drape_png_write(drape_context *ctx, drape_folder *folder, const char *path,
                             const uint8_t *pixels, int width, int height, bool small)
{
    png_image image = {.version = PNG_IMAGE_VERSION,
                       .width = (png_uint_32)width,
                       .height = (png_uint_32)height,
                       .format = PNG_FORMAT_RGB,
                       .flags = small ? 0 : PNG_IMAGE_FLAG_FAST};
    size_t count = (size_t)width * (size_t)height;
    png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
    drape_arena arena = drape_arena_of(ctx);
    drape_file file = {0};
    uint8_t *rgb = drape_arena_take(&arena, count, 3), *data = drape_arena_take(&arena, size, 1);
    drape_status status = drape_arena_status(&arena);
    for (size_t i = 0; !status && i < count; i++)
        memcpy(rgb + 3 * i, pixels + 4 * i, 3);
    if (!status && !png_image_write_to_memory(&image, data, &size, 0, rgb, 0, NULL))
        status = drape_fail(ctx, DRAPE_E_FILE, "cannot write \"%s\": %s", path, image.message);
    if (!status)
        status = drape_export_begin(ctx, folder, path, &file);
    if (!status) {
        drape_file_put(&file, data, size);
        status = drape_file_finish(&file);
    }
    drape_file_destroy(&file);
    drape_arena_free(&arena);
    return status;
}

/* Reads a PNG of any kind as RGBA; *pixels is freed with drape_free. */
static drape_status read_png(drape_context *ctx, const char *path, uint8_t **pixels, int *width, int *height)
{
    png_image image = {.version = PNG_IMAGE_VERSION};
    *pixels = NULL;
    if (!png_image_begin_read_from_file(&image, path))
        return drape_fail(ctx, DRAPE_E_FILE, "cannot read \"%s\" as a PNG: %s", path, image.message);
    image.format = PNG_FORMAT_RGBA;
    drape_status status = DRAPE_OK;
    if (image.width > 16384 || image.height > 16384)
        status =
            drape_fail(ctx, DRAPE_E_FILE, "\"%s\" has %u x %u pixels; at most 16384 x 16384 are possible",
                       path, (unsigned)image.width, (unsigned)image.height);
    if (!status && !(*pixels = drape_alloc(ctx, PNG_IMAGE_SIZE(image), 1)))
        status = DRAPE_E_MEMORY;
    if (!status && !png_image_finish_read(&image, NULL, *pixels, 0, NULL))
        status = drape_fail(ctx, DRAPE_E_FILE, "cannot read \"%s\" as a PNG: %s", path, image.message);
    *width = (int)image.width;
    *height = (int)image.height;
    png_image_free(&image);
    if (status) {
        drape_free(ctx, *pixels);
        *pixels = NULL;
    }
    return status;
}

/* ---- Textures ---- */

static bool in_box(double x, double y, double x0, double y0, double x1, double y1)
{
    return x >= x0 && x <= x1 && y >= y0 && y <= y1;
}

/* Checks with fine lines between them, and in every second light check the letter F, which shows left, right,
 * up and down. */
static void paint_pattern(double u, double v, void *to)
{
    static const uint8_t dark[] = {38, 70, 118}, light[] = {232, 226, 212}, red[] = {198, 68, 52},
                         line[] = {24, 44, 78};
    double x = u * CHECKS, y = v * CHECKS;
    int i = (int)x, j = (int)y;
    x -= i;
    y -= j;
    const uint8_t *colour = (i + j) % 2 ? light : dark;
    if (fmin(fmin(x, 1 - x), fmin(y, 1 - y)) < 0.03)
        colour = line;
    else if ((i + j) % 2 && i % 2 == 1 &&
             (in_box(x, y, 0.28, 0.16, 0.42, 0.84) || in_box(x, y, 0.28, 0.70, 0.74, 0.84) ||
              in_box(x, y, 0.28, 0.44, 0.64, 0.57)))
        colour = red;
    memcpy(to, (const uint8_t[]){colour[0], colour[1], colour[2], 255}, 4);
}

/* Diamonds of raised metal thread, each with a knot in its middle, over a fine weave. */
static void paint_heights(double u, double v, void *to)
{
    double warp = sin(PI * 2 * WEAVES * u) * cos(PI * 2 * WEAVES * v);
    double x = fabs(fmod(u * DIAMONDS, 1) - 0.5), y = fabs(fmod(v * DIAMONDS, 1) - 0.5);
    double across = x + y, corner = 1 - across; /* from the middle of this diamond and of the next */
    double band = exp(-pow((across - 0.36) / 0.045, 2)), knot = 1 / (1 + exp((across - 0.14) / 0.015)),
           dot = 1 / (1 + exp((corner - 0.10) / 0.012));
    double metal = fmin(1, band + knot + dot);
    double height = 0.22 + 0.50 * metal + 0.05 * (1 - metal) * warp;
    const uint8_t grey = (uint8_t)lround(255 * fmin(1, fmax(0, height))),
                  shine = (uint8_t)lround(255 * fmin(1, fmax(0, 1.6 * metal - 0.3)));
    memcpy(to, (const uint8_t[]){grey, grey, grey, shine}, 4);
}

static double smooth(double from, double to, double x)
{
    double s = fmin(1, fmax(0, (x - from) / (to - from)));
    return s * s * (3 - 2 * s);
}

/* Brightness of a lamp with soft edges in a direction. */
static double lamp(double longitude, double latitude, double at, double high, double wide, double tall)
{
    double along = remainder(longitude - at, 2 * PI);
    return smooth(wide, 0.86 * wide, fabs(along)) * smooth(tall, 0.86 * tall, fabs(latitude - high));
}

/* A tiled floor that fades with distance, walls that get lighter upwards, and three lamps. */
static void paint_sky(double u, double v, void *to)
{
    float *pixel = to;
    double longitude = 2 * PI * (u - 0.5), latitude = PI * (v - 0.5), up = sin(latitude);
    double wall = 0.07 + 0.42 * pow(smooth(-0.05, 1.0, up), 1.3), floor = smooth(0.012, -0.012, up);
    double away = cos(latitude) / fmax(0.02, -up), x = away * sin(longitude), z = away * cos(longitude);
    double tile = smooth(-0.06, 0.06, sin(2.2 * x) * sin(2.2 * z)), far = smooth(7, 2, away);
    double ground = 0.15 + 0.22 * tile * far;
    const double cool[3] = {0.80, 0.94, 1.16}, warm[3] = {1.10, 1.0, 0.86};
    double lamps = 7.0 * lamp(longitude, latitude, -0.9, 0.62, 0.42, 0.22) +
                   3.2 * lamp(longitude, latitude, 1.3, 0.50, 0.14, 0.40) +
                   2.6 * lamp(longitude, latitude, 2.9, 0.34, 0.50, 0.08);
    for (int k = 0; k < 3; k++)
        pixel[k] = (float)((1 - floor) * wall * 1.5 * cool[k] + floor * ground * warm[k] + lamps * warm[k]);
    pixel[3] = 1;
}

drape_status drape_texture(drape_context *ctx, drape_texture_kind kind, const char *path, GLuint *out)
{
    static const struct {
        void (*paint)(double u, double v, void *to);
        int width, height;
        size_t bytes;        /* of a pixel */
        GLenum type, format; /* of the built-in one */
        GLenum of_file;      /* the format of one from a file */
        GLint wrap;          /* along v */
    } kinds[] = {
        {paint_pattern, PATTERN, PATTERN, 4, GL_UNSIGNED_BYTE, GL_SRGB8_ALPHA8, GL_SRGB8_ALPHA8, GL_REPEAT},
        {paint_heights, PATTERN, PATTERN, 4, GL_UNSIGNED_BYTE, GL_RGBA8, GL_RGBA8, GL_REPEAT},
        {paint_sky, SKY, SKY / 2, 4 * sizeof(float), GL_FLOAT, GL_RGBA16F, GL_SRGB8_ALPHA8,
         GL_CLAMP_TO_EDGE}};
    int width = kinds[kind].width, height = kinds[kind].height;
    const size_t bytes = kinds[kind].bytes;
    uint8_t *pixels = path ? NULL : drape_alloc(ctx, (size_t)width * (size_t)height, bytes);
    drape_status status = path     ? read_png(ctx, path, &pixels, &width, &height)
                          : pixels ? DRAPE_OK
                                   : DRAPE_E_MEMORY;
    if (status)
        return status;
    if (path) /* the bottom row first, as v grows upwards */
        drape_gl_flip(pixels, width, height);
    for (int j = 0; !path && j < height; j++)
        for (int i = 0; i < width; i++)
            kinds[kind].paint((i + 0.5) / width, (j + 0.5) / height,
                              pixels + bytes * ((size_t)j * (size_t)width + (size_t)i));
    *out = drape_gl_texture(path ? kinds[kind].of_file : kinds[kind].format, width, height, GL_RGBA,
                            path ? GL_UNSIGNED_BYTE : kinds[kind].type, pixels, GL_LINEAR, GL_REPEAT);
    glGenerateMipmap(GL_TEXTURE_2D);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, kinds[kind].wrap);
    drape_free(ctx, pixels);
    return DRAPE_OK;
}

/* ---- The colours of fields ---- */

/* OKLab to linear RGB: https://bottosson.github.io/posts/oklab, 2020. */
static void from_oklab(const double *lab, double *rgb)
{
    double l = lab[0] + 0.3963377774 * lab[1] + 0.2158037573 * lab[2];
    double m = lab[0] - 0.1055613458 * lab[1] - 0.0638541728 * lab[2];
    double s = lab[0] - 0.0894841775 * lab[1] - 1.2914855480 * lab[2];
    l = l * l * l;
    m = m * m * m;
    s = s * s * s;
    rgb[0] = 4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s;
    rgb[1] = -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s;
    rgb[2] = -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s;
}

/* The hue runs from violet, 310 degrees, down to yellow, 105; the chroma is the largest that the screen can
 * show. */
void drape_ramp(double s, float rgb[3])
{
    double hue = (310 - 205 * pow(s, 1.1)) * PI / 180, chroma = 0.15, colour[3], low, high;
    double lab[3] = {0.26 + 0.66 * s, 0, 0};
    do {
        lab[1] = chroma * cos(hue);
        lab[2] = chroma * sin(hue);
        from_oklab(lab, colour);
        low = fmin(fmin(colour[0], colour[1]), colour[2]);
        high = fmax(fmax(colour[0], colour[1]), colour[2]);
        chroma -= 0.002;
    } while ((low < 0 || high > 1) && chroma > 0);
    for (int k = 0; k < 3; k++)
        rgb[k] = (float)fmin(1, fmax(0, colour[k]));
}

GLuint drape_texture_ramp(void)
{
    float pixels[RAMP][4];
    for (int i = 0; i < RAMP; i++) {
        drape_ramp(i / (RAMP - 1.0), pixels[i]);
        pixels[i][3] = 1;
    }
    return drape_gl_texture(GL_RGBA16F, RAMP, 1, GL_RGBA, GL_FLOAT, pixels, GL_LINEAR, GL_CLAMP_TO_EDGE);
}
