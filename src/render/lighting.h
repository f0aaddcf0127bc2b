/*
 * lighting.h: how much of the light of the lamp and of the room reaches what is seen. The lamp has a size,
 * so its shadow is sharp where cloth touches and softens with the distance between both (percentage-closer
 * soft shadows: Fernando 2005); the room's light is held off by what is near (ambient occlusion from the
 * depths that the camera sees: McGuire, Mara & Luebke 2012). Both are found at a part of the picture's
 * resolution from few samples that differ in each square of 4 x 4 pixels, and averaged over such squares.
 */
#ifndef DRAPE_RENDER_LIGHTING_H
#define DRAPE_RENDER_LIGHTING_H

#include "render/camera.h"
#include "render/gl.h"

typedef struct drape_lighting {
    int width, height;                 /* of its buffers [pixels] */
    GLuint shadow, shadow_buffer;      /* depths seen from the lamp */
    GLuint place, normal, depth, seen; /* what the camera sees: point and distance, normal; framebuffer */
    GLuint raw, raw_buffer;            /* lamp, room, distance */
    GLuint result, result_buffer;      /* the same, averaged */
    GLuint find, average, empty;       /* programs; vertex array without attributes */
} drape_lighting;

/* The light and the view in a panel. */
typedef struct drape_lighting_view {
    drape_matrix lamp;                           /* from space to the shadow map */
    float right[3], up[3], light[3];             /* axes of the lamp; light is the direction to it */
    float width, range;                          /* of the shadow map and of its depths [m] */
    float radius;                                /* of the stage [m] */
    float scale;                                 /* pixels of the picture per tangent of an angle of view */
    int left, bottom, panel_width, panel_height; /* of the panel in the picture [pixels] */
} drape_lighting_view;

/* The fragment shader that fills `seen`, and that of the surface shaders: `vec2 lighting(vec3 place)`, the
 * visible parts of lamp and room, from the uniforms `visible` and `eye`. */
extern const char drape_lighting_seen_source[], drape_lighting_lookup_source[];

/* width, height: of the picture. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_lighting_create(drape_context *ctx, int width, int height, drape_lighting *v);
void drape_lighting_free(drape_lighting *v); /* may be empty */

/* Directs drawing to the shadow map, and then to what the camera sees in a panel; `clear` for the first panel
 * of a picture. */
void drape_lighting_begin_shadow(const drape_lighting *v);
void drape_lighting_begin_seen(const drape_lighting *v, const drape_lighting_view *view);

/* Computes the result for a panel from both. */
void drape_lighting_find(const drape_lighting *v, const drape_lighting_view *view);

#endif
