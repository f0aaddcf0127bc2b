/*
 * verlet.h: the parts of the explicit integrator, and the rules of the two explicit cloth systems that it
 * reproduces:
 *     CS184  the cloth simulator "clothsim" of CS184, UC Berkeley: point masses, springs, Verlet steps
 *     Boson  a sheet of 100 x 100 springs, of which examples/scenes/verlet_100.json has all constants
 * A substep applies them in this order, that of CS184 (verlet.c):
 *
 *     forces      springs, weight and drag; Boson: friction changes the force of nodes near a
 *                 surface                                                     verlet_force.c,
 *                 drape_verlet_friction
 *     step        x' = x + c (x - x_before) + h^2 a, c = 1 - damping/100      verlet.c, form "position"
 *     self        CS184: points nearer than 2 thickness are pushed apart      drape_verlet_self_push
 *     colliders   CS184, Boson: nodes inside of one are put on its surface    drape_verlet_project
 *     strain      CS184, Provot 1995: springs longer than (1 + limit) times
 *                 their rest length are shortened                             verlet_limit.c
 *
 * The rules are stated where they are applied: those of contact and friction in verlet_rules.c, the limit of
 * strains in verlet_limit.c. docs/springs.md compares both systems with this one, model/scene_cs184.c
 * reads scenes of CS184.
 *
 * Each stage after the forces moves nodes: x is where the substep has put them so far, x0 where they were
 * when it began. No stage moves pinned nodes.
 */
#ifndef DRAPE_INTEGRATORS_VERLET_H
#define DRAPE_INTEGRATORS_VERLET_H

#include "geometry/neighbours.h"
#include "integrators/integrator.h"

/* ---- Forces: verlet_force.c ---- */

typedef struct drape_verlet_force drape_verlet_force;

drape_status drape_verlet_force_create(drape_arena *arena, drape_system *system, drape_verlet_force **out);

/* The same as drape_system_force, up to rounding. */
void drape_verlet_force_sum(drape_verlet_force *force, const drape_point *point, double *g);

/* ---- Colliders: verlet_rules.c ---- */

enum { DRAPE_VERLET_CS184, DRAPE_VERLET_BOSON };

typedef struct drape_verlet_contact {
    const drape_model *model;
    const drape_motion *motion; /* of its colliders */
    int rule;
    double offset;             /* [m] CS184: how far outside of a flat surface a node is put */
    double friction_range;     /* [m] Boson: friction acts up to this far from a surface */
    double friction_drag;      /* [N s/m] Boson: drag of a node under friction */
    const atomic_bool *cancel; /* NULL, or raised: what is left is not done, as the step will not count */
} drape_verlet_contact;

/* Moves the nodes that are inside of a collider at time t; the substep of h seconds began at t0. Returns the
 * work [J] of colliders that move. */
double drape_verlet_project(const drape_verlet_contact *contact, double t0, double t, double h,
                            const double *x0, double *x);

/* Boson: changes g, the negative force, of nodes under friction at time t, and returns the power [W] of
 * colliders that move in doing so. CS184: does nothing, 0. */
double drape_verlet_friction(const drape_verlet_contact *contact, double t, const double *x, const double *v,
                             double *g);

/* ---- Cloth against cloth: verlet_rules.c ---- */

typedef struct drape_verlet_self {
    const drape_model *model;
    double reach;                /* [m] nodes nearer than this are pushed apart; 0: none are */
    drape_neighbours neighbours; /* the broad phase */
    uint64_t *box;               /* (node_count) the box of a node; NULL: all near nodes push */
    double per_box[3];           /* boxes per metre */
    const atomic_bool *cancel;   /* as in drape_verlet_contact */
} drape_verlet_self;

/* same_box: only nodes in the same box push, as in CS184. */
drape_status drape_verlet_self_create(drape_arena *arena, const drape_model *model, bool same_box,
                                      drape_verlet_self *out);

/* share: of the correction that one substep makes. */
void drape_verlet_self_push(drape_verlet_self *self, double share, double *x);

/* ---- The limit of strains: verlet_limit.c ---- */

typedef struct drape_verlet_patch drape_verlet_patch;

typedef struct drape_verlet_limit {
    int32_t count;   /* 0: no limit */
    int32_t *node;   /* (count x 2) */
    double *longest; /* (count) [m] */
    double *square;  /* (count) [m2] of the longest, in the order of the patches */
    int32_t patch_count;
    drape_verlet_patch *patch;
    int32_t node_count;
    double *x;                 /* planes (3 x node_count) */
    const uint8_t *pinned;     /* of the model */
    int passes;                /* at most */
    const atomic_bool *cancel; /* as in drape_verlet_contact */
} drape_verlet_limit;

/* All springs: the elements of two nodes of every term that measures a strain. */
drape_status drape_verlet_limit_create(drape_arena *arena, const drape_model *model, double limit, int passes,
                                       drape_verlet_limit *out);
void drape_verlet_limit_lengths(const drape_verlet_limit *limit, double *x);

#endif
