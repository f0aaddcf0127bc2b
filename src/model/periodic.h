/*
 * periodic.h: periodic edges, whose nodes are images of each other: the same node, displaced by a constant
 * period. All images stay nodes with unknowns of their own. They have equal masses, so that with P, the
 * mean over the images of each node, M v' + P g = 0 moves them alike, with the sum of their forces and of
 * their masses, and
 *     J' = P J P + s (I - P),   s > 0 the largest entry of the diagonal blocks,
 * maps what lies in the range of P as the matrix with one node in place of all does, as in the projection of
 * supports (support.h). Its sparsity is closed under exchange of images. Without periodic edges all
 * functions do nothing; they leave out pinned nodes.
 */
#ifndef DRAPE_MODEL_PERIODIC_H
#define DRAPE_MODEL_PERIODIC_H

#include "model/model.h"

static inline bool drape_periodic_has(const drape_model *model, int32_t node)
{
    return model->image_set && model->image_set[node] >= 0;
}

/* Replaces the vectors of images by their mean: at all nodes (node_count x 3), or at the free nodes
 * (free_count x 3). */
void drape_periodic_project(const drape_model *model, double *nodes);
void drape_periodic_project_free(const drape_model *model, double *free_nodes);

/* values: of a matrix over the free nodes. */
void drape_periodic_project_matrix(const drape_model *model, const drape_pattern *pattern, double *values);

/* Makes the displacements from x0 to x of images the same: takes out what rounding and methods that move
 * nodes leave. */
void drape_periodic_hold(const drape_model *model, const double *x0, double *x);

/* Replaces the values of images (node_count) by their least; by their mean, also at pinned nodes. */
void drape_periodic_least(const drape_model *model, double *of_node);
void drape_periodic_share(const drape_model *model, double *of_node);

#endif
