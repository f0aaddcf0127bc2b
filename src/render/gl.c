/* gl.c: see gl.h. */
#include "render/gl.h"

#include <string.h>

#define MAX_PIECES 12
#define LOG_SIZE   400

/* Reports the first line of the driver's log. */
static GLuint fail(drape_context *ctx, const char *name, const char *stage, char *log)
{
    log[strcspn(log, "\n")] = 0;
    drape_fail(ctx, DRAPE_E_FILE, "the OpenGL driver rejects the %s shader of \"%s\": %s", stage, name, log);
    return 0;
}

static GLuint compile(drape_context *ctx, const char *name, const char *stage, GLenum kind,
                      const char *const *pieces)
{
    const char *all[MAX_PIECES] = {"#version 330 core\n"};
    char log[LOG_SIZE] = "";
    int count = 1;
    GLint good = 0;
    while (*pieces && count < MAX_PIECES)
        all[count++] = *pieces++;
    GLuint shader = glCreateShader(kind);
    glShaderSource(shader, count, all, NULL);
    glCompileShader(shader);
    glGetShaderiv(shader, GL_COMPILE_STATUS, &good);
    if (good)
        return shader;
    glGetShaderInfoLog(shader, sizeof log, NULL, log);
    glDeleteShader(shader);
    return fail(ctx, name, stage, log);
}

GLuint drape_gl_program(drape_context *ctx, const char *name, const char *const *vertex,
                        const char *const *fragment)
{
    char log[LOG_SIZE] = "";
    GLint good = 0;
    GLuint first = compile(ctx, name, "vertex", GL_VERTEX_SHADER, vertex);
    GLuint second = first ? compile(ctx, name, "fragment", GL_FRAGMENT_SHADER, fragment) : 0;
    if (!second) {
        glDeleteShader(first);
        return 0;
    }
    GLuint program = glCreateProgram();
    glAttachShader(program, first);
    glAttachShader(program, second);
    glLinkProgram(program);
    glDeleteShader(first);
    glDeleteShader(second);
    glGetProgramiv(program, GL_LINK_STATUS, &good);
    if (good)
        return program;
    glGetProgramInfoLog(program, sizeof log, NULL, log);
    glDeleteProgram(program);
    return fail(ctx, name, "linked", log);
}

void drape_gl_use(GLuint program, const drape_gl_unit *units, size_t count)
{
    glUseProgram(program);
    for (size_t i = 0; i < count; i++) {
        glActiveTexture(GL_TEXTURE0 + (GLenum)i);
        glBindTexture(GL_TEXTURE_2D, units[i].texture);
        glUniform1i(glGetUniformLocation(program, units[i].name), (int)i);
    }
    glActiveTexture(GL_TEXTURE0);
}

GLuint drape_gl_texture(GLenum format, int width, int height, GLenum pixels, GLenum kind, const void *data,
                        GLint filter, GLint wrap)
{
    GLuint name;
    glGenTextures(1, &name);
    glBindTexture(GL_TEXTURE_2D, name);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glTexImage2D(GL_TEXTURE_2D, 0, (GLint)format, width, height, 0, pixels, kind, data);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, filter);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, filter);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, wrap);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, wrap);
    return name;
}

GLuint drape_gl_framebuffer(void)
{
    GLuint name;
    glGenFramebuffers(1, &name);
    glBindFramebuffer(GL_FRAMEBUFFER, name);
    return name;
}

GLuint drape_gl_buffer(int samples, GLenum format, int width, int height, GLenum attachment)
{
    GLuint name;
    glGenRenderbuffers(1, &name);
    glBindRenderbuffer(GL_RENDERBUFFER, name);
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, format, width, height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, attachment, GL_RENDERBUFFER, name);
    return name;
}

void drape_gl_flip(uint8_t *pixels, int width, int height)
{
    const size_t row = 4 * (size_t)width;
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

void drape_gl_mesh_create(drape_gl_mesh *mesh, const int *sizes, bool per_instance)
{
    size_t offset = 0;
    *mesh = (drape_gl_mesh){.floats = 0};
    for (int i = 0; sizes[i]; i++)
        mesh->floats += sizes[i];
    glGenVertexArrays(1, &mesh->array);
    glGenBuffers(1, &mesh->vertices);
    glGenBuffers(1, &mesh->indices);
    glBindVertexArray(mesh->array);
    glBindBuffer(GL_ARRAY_BUFFER, mesh->vertices);
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, mesh->indices);
    for (GLuint i = 0; sizes[i]; i++) {
        glEnableVertexAttribArray(i);
        glVertexAttribPointer(i, sizes[i], GL_FLOAT, GL_FALSE, mesh->floats * (GLsizei)sizeof(float),
                              (const char *)NULL + offset * sizeof(float));
        glVertexAttribDivisor(i, per_instance ? 1 : 0);
        offset += (size_t)sizes[i];
    }
    glBindVertexArray(0);
}

void drape_gl_mesh_fill(drape_gl_mesh *mesh, const float *vertices, size_t vertex_count, bool often)
{
    glBindBuffer(GL_ARRAY_BUFFER, mesh->vertices);
    glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(vertex_count * (size_t)mesh->floats * sizeof *vertices),
                 vertices, often ? GL_STREAM_DRAW : GL_STATIC_DRAW);
}

void drape_gl_mesh_index(drape_gl_mesh *mesh, const uint32_t *indices, size_t count)
{
    glBindVertexArray(mesh->array);
    glBufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)(count * sizeof *indices), indices, GL_STATIC_DRAW);
    glBindVertexArray(0);
    mesh->index_count = (GLsizei)count;
}

void drape_gl_mesh_free(drape_gl_mesh *mesh)
{
    if (!mesh->array)
        return;
    glDeleteVertexArrays(1, &mesh->array);
    glDeleteBuffers(1, &mesh->vertices);
    glDeleteBuffers(1, &mesh->indices);
    *mesh = (drape_gl_mesh){.floats = 0};
}

void drape_gl_set_float(GLuint program, const char *name, float value)
{
    glUniform1f(glGetUniformLocation(program, name), value);
}

void drape_gl_set_vec2(GLuint program, const char *name, float x, float y)
{
    glUniform2f(glGetUniformLocation(program, name), x, y);
}

void drape_gl_set_vec3(GLuint program, const char *name, const float *value)
{
    glUniform3fv(glGetUniformLocation(program, name), 1, value);
}

void drape_gl_set_matrix(GLuint program, const char *name, const float *value)
{
    glUniformMatrix4fv(glGetUniformLocation(program, name), 1, GL_FALSE, value);
}

void drape_gl_set_matrix3(GLuint program, const char *name, const float *value)
{
    glUniformMatrix3fv(glGetUniformLocation(program, name), 1, GL_FALSE, value);
}

drape_status drape_gl_check(drape_context *ctx, const char *action)
{
    GLenum error = glGetError();
    if (error == GL_NO_ERROR)
        return DRAPE_OK;
    return drape_fail(ctx, error == GL_OUT_OF_MEMORY ? DRAPE_E_MEMORY : DRAPE_E_FILE,
                      "OpenGL cannot %s: error 0x%04x%s", action, (unsigned)error,
                      error == GL_OUT_OF_MEMORY ? ", out of memory" : "");
}

/* ---- The canvas ----
 *
 * Shaders convert to sRGB once per pixel. A framebuffer that did it would convert each sample, and back,
 * which takes a software renderer as long as everything else. */

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
