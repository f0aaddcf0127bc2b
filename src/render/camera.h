/* camera.h: an eye that orbits a point. Angles in degrees: azimuth about the vertical, 0 looks along -z, positive
 * moves the eye to +x; elevation above the horizon. */
#ifndef DRAPE_RENDER_CAMERA_H
#define DRAPE_RENDER_CAMERA_H

#include "render/matrix.h"

#include <stdbool.h>
#include <stddef.h>

#define DRAPE_CAMERA_AZIMUTH   32.0f
#define DRAPE_CAMERA_ELEVATION 24.0f

typedef struct drape_camera {
    float azimuth, elevation; /* [degrees] */
    float target[3];          /* what it looks at [m] */
    float distance;           /* of the eye from it [m] */
} drape_camera;

typedef struct drape_view {
    drape_matrix matrix;      /* from space to the picture */
    float eye[3], axes[3][3]; /* right, up, back */
    float tx, ty;             /* tangents of half of the angles of view */
    float center[2];          /* of the lens in the picture, whose sides are at -1 and 1 */
} drape_view;

/* Points that are to be seen, as they come: the extremes along the four sides of the view. */
typedef struct drape_framing {
    float axes[3][3], tx, ty;
    float side[4]; /* largest of z + x/tx, z - x/tx, z + y/ty, z - y/ty, in the eye's axes */
    float near;    /* largest z */
    bool any;
} drape_framing;

/* aspect: width over height. */
drape_framing drape_framing_begin(float azimuth, float elevation, float aspect);
void drape_framing_add(drape_framing *framing, const float *points, size_t count, const float *offset);

/* The nearest camera that has all of them in the picture, with a margin; zoom > 1 goes nearer. */
drape_camera drape_framing_end(const drape_framing *framing, float azimuth, float elevation, float zoom);

/* radius: of what is to be seen around the target, for near and far. */
drape_view drape_camera_view(const drape_camera *camera, float aspect, float radius);

/* Makes it the view of a larger picture, of which it is the part from low to high, in that one's sides -1 and 1. */
void drape_view_widen(drape_view *view, const float low[2], const float high[2]);

#endif
