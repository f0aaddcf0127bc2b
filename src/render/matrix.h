/* matrix.h: linear algebra for the camera: vectors of three floats, and 4 x 4 matrices by columns, as OpenGL
 * takes them. */
#ifndef DRAPE_RENDER_MATRIX_H
#define DRAPE_RENDER_MATRIX_H

#include <math.h>
#include <string.h>

typedef struct drape_matrix {
    float m[16]; /* m[4 column + row] */
} drape_matrix;

static inline float drape_dot(const float *a, const float *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void drape_cross(const float *a, const float *b, float *out)
{
    float x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    out[0] = x;
    out[1] = y;
    out[2] = z;
}

/* A zero vector stays zero. */
static inline void drape_normalize(float *a)
{
    float length = sqrtf(drape_dot(a, a)), scale = length > 0 ? 1 / length : 0;
    for (int k = 0; k < 3; k++)
        a[k] *= scale;
}

static inline drape_matrix drape_multiply(const drape_matrix *a, const drape_matrix *b)
{
    drape_matrix out;
    for (int c = 0; c < 4; c++)
        for (int r = 0; r < 4; r++) {
            float sum = 0;
            for (int k = 0; k < 4; k++)
                sum += a->m[4 * k + r] * b->m[4 * c + k];
            out.m[4 * c + r] = sum;
        }
    return out;
}

/* From space to the coordinates of an eye: axes are right, up and back (3 x 3, each of length 1). */
static inline drape_matrix drape_look(const float axes[3][3], const float *eye)
{
    drape_matrix out = {{0}};
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++)
            out.m[4 * c + r] = axes[r][c];
        out.m[12 + r] = -drape_dot(axes[r], eye);
    }
    out.m[15] = 1;
    return out;
}

/* tx, ty: tangents of half the angles of view. */
static inline drape_matrix drape_perspective(float tx, float ty, float near, float far)
{
    drape_matrix out = {{0}};
    out.m[0] = 1 / tx;
    out.m[5] = 1 / ty;
    out.m[10] = -(far + near) / (far - near);
    out.m[11] = -1;
    out.m[14] = -2 * far * near / (far - near);
    return out;
}

static inline drape_matrix drape_orthographic(float half, float near, float far)
{
    drape_matrix out = {{0}};
    out.m[0] = out.m[5] = 1 / half;
    out.m[10] = -2 / (far - near);
    out.m[14] = -(far + near) / (far - near);
    out.m[15] = 1;
    return out;
}

#endif
