/* canvas.c: see canvas.h. Shaders convert to sRGB once per pixel. A framebuffer that did it would convert
 * each sample, and back, which takes a software renderer as long as everything else. */
#include "render/canvas.h"

#include <string.h>

#define SAMPLES 4

static GLuint buffer(int samples, GLenum format, int width, int height, GLenum attachment)
{
    GLuint name;
    glGenRenderbuffers(1, &name);
    glBindRenderbuffer(GL_RENDERBUFFER, name);
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, format, width, height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, attachment, GL_RENDERBUFFER, name);
    return name;
}

drape_status drape_canvas_create(drape_context *ctx, int width, int height, drape_canvas *canvas)
{
    GLint max_samples = 0;
    *canvas = (drape_canvas){.width = width, .height = height};
    glGetIntegerv(GL_MAX_SAMPLES, &max_samples);
    int samples = max_samples < SAMPLES ? max_samples : SAMPLES;
    glGenFramebuffers(1, &canvas->many);
    glBindFramebuffer(GL_FRAMEBUFFER, canvas->many);
    canvas->colour = buffer(samples, GL_RGBA8, width, height, GL_COLOR_ATTACHMENT0);
    canvas->depth = buffer(samples, GL_DEPTH_COMPONENT24, width, height, GL_DEPTH_ATTACHMENT);
    bool complete = glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    glGenFramebuffers(1, &canvas->one);
    glBindFramebuffer(GL_FRAMEBUFFER, canvas->one);
    canvas->resolved = buffer(0, GL_RGBA8, width, height, GL_COLOR_ATTACHMENT0);
    complete = complete && glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    drape_status status = drape_gl_check(ctx, "make the buffers of a picture");
    if (!status && !complete)
        status =
            drape_fail(ctx, DRAPE_E_FILE, "OpenGL cannot draw a picture of %d x %d pixels", width, height);
    if (status)
        drape_canvas_free(canvas);
    return status;
}

void drape_canvas_free(drape_canvas *canvas)
{
    if (!canvas->many)
        return;
    glDeleteFramebuffers(1, &canvas->many);
    glDeleteFramebuffers(1, &canvas->one);
    glDeleteFramebuffers(1, &canvas->aside);
    glDeleteTextures(1, &canvas->copied);
    glDeleteRenderbuffers(1, &canvas->colour);
    glDeleteRenderbuffers(1, &canvas->depth);
    glDeleteRenderbuffers(1, &canvas->resolved);
    *canvas = (drape_canvas){.width = 0};
}

void drape_canvas_begin(const drape_canvas *canvas)
{
    glBindFramebuffer(GL_FRAMEBUFFER, canvas->many);
    glViewport(0, 0, canvas->width, canvas->height);
    glDisable(GL_FRAMEBUFFER_SRGB);
    glEnable(GL_MULTISAMPLE);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
}

/* Averages the samples of each pixel into another framebuffer. */
static void resolve(const drape_canvas *canvas, GLuint to)
{
    glBindFramebuffer(GL_READ_FRAMEBUFFER, canvas->many);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, to);
    glBlitFramebuffer(0, 0, canvas->width, canvas->height, 0, 0, canvas->width, canvas->height,
                      GL_COLOR_BUFFER_BIT, GL_NEAREST);
}

GLuint drape_canvas_copy(drape_canvas *canvas)
{
    if (!canvas->copied) {
        glGenTextures(1, &canvas->copied);
        glBindTexture(GL_TEXTURE_2D, canvas->copied);
        glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, canvas->width, canvas->height, 0, GL_RGBA, GL_UNSIGNED_BYTE,
                     NULL);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
        glGenFramebuffers(1, &canvas->aside);
        glBindFramebuffer(GL_FRAMEBUFFER, canvas->aside);
        glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, canvas->copied, 0);
    }
    resolve(canvas, canvas->aside);
    glBindFramebuffer(GL_FRAMEBUFFER, canvas->many);
    return canvas->copied;
}

/* OpenGL has the bottom row first. */
static void flip(uint8_t *pixels, size_t row, int height)
{
    uint8_t kept[4096];
    for (int a = 0, b = height - 1; a < b; a++, b--)
        for (size_t i = 0; i < row; i += sizeof kept) {
            size_t size = row - i < sizeof kept ? row - i : sizeof kept;
            uint8_t *upper = pixels + (size_t)a * row + i, *lower = pixels + (size_t)b * row + i;
            memcpy(kept, upper, size);
            memcpy(upper, lower, size);
            memcpy(lower, kept, size);
        }
}

drape_status drape_canvas_read(drape_context *ctx, const drape_canvas *canvas, uint8_t *pixels)
{
    size_t row = 4 * (size_t)canvas->width;
    resolve(canvas, canvas->one);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, canvas->one);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glReadPixels(0, 0, canvas->width, canvas->height, GL_RGBA, GL_UNSIGNED_BYTE, pixels);
    flip(pixels, row, canvas->height);
    for (size_t i = 3; i < row * (size_t)canvas->height; i += 4)
        pixels[i] = 255;
    return drape_gl_check(ctx, "read a picture");
}

void drape_canvas_show(const drape_canvas *canvas, int width, int height)
{
    resolve(canvas, canvas->one);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, canvas->one);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
    glBlitFramebuffer(0, 0, canvas->width, canvas->height, 0, 0, width, height, GL_COLOR_BUFFER_BIT,
                      GL_NEAREST);
}
