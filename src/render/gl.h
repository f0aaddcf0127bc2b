/* gl.h: OpenGL 3.3 core, through libepoxy: programs of shaders, buffers of vertices. */
#ifndef DRAPE_RENDER_GL_H
#define DRAPE_RENDER_GL_H

#include "base/context.h"

#include <epoxy/gl.h>

/* The largest attribute list of a mesh. */
#define DRAPE_GL_ATTRIBUTES 6

/* Compiles and links; each source is a NULL-ended list of pieces. name: for the message. 0 on failure, with
 * DRAPE_E_FILE's message set. */
GLuint drape_gl_program(drape_context *ctx, const char *name, const char *const *vertex,
                        const char *const *fragment);

/* Vertices with float attributes one after another, and indices. */
typedef struct drape_gl_mesh {
    GLuint array, vertices, indices;
    int floats; /* of a vertex */
    GLsizei index_count;
} drape_gl_mesh;

/* sizes: components of each attribute, 0-ended. per_instance: attributes advance by instance. */
void drape_gl_mesh_create(drape_gl_mesh *mesh, const int *sizes, bool per_instance);
void drape_gl_mesh_fill(drape_gl_mesh *mesh, const float *vertices, size_t vertex_count, bool often);
void drape_gl_mesh_index(drape_gl_mesh *mesh, const uint32_t *indices, size_t count);
void drape_gl_mesh_free(drape_gl_mesh *mesh); /* an empty one is fine */

/* Uniforms of the program in use, by name; names that it does not have are ignored. */
void drape_gl_set_int(GLuint program, const char *name, int value);
void drape_gl_set_float(GLuint program, const char *name, float value);
void drape_gl_set_vec2(GLuint program, const char *name, float x, float y);
void drape_gl_set_vec3(GLuint program, const char *name, const float *value);
void drape_gl_set_matrix(GLuint program, const char *name, const float *value);

/* DRAPE_OK, or DRAPE_E_FILE with a message that says what failed. */
drape_status drape_gl_check(drape_context *ctx, const char *deed);

#endif
