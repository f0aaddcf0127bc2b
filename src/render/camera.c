/* camera.c: see camera.h. */
#include "render/camera.h"

#include <string.h>

#define HALF_ANGLE    0.26f /* tangent of half the smaller angle of view, 29 degrees, as of a portrait lens */
#define MARGIN        1.12f
#define RADIANS       0.017453292519943295f
#define MAX_ELEVATION 89.9f

static void set_axes(float azimuth, float elevation, float axes[3][3])
{
    float a = azimuth * RADIANS, e = fminf(fmaxf(elevation, -MAX_ELEVATION), MAX_ELEVATION) * RADIANS;
    const float back[3] = {cosf(e) * sinf(a), sinf(e), cosf(e) * cosf(a)}, up[3] = {0, 1, 0};
    memcpy(axes[2], back, sizeof back);
    drape_cross(up, back, axes[0]);
    drape_normalize(axes[0]);
    drape_cross(axes[2], axes[0], axes[1]);
}

static void set_angles(float aspect, float *tx, float *ty)
{
    *ty = aspect < 1 ? HALF_ANGLE / aspect : HALF_ANGLE;
    *tx = *ty * aspect;
}

drape_framing drape_framing_begin(float azimuth, float elevation, float aspect)
{
    drape_framing f = {.any = false};
    set_axes(azimuth, elevation, f.axes);
    set_angles(aspect, &f.tx, &f.ty);
    f.tx /= MARGIN;
    f.ty /= MARGIN;
    return f;
}

void drape_framing_add(drape_framing *f, const float *points, size_t count, const float *offset)
{
    for (size_t i = 0; i < count; i++) {
        const float *p = points + 3 * i;
        const float q[3] = {p[0] + offset[0], p[1] + offset[1], p[2] + offset[2]};
        float x = drape_dot(q, f->axes[0]), y = drape_dot(q, f->axes[1]), z = drape_dot(q, f->axes[2]);
        const float side[4] = {z + x / f->tx, z - x / f->tx, z + y / f->ty, z - y / f->ty};
        for (int k = 0; k < 4; k++)
            f->side[k] = f->any ? fmaxf(f->side[k], side[k]) : side[k];
        f->near = f->any ? fmaxf(f->near, z) : z;
        f->any = true;
    }
}

/* With the eye at (x, y, z), a point p is inside the right side if z - z_p >= (p_x - x) / tx, and so on. */
drape_camera drape_framing_end(const drape_framing *f, float azimuth, float elevation, float zoom)
{
    drape_camera camera = {.azimuth = azimuth, .elevation = elevation, .distance = 1};
    if (!f->any)
        return camera;
    float across = (f->side[0] + f->side[1]) / 2, upright = (f->side[2] + f->side[3]) / 2;
    float x = (f->side[0] - f->side[1]) / 2 * f->tx, y = (f->side[2] - f->side[3]) / 2 * f->ty;
    float eye = fmaxf(across, upright);
    float size = fmaxf(eye - f->near, 1e-6f);
    /* the target lies behind the nearest point by about half the size of the view */
    float target = f->near - 0.5f * size * f->ty;
    camera.distance = fmaxf((eye - target) / zoom, 1e-6f);
    for (int k = 0; k < 3; k++)
        camera.target[k] = x * f->axes[0][k] + y * f->axes[1][k] + target * f->axes[2][k];
    return camera;
}

float drape_framing_distance(const drape_framing *f)
{
    return fmaxf(fmaxf(f->side[0], f->side[1]), fmaxf(f->side[2], f->side[3]));
}

drape_view drape_camera_view(const drape_camera *camera, float aspect, float radius)
{
    drape_view view = {.center = {0, 0}};
    set_axes(camera->azimuth, camera->elevation, view.axes);
    set_angles(aspect, &view.tx, &view.ty);
    for (int k = 0; k < 3; k++)
        view.eye[k] = camera->target[k] + camera->distance * view.axes[2][k];
    float far = camera->distance + 20 * radius,
          near = fmaxf(0.02f * camera->distance, camera->distance - 4 * radius);
    drape_matrix look = drape_look((const float(*)[3])view.axes, view.eye);
    drape_matrix lens = drape_perspective(view.tx, view.ty, near, far);
    view.matrix = drape_multiply(&lens, &look);
    return view;
}

void drape_view_widen(drape_view *view, const float low[2], const float high[2])
{
    for (int k = 0; k < 2; k++) {
        float center = (high[k] + low[k]) / 2, share = (high[k] - low[k]) / 2;
        for (int c = 0; c < 4; c++)
            view->matrix.m[4 * c + k] =
                share * view->matrix.m[4 * c + k] + center * view->matrix.m[4 * c + 3];
        view->center[k] = center;
        *(k ? &view->ty : &view->tx) /= share;
    }
}
