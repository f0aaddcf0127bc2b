/*
 * verlet.h: what the stages of an explicit substep share. Each stage after the forces moves nodes: x is
 * where the step has them so far, x0 where they were when the substep began. Pinned nodes are moved by none.
 */
#ifndef DRAPE_INTEGRATORS_VERLET_H
#define DRAPE_INTEGRATORS_VERLET_H

#include "integrators/integrator.h"

/* ---- Forces: verlet_force.c ---- */

typedef struct drape_verlet_force drape_verlet_force;

drape_status drape_verlet_force_create(drape_context *ctx, drape_system *system, drape_verlet_force **out);
void drape_verlet_force_destroy(drape_verlet_force **force);
size_t drape_verlet_force_bytes(const drape_verlet_force *force);

/* The same as drape_system_force, up to rounding. */
void drape_verlet_force_sum(drape_verlet_force *force, const drape_point *point, double *g);

/* ---- Colliders: verlet_contact.c ---- */

enum { DRAPE_VERLET_CS184, DRAPE_VERLET_BOSON };

typedef struct drape_verlet_contact {
    const drape_model *model;
    const drape_motion *motion; /* of its colliders */
    int rule;
    double offset;         /* [m] CS184: how far outside of a flat surface a node is put */
    double friction_range; /* [m] Boson: friction acts up to this far from a surface */
    double friction_drag;  /* [N s/m] Boson: drag of what rubs */
} drape_verlet_contact;

/* Moves the nodes that are inside of a collider at time t; it was elsewhere at t0. */
void drape_verlet_project(const drape_verlet_contact *contact, double t0, double t, const double *x0,
                          double *x);

/* Changes g, the force with its sign turned, of nodes that rub at time t. Nothing under the rule of CS184. */
void drape_verlet_rub(const drape_verlet_contact *contact, double t, const double *x, const double *v,
                      double *g);

/* ---- The limit of strains: verlet_limit.c ---- */

typedef struct drape_verlet_patch drape_verlet_patch;

typedef struct drape_verlet_limit {
    int32_t count;
    int32_t *node;   /* (count x 2) */
    double *longest; /* (count) [m] */
    double *square;  /* (count) [m2] of the longest, as patches look at them */
    int32_t patch_count;
    drape_verlet_patch *patch;
    int32_t node_count;
    double *x;             /* planes (3 x node_count) */
    const uint8_t *pinned; /* of the model */
    int passes;            /* at most */
    double slack;          /* a length over the longest that is near enough, -1 */
} drape_verlet_limit;

/* All springs: the elements of two nodes of every term that measures a strain. */
drape_status drape_verlet_limit_create(drape_context *ctx, const drape_model *model, double limit, int passes,
                                       double tolerance, drape_verlet_limit *out);
void drape_verlet_limit_free(drape_context *ctx, drape_verlet_limit *limit);
size_t drape_verlet_limit_bytes(const drape_verlet_limit *limit);
void drape_verlet_limit_lengths(const drape_verlet_limit *limit, double *x);

/* ---- Cloth against cloth: verlet_self.c ---- */

typedef struct drape_verlet_self drape_verlet_self;

/* share: of a correction that one substep makes. same_box: points are looked for in a point's own box alone,
 * as in CS184. */
drape_status drape_verlet_self_create(drape_context *ctx, const drape_model *model, bool same_box,
                                      drape_verlet_self **out);
void drape_verlet_self_destroy(drape_verlet_self **self);
size_t drape_verlet_self_bytes(const drape_verlet_self *self);
void drape_verlet_self_push(drape_verlet_self *self, double share, double *x);

#endif
