/*
 * support.h: nodes that pins hold in one or two directions only, as on rollers, rails and symmetry planes.
 * They remain free nodes: what acts along these directions is taken out of forces and, on both sides, of
 * matrices, g' = P g,   J' = P J P + s (I - P),   P = I - sum n n', with s > 0 the largest entry of the
 * node's diagonal block. From a state that moves across the directions, M v' + g' = 0 keeps every method
 * there: M is a multiple of I at each node. Displacements solve the equation in which the coordinates along
 * n are eliminated, whatever s is, and the sparsity stays.
 */
#ifndef DRAPE_MODEL_SUPPORT_H
#define DRAPE_MODEL_SUPPORT_H

#include "model/motion.h"

/* Takes what lies along the directions that are held out of vectors at all nodes (node_count x 3), or at
 * the free nodes (free_count x 3). Placed cloth has its directions turned with it. */
void drape_supports_project(const drape_motion *motion, double *nodes);
void drape_supports_project_free(const drape_motion *motion, double *free_nodes);

/* values: of a matrix over the free nodes. */
void drape_supports_project_matrix(const drape_motion *motion, const drape_pattern *pattern, double *values);

/* The forces of the supports: g (node_count x 3) without it, and 0 where a node is free in all directions;
 * pinned nodes are unchanged. */
void drape_supports_keep_reactions(const drape_motion *motion, double *g);

/* Takes the displacement from x0 to x along these directions, which rounding and methods that move nodes
 * leave, out of x, and the velocity along them out of v. */
void drape_supports_hold(const drape_motion *motion, const double *x0, double *x, double *v);

#endif
