/* gl.h: OpenGL 3.3 core, through libepoxy: programs of shaders, buffers of vertices, the canvas of a
 * picture. */
#ifndef DRAPE_RENDER_GL_H
#define DRAPE_RENDER_GL_H

#include "base/context.h"

#include <epoxy/gl.h>

/* Compiles and links; each source is a NULL-ended list of pieces, and name is for the message. Returns 0 on
 * failure, with a message set. */
GLuint drape_gl_program(drape_context *ctx, const char *name, const char *const *vertex,
                        const char *const *fragment);

/* Textures that a program reads, by the names of their uniforms. */
typedef struct drape_gl_unit {
    const char *name;
    GLuint texture;
} drape_gl_unit;

void drape_gl_use(GLuint program, const drape_gl_unit *units, size_t count);

/* Makes a texture, which is bound. data, of these pixels of this kind: NULL: none yet. */
GLuint drape_gl_texture(GLenum format, int width, int height, GLenum pixels, GLenum kind, const void *data,
                        GLint filter, GLint wrap);

/* Makes a framebuffer, which is bound; and a buffer of the bound framebuffer. samples: 0: one a pixel. */
GLuint drape_gl_framebuffer(void);
GLuint drape_gl_buffer(int samples, GLenum format, int width, int height, GLenum attachment);

/* Reverses the rows of RGBA pixels, of which OpenGL has the lowest first. */
void drape_gl_flip(uint8_t *pixels, int width, int height);

/* Vertices with interleaved float attributes, and indices. */
typedef struct drape_gl_mesh {
    GLuint array, vertices, indices;
    int floats; /* per vertex */
    GLsizei index_count;
} drape_gl_mesh;

/* sizes: components of each attribute, 0-ended. per_instance: attributes advance by instance. often: the
 * buffer is filled for every picture. */
void drape_gl_mesh_create(drape_gl_mesh *mesh, const int *sizes, bool per_instance);
void drape_gl_mesh_fill(drape_gl_mesh *mesh, const float *vertices, size_t vertex_count, bool often);
void drape_gl_mesh_index(drape_gl_mesh *mesh, const uint32_t *indices, size_t count);
void drape_gl_mesh_free(drape_gl_mesh *mesh); /* may be empty */

/* Sets a uniform of the program in use by name; names that the program does not have are ignored. */
void drape_gl_set_float(GLuint program, const char *name, float value);
void drape_gl_set_vec2(GLuint program, const char *name, float x, float y);
void drape_gl_set_vec3(GLuint program, const char *name, const float *value);
void drape_gl_set_matrix(GLuint program, const char *name, const float *value);
void drape_gl_set_matrix3(GLuint program, const char *name, const float *value);

/* DRAPE_OK; or DRAPE_E_FILE or DRAPE_E_MEMORY with the message "OpenGL cannot <action>". */
drape_status drape_gl_check(drape_context *ctx, const char *action);

/* ---- The framebuffer that pictures are drawn into, in sRGB with 4 samples per pixel ---- */

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
