/*
 * deviation.h: how far apart two motions of the same cloths are. At a frame, of each cloth,
 *     rms = sqrt(1/n sum_i |x_i - y_i|^2)
 * over all its n nodes, pinned ones too, and the node that is furthest, with its distance. Of all frames the
 * largest rms, as a share of the diagonal of the cloth's box at rest, is the measure of accuracy; beside it
 * stands the largest distance of a node, with the node, the place and the time.
 *
 * A cloth with the same triangles in both models is compared node by node. Otherwise material points are
 * compared: the nodes of the model that has fewer, each bound to the triangle of the other that is nearest at
 * rest, so that none are apart there (geometry/embed.h).
 */
#ifndef DRAPE_GEOMETRY_DEVIATION_H
#define DRAPE_GEOMETRY_DEVIATION_H

#include "model/model.h"

/* How far apart one cloth is. Times and frames are those that were added, frames counted from 0. */
typedef struct drape_apart {
    double rms, rms_time; /* [m], [s] */
    int64_t rms_frame;
    double distance, time; /* of the furthest node [m], [s] */
    int32_t node;          /* its number in the model of the compared nodes, through all cloths */
    double place[2][3];    /* [m] where it is in the first motion and in the second */
} drape_apart;

typedef struct drape_deviation_cloth {
    double diagonal;     /* [m] of its box at rest, in the model of the compared nodes */
    drape_apart now;     /* at the frame that was measured last */
    drape_apart largest; /* of the frames that were added: the largest rms, and the largest distance */
} drape_deviation_cloth;

typedef struct drape_deviation {
    const drape_model *model[2];
    int of;                        /* whose nodes are compared: 1 if the second model has fewer, else 0 */
    bool material;                 /* some cloth has other triangles, and material points are compared */
    drape_embedded *counterparts;  /* (nodes of model[of]) where they are in the other model */
    double gap;                    /* [m] how far apart the meshes are at rest */
    double *distance;              /* (as many) [m] at the frame that was measured last */
    drape_deviation_cloth *cloths; /* (cloth_count of both) in the order of the scene */
    int64_t frames;                /* added so far */
} drape_deviation;

/* Prepares the comparison of motions of two models, which may be the same one and must outlive it. The memory
 * is of the arena; later calls take none. Errors: DRAPE_E_MEMORY; DRAPE_E_ARGUMENT: they are not of the same
 * cloths: their number or names differ, or the meshes of one are further apart at rest than the mean edge of
 * the one that has fewer nodes. */
drape_status drape_deviation_create(drape_arena *arena, const drape_model *first, const drape_model *second,
                                    drape_deviation *out);

/* Forgets the frames that were added. */
void drape_deviation_restart(drape_deviation *deviation);

/* Measures a frame of both motions at the time t, positions x and y of the nodes of the first and of the
 * second model (finite): sets `now` of the cloths, and the distances. */
void drape_deviation_measure(drape_deviation *deviation, double t, const double *x, const double *y);

/* The same, and adds the frame to `largest`. */
void drape_deviation_add(drape_deviation *deviation, double t, const double *x, const double *y);

/* The cloth whose largest rms is the largest share of its diagonal. At least one frame has been added. */
int32_t drape_deviation_worst(const drape_deviation *deviation);

#endif
