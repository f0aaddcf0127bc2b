/* camera.h: an eye that orbits a point. Angles in degrees: the azimuth turns about the vertical, 0 looks
 * along -z, and positive values move the eye towards +x; the elevation is above the horizon. */
#ifndef DRAPE_RENDER_CAMERA_H
#define DRAPE_RENDER_CAMERA_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

/* ---- Linear algebra: vectors of three floats, and 4 x 4 matrices by columns, as OpenGL takes them ---- */

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

/* ---- The eye ---- */

#define DRAPE_CAMERA_AZIMUTH   32.0f
#define DRAPE_CAMERA_ELEVATION 24.0f

typedef struct drape_camera {
    float azimuth, elevation; /* [degrees] */
    float target[3];          /* point that it looks at [m] */
    float distance;           /* from the eye to the target [m] */
} drape_camera;

typedef struct drape_view {
    drape_matrix matrix;      /* from space to the picture */
    float eye[3], axes[3][3]; /* right, up, back */
    float tx, ty;             /* tangents of half the angles of view */
    float center[2];          /* of projection in the picture, whose sides are at -1 and 1 */
} drape_view;

/* Collects points that have to be in the picture: their extremes along the four sides of the view. */
typedef struct drape_framing {
    float axes[3][3], tx, ty;
    float side[4]; /* largest of z + x/tx, z - x/tx, z + y/ty, z - y/ty, in the eye's axes */
    float near;    /* largest z */
    bool any;
} drape_framing;

/* aspect: width over height. */
drape_framing drape_framing_begin(float azimuth, float elevation, float aspect);
void drape_framing_add(drape_framing *framing, const float *points, size_t count, const float *offset);

/* The nearest camera that shows all points, with a margin; zoom > 1 goes nearer. */
drape_camera drape_framing_end(const drape_framing *framing, float azimuth, float elevation, float zoom);

/* The distance at which a camera that looks at the origin shows all points [m]: for one that turns about
 * it. */
float drape_framing_distance(const drape_framing *framing);

/* radius: of the scene around the target, for the near and far planes. */
drape_view drape_camera_view(const drape_camera *camera, float aspect, float radius);

/* Makes it the view of a larger picture that contains the former one from low to high, where the sides of the
 * larger one are at -1 and 1. */
void drape_view_widen(drape_view *view, const float low[2], const float high[2]);

#endif
