/* reel.h: the frames of a run that will be drawn, as they come from a sim or from the folder of a run: of the
 * surface that frames show, which is a render mesh where a cloth has one. */
#ifndef DRAPE_RENDER_REEL_H
#define DRAPE_RENDER_REEL_H

#include "base/arena.h"
#include "fields/fields.h"

typedef struct drape_reel {
    drape_arena arena;
    const drape_model *model;
    size_t nodes, count, capacity; /* nodes: of the surface */
    bool with_values;
    double *times;                          /* (count) [s] */
    float *positions;                       /* (count x nodes x 3) [m] */
    float *values;                          /* (count x nodes) */
    double *scratch;                        /* (node_count of the model) */
    double *normals, *shown, *shown_values; /* (node_count x 3), (nodes x 3), (nodes); NULL: the surface is
                                               that of the model */
    double low, high;                       /* range of all values */
} drape_reel;

/* with_values: whether frames have values of a field. Errors: DRAPE_E_MEMORY. */
drape_status drape_reel_create(drape_context *ctx, const drape_model *model, bool with_values,
                               drape_reel *reel);
void drape_reel_free(drape_reel *reel); /* may be empty */
void drape_reel_clear(drape_reel *reel);

/* Adds a frame with the nodes of the model at x, and the values of a field in the state of sim unless field
 * is NULL. Errors: those of the field, DRAPE_E_MEMORY. */
drape_status drape_reel_add(drape_reel *reel, double t, const double *x, drape_sim *sim,
                            const drape_field_ops *field);

const float *drape_reel_positions(const drape_reel *reel, size_t frame);
const float *drape_reel_values(const drape_reel *reel, size_t frame); /* NULL without a field */

/* The last frame at or before t, up to rounding; the first if there is none. */
size_t drape_reel_at(const drape_reel *reel, double t);

#endif
