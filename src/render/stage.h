/* stage.h: a model as it is drawn: its cloth, its colliders, the floor. What is drawn of a moment is given each
 * time. */
#ifndef DRAPE_RENDER_STAGE_H
#define DRAPE_RENDER_STAGE_H

#include "render/body.h"
#include "render/camera.h"
#include "render/gl.h"
#include "render/skin.h"

/* A moment of a run. */
typedef struct drape_moment {
    double t;               /* [s] */
    const float *positions; /* (node_count x 3) [m] */
    const float *values;    /* (node_count) of a field; NULL: none */
} drape_moment;

typedef struct drape_stage_body {
    drape_body shape;
    drape_gl_mesh mesh;
    float offset[3]; /* [m] where it is now */
} drape_stage_body;

typedef struct drape_stage {
    drape_context *ctx;
    const drape_model *model;
    drape_skin skin;
    drape_gl_mesh cloth, wires, pins;
    drape_stage_body *bodies; /* (body_count): the model's colliders */
    int32_t body_count;
    size_t wire_count, pin_count;
    float *pin;              /* (pinned nodes x 3) */
    float center[3], radius; /* [m] of what was framed: cloth over all moments, colliders that end */
    float floor;             /* height that shadows fall to [m] */
    bool has_ground;         /* an endless collider takes the shadows */
    float low[3], high[3];   /* box of what was seen so far */
} drape_stage;

/* Errors: DRAPE_E_MEMORY. An OpenGL context is current. */
drape_status drape_stage_create(drape_context *ctx, const drape_model *model, drape_stage *stage);
void drape_stage_free(drape_stage *stage); /* an empty one is fine; so is one whose model is gone */

/* These positions will be in the picture. After the last of them drape_stage_settle finds where shadows fall. */
void drape_stage_see(drape_stage *stage, const float *positions);
void drape_stage_settle(drape_stage *stage);

/* Adds what is drawn at a time, but for endless colliders, to what the camera is to see. */
void drape_stage_frame(drape_stage *stage, drape_framing *framing, double t, const float *positions);

/* Puts cloth and colliders where they are. */
void drape_stage_set(drape_stage *stage, const drape_moment *moment, bool wires);

#endif
