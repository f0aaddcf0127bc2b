/* canvas.c: see canvas.h. Shaders convert to sRGB once per pixel. A framebuffer that did it would convert
 * each sample, and back, which takes a software renderer as long as everything else. */
#include "render/canvas.h"

#define SAMPLES 4

drape_status drape_canvas_create(drape_context *ctx, int width, int height, drape_canvas *canvas)
{
    GLint max_samples = 0;
    *canvas = (drape_canvas){.width = width, .height = height};
    glGetIntegerv(GL_MAX_SAMPLES, &max_samples);
    int samples = max_samples < SAMPLES ? max_samples : SAMPLES;
    canvas->many = drape_gl_framebuffer();
    canvas->colour = drape_gl_buffer(samples, GL_RGBA8, width, height, GL_COLOR_ATTACHMENT0);
    canvas->depth = drape_gl_buffer(samples, GL_DEPTH_COMPONENT24, width, height, GL_DEPTH_ATTACHMENT);
    bool complete = glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    canvas->one = drape_gl_framebuffer();
    canvas->resolved = drape_gl_buffer(0, GL_RGBA8, width, height, GL_COLOR_ATTACHMENT0);
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
        canvas->copied = drape_gl_texture(GL_RGBA8, canvas->width, canvas->height, GL_RGBA, GL_UNSIGNED_BYTE,
                                          NULL, GL_LINEAR, GL_CLAMP_TO_EDGE);
        canvas->aside = drape_gl_framebuffer();
        glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, canvas->copied, 0);
    }
    resolve(canvas, canvas->aside);
    glBindFramebuffer(GL_FRAMEBUFFER, canvas->many);
    return canvas->copied;
}

drape_status drape_canvas_read(drape_context *ctx, const drape_canvas *canvas, uint8_t *pixels)
{
    resolve(canvas, canvas->one);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, canvas->one);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glReadPixels(0, 0, canvas->width, canvas->height, GL_RGBA, GL_UNSIGNED_BYTE, pixels);
    drape_gl_flip(pixels, canvas->width, canvas->height);
    for (size_t i = 3; i < 4 * (size_t)canvas->width * (size_t)canvas->height; i += 4)
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
