/* stage.h: a model as it is drawn: its cloth, its colliders and the floor. Positions and values are set for
 * each picture. */
#ifndef DRAPE_RENDER_STAGE_H
#define DRAPE_RENDER_STAGE_H

#include "colliders/body.h"
#include "colliders/deformed.h"
#include "render/camera.h"
#include "render/gl.h"
#include "render/skin.h"

/* The state of a run at one time. */
typedef struct drape_moment {
    double t;               /* [s] */
    const float *positions; /* (nodes of the surface that frames show x 3) [m] */
    const float *values;    /* (as many) of the field shown; NULL: none */
} drape_moment;

typedef struct drape_stage_body {
    drape_body shape;
    drape_gl_mesh mesh;
    drape_deformed *deformed; /* of a collider that deforms, as it is now; NULL: rigid */
    double *points;           /* (its points x 3) workspace */
    float turn[9];            /* its rotation now, column by column, as in OpenGL */
    float offset[3];          /* [m] and its displacement after that */
} drape_stage_body;

typedef struct drape_stage {
    drape_arena arena; /* holds skin, bodies and pins */
    const drape_model *model;
    drape_skin skin;
    drape_gl_mesh cloth, hem, wires, pins;
    drape_stage_body *bodies;        /* (body_count) the model's colliders */
    const drape_collider **collider; /* (body_count) where distances from them are measured now */
    int32_t body_count;
    size_t wire_count, pin_count;
    uint8_t *pinned;         /* (nodes of the surface) */
    float *pin;              /* (pinned nodes x 3) */
    float center[3], radius; /* [m] of the box of the cloth at all times and of the bounded colliders */
    float floor;             /* height of the floor that receives shadows [m] */
    bool has_ground;         /* an endless collider receives the shadows instead */
    float low[3], high[3];   /* that box [m], extended by drape_stage_add and drape_stage_finish */
} drape_stage;

/* Errors: DRAPE_E_MEMORY. An OpenGL context has to be current. */
drape_status drape_stage_create(drape_context *ctx, const drape_model *model, drape_stage *stage);
void drape_stage_free(drape_stage *stage); /* may be empty; the model may be gone */

/* Extends the box by positions that will be drawn. After the last of them drape_stage_finish adds the
 * colliders and places the floor. */
void drape_stage_add(drape_stage *stage, const float *positions);
void drape_stage_finish(drape_stage *stage);

/* Adds the cloth and the bounded colliders at a time, moved by `offset` (3) [m], to what the camera has to
 * show. */
void drape_stage_frame(drape_stage *stage, drape_framing *framing, double t, const float *positions,
                       const float *offset);

/* Sets cloth and colliders to a moment. wires: with its edges and pins, instead of the hem. */
void drape_stage_set(drape_stage *stage, const drape_moment *moment, bool wires);

#endif
