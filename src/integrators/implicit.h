/*
 * implicit.h: what the implicit fixed-step rows share. Each is a choice of the numbers of one Newton problem
 * (newton.h): weights, inertia, history; the arrays, the pins and the audit are the same.
 */
#ifndef DRAPE_INTEGRATORS_IMPLICIT_H
#define DRAPE_INTEGRATORS_IMPLICIT_H

#include "integrators/newton.h"

typedef struct drape_implicit {
    drape_context *ctx;
    drape_system *system;
    const drape_model *model;
    const drape_motion *motion;
    drape_newton *newton;    /* NULL in rows that iterate by themselves */
    double *x_base, *v_base; /* nodes: see drape_newton_problem */
    double *inertia, *d;     /* free DOFs */
    double *history;         /* measures; NULL where no law wants rates */
    double *dissipated;      /* nodes; NULL where nothing dissipates */
    bool inertial_guess;
    const double *x_start; /* nodes: see drape_newton_problem */
    double t, span[2];     /* [s] of the base: where colliders stand, and the way to there */
} drape_implicit;

/* For rows that embed it, with a Newton solver or without one: on failure what was taken is freed by
 * drape_implicit_free. */
drape_status drape_implicit_init_arrays(drape_context *ctx, drape_system *system, drape_implicit *implicit);
drape_status drape_implicit_init(drape_arena *arena, drape_system *system, const double *values,
                                 drape_implicit *implicit);
void drape_implicit_free(drape_implicit *implicit);

/* For rows that need no state of their own, and work and bytes for those that have it first in theirs. */
drape_status drape_implicit_create(drape_arena *arena, drape_system *system, const double *values,
                                   void **state);
void drape_implicit_destroy(void **state);
void drape_implicit_restart(void *state, const drape_state *from);
const double *drape_implicit_residual(const void *state);
drape_work drape_implicit_work(const void *state);
void drape_implicit_archive(void *state, drape_archive *a);
size_t drape_implicit_bytes(const void *state);
size_t drape_implicit_array_bytes(const drape_implicit *implicit); /* without the Newton solver */

/* Free nodes stand where they were, at rest; pinned ones where their tracks have them at time t, span after
 * in. */
void drape_implicit_base(drape_implicit *implicit, const drape_state *in, double t, double span);

/* The index of free DOF i among the nodes' coordinates. */
static inline size_t drape_implicit_at(const drape_implicit *implicit, size_t i)
{
    return 3 * (size_t)implicit->model->node_of_free[i / 3] + i % 3;
}

/* q at the positions of a state, into q (measures); nothing where no law wants rates. */
void drape_implicit_measure(drape_implicit *implicit, const drape_state *state, double *q);

/* Solves for d with base and inertia as they stand. history: of the measures' rates, NULL: q' = grad q .
 * v. */
drape_status drape_implicit_solve(drape_implicit *implicit, const double *internal, const double *history,
                                  double weight, double mass_weight, drape_step_info *info);

/* Work from t0 to t1 of what the system last put on moving colliders; 0 without contact. */
double drape_implicit_collider_work(const drape_implicit *implicit, double t0, double t1);

/* Work over a step: of dissipative forces on all nodes, and of the moved pins against g: it
 * is not theirs to speed up their own mass. */
void drape_implicit_audit(drape_implicit *implicit, const drape_state *in, const drape_state *out,
                          drape_step_info *info);

/* The same where the last evaluation was at this point and gave g. */
void drape_implicit_audit_at(drape_implicit *implicit, const drape_point *point, const double *g,
                             const drape_state *in, const drape_state *out, drape_step_info *info);

#endif
