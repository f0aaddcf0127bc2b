/*
 * support.h: nodes that pins hold in one or two directions only, as on rollers, rails and symmetry planes.
 * They remain free nodes: what acts along these directions is taken out of forces and, on both sides, of
 * matrices, g' = P g,   J' = P J P + s (I - P),   P = I - sum n n', with s > 0 the largest entry of the
 * node's diagonal block. From a state that moves across the directions, M v' + g' = 0 keeps every method
 * there: M is a multiple of I at each node. Displacements solve the equation in which the coordinates along
 * n are eliminated, whatever s is, and the sparsity stays. All of this also projects onto what periodic edges
 * allow (model/periodic.h): a node and its images have the same directions.
 */
#ifndef DRAPE_MODEL_SUPPORT_H
#define DRAPE_MODEL_SUPPORT_H

#include "model/motion.h"

/* The support of a node; NULL: it has none. */
const drape_support *drape_support_of(const drape_model *model, int32_t node);

/* Pins with a track displace what they hold: a node by u(t) along the directions that are held, by nothing
 * along the others. Integrators compute in the frame that moves with u (drape_system_to_frame), where
 * supports rest. */

/* x += sign u(t) (node_count x 3). */
void drape_supports_displace(const drape_motion *motion, double t, double sign, double *x);

/* v += u' (node_count x 3): the mean over the span or, if instant, that in its middle; 0 if its ends are
 * equal. A track of the model has no kink within the span of an instant. */
void drape_supports_add_velocity(const drape_motion *motion, const double span[2], bool instant, double *v);

/* The work of forces g (node_count x 3) while supports go from u(t0) to u(t1) [J], and their power at a time
 * t within a piece of all tracks [W]. */
double drape_supports_work(const drape_motion *motion, const double *g, double t0, double t1);
double drape_supports_power(const drape_motion *motion, const double *g, double t);

/* The kinetic energy along the directions that moving supports hold, which only they change [J]. */
double drape_supports_kinetic(const drape_motion *motion, const double *v);

/* Removes the components along held directions from vectors at all nodes (node_count x 3), or at the free
 * nodes (free_count x 3). Where a host has placed the cloth elsewhere, these directions turn with it. */
void drape_supports_project(const drape_motion *motion, double *nodes);
void drape_supports_project_free(const drape_motion *motion, double *free_nodes);

/* Removes the components along held directions from velocities v (node_count x 3) that no step has left
 * there; `before` is the motion, and v0 are the velocities, up to now. Where the same directions were held
 * before, moving supports keep their velocities, and supports at rest the component that v0 has. */
void drape_supports_stop(const drape_motion *motion, const drape_motion *before, const double *v0, double *v);

/* values: of a matrix over the free nodes. */
void drape_supports_project_matrix(const drape_motion *motion, const drape_pattern *pattern, double *values);

/* Reduces g (node_count x 3) to the forces of the supports and those by which periodic edges hold each other:
 * 0 where a node is free in all directions. Pinned nodes keep g. */
void drape_supports_keep_reactions(const drape_motion *motion, double *g);

/* Makes the displacement from x0 to x along these directions that of the supports from t0 to t1: takes out
 * what rounding and methods that move nodes leave. */
void drape_supports_hold(const drape_motion *motion, double t0, const double *x0, double t1, double *x);

/* Makes the velocity along them u' of the span, as above. */
void drape_supports_hold_velocity(const drape_motion *motion, const double span[2], bool instant, double *v);

#endif
