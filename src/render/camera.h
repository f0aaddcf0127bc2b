/* camera.h: an eye that orbits a point. Angles in degrees: the azimuth turns about the vertical, 0 looks
 * along -z, and positive values move the eye towards +x; the elevation is above the horizon. */
#ifndef DRAPE_RENDER_CAMERA_H
#define DRAPE_RENDER_CAMERA_H

#include "render/matrix.h"

#include <stdbool.h>
#include <stddef.h>

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
