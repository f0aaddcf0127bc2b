/*
 * implicit.h: shared by the implicit integrators with fixed steps. Each of them chooses the step equation
 * (nonlinear/step_equation.h) by its base, weights, inertia and history, and the solver; arrays, pins and
 * the account of work are the same.
 */
#ifndef DRAPE_INTEGRATORS_IMPLICIT_H
#define DRAPE_INTEGRATORS_IMPLICIT_H

#include "integrators/integrator.h"
#include "nonlinear/newton.h"

typedef struct drape_implicit {
    drape_step_equation equation;
    const drape_motion *motion;
    drape_newton *newton; /* NULL in integrators with another solver */
    double *d;            /* free DOFs: the unknown */
    double *carried;      /* free DOFs: the equation's */
    double *history;      /* measures; NULL if no law needs rates */
    double *dissipated;   /* nodes; NULL if nothing dissipates */
    double *momentum[2];  /* nodes: at the beginning and at the end of a stage; NULL if no term has any */
    double hit_end,
        made_end; /* [s] where the present state, and that of the last attempt, end a step in which something
                                 was hit; NAN: they do not */
} drape_implicit;

/* For integrators that embed it: without a solver, or with Newton's. Errors: as for drape_newton_create. */
drape_status drape_implicit_init(drape_arena *arena, drape_system *system, drape_implicit *implicit);
drape_status drape_implicit_init_newton(drape_arena *arena, drape_system *system, const double *values,
                                        drape_implicit *implicit);

/* The part that those with Newton's method and a state that begins with it have in common, and functions of
 * integrators whose state begins with it, or is nothing else. */
#define DRAPE_IMPLICIT_OPS                                                                                   \
    .residual = drape_implicit_residual, .tolerance = drape_implicit_tolerance, .work = drape_implicit_work, \
    .bytes = drape_implicit_bytes, .destroy = drape_implicit_destroy
drape_status drape_implicit_create(drape_arena *arena, drape_system *system, const double *values,
                                   void **state);
void drape_implicit_restart(void *state, const drape_state *from);
const double *drape_implicit_residual(const void *state);
double drape_implicit_tolerance(const void *state);
drape_work drape_implicit_work(const void *state);
void drape_implicit_archive(void *state, drape_archive *a);
size_t drape_implicit_bytes(const void *state);
void drape_implicit_destroy(void **state);

/* The nodes for a step or stage that begins at `in`: free nodes at in->x with zero velocity;
 * pinned nodes where their tracks are at time t, with their mean velocity over span. */
void drape_implicit_place(const drape_implicit *implicit, const drape_state *in, double t, double span,
                          double *x, double *v);

/* Sets these as the base of the equation, with colliders at time t. Rates of measures are q' = grad q . v
 * until a history is set. */
void drape_implicit_base(drape_implicit *implicit, const drape_state *in, double t, double span);

/* Sets the equation of backward Euler: base, v1 = (x1 - x0)/h, q' = (q1 - q0)/h. */
void drape_implicit_begin_euler(drape_implicit *implicit, const drape_state *in, double t, double h);

/* The state at the solution d of that equation, with velocities after an impact, and the account of work. */
void drape_implicit_end_euler(drape_implicit *implicit, const drape_state *in, drape_state *out, double h,
                              drape_step_info *info);

/* A step of backward Euler by Newton's method. */
drape_status drape_implicit_euler(drape_implicit *implicit, const drape_state *in, drape_state *out, double h,
                                  drape_step_info *info);

/* Methods of higher order assume forces that are smooth in a step. In an impact they are not: such a method
 * would use the force of the impact once more after it, and cloth would rebound from a body with restitution
 * 0. So a step in which something is hit, and the one after it, are steps of backward Euler. Whether this is
 * one after it: */
bool drape_implicit_follows_impact(drape_implicit *implicit, const drape_state *in);
/* After such a method has solved its own equation with `status`: whether something was hit. */
bool drape_implicit_hits(const drape_implicit *implicit, const drape_state *in, double h,
                         drape_status status);

/* Once the equation has its `expected`, sets what is carried: that, and for the nodes of each cloth the mean
 * displacement by which its moved pins get ahead of theirs, h v0 or, with dv (nodes), the change of velocity
 * in the step of `before`, h v0 + h^2/2 dv/before. */
void drape_implicit_carry(drape_implicit *implicit, const drape_state *in, double h, const double *dv,
                          double before);

/* How far moved pins get in a step of h from `in` ahead of where their velocity would take them: the largest
 * coordinate [m]. */
double drape_implicit_pins_ahead(const drape_implicit *implicit, const drape_state *in, double h);

/* g (nodes) at the state `in`, where the base of the equation begins; v (nodes): velocities, whose free
 * nodes are set to those of `in`. */
void drape_implicit_force_at_start(const drape_implicit *implicit, const drape_state *in, double *v,
                                   double *g);

/* Where no term has an energy of motion these do nothing. drape_implicit_momentum computes the momenta P
 * (nodes) at t, x, v in the step; drape_implicit_set_momenta has the equation add d/dt P = r (P - a P_a -
 * b P_b). */
void drape_implicit_momentum(const drape_implicit *implicit, double t, const double *x, const double *v,
                             double *p);
void drape_implicit_set_momenta(drape_implicit *implicit, double rate, double a, const double *p_a, double b,
                                const double *p_b);

/* Computes q (measures) at t, x in the step, if a law needs rates. */
void drape_implicit_measure(const drape_implicit *implicit, double t, const double *x, double *q);

/* Solves for d by Newton's method, from the guess d = p, or from the present d. Adds the iterations to
 * info. */
drape_status drape_implicit_solve(drape_implicit *implicit, drape_step_info *info);
drape_status drape_implicit_solve_from(drape_implicit *implicit, drape_step_info *info);

/* Copies the report of a solve to info. */
void drape_implicit_report(const drape_solve_report *report, drape_step_info *info);

/* Work from t0 to t1 of the forces on moving colliders that drape_system_on_colliders returns: after
 * drape_system_force all forces, after drape_system_dissipation their dissipative part. 0 without contact. */
double drape_implicit_collider_work(const drape_implicit *implicit, double t0, double t1);

/* Adds to info the work over a step of dissipative forces on all nodes and of the residual, and to that of
 * the system the work of moved pins against g, of colliders and of terms, all where the equation was
 * evaluated last: for methods that evaluate forces at one point of a step only, that of their equation. The
 * force that accelerates the pinned nodes' own mass does no work on the cloth. */
void drape_implicit_audit(drape_implicit *implicit, const drape_state *in, const drape_state *out,
                          drape_step_info *info);

/* The same over one stage, from and to positions of all nodes, from t to t + span, by the midpoint rule
 * with the mean velocity: for methods of several stages, with forces at both ends of a stage, or whose
 * velocity is not that of the displacement. In an impact within a step of such a method, a pair may
 * approach by its velocity and part by its displacement, and would dissipate negative energy. If powers at
 * the two ends were used, the force of a stiff dashpot at a jump of a pin's velocity would count for a
 * large part of the step. momentum must be that of the ends of the stage. Overwrites the base of the
 * equation and g (nodes). */
void drape_implicit_audit_stage(drape_implicit *implicit, const double *from, const double *to, double t,
                                double span, double *g, drape_step_info *info);
/* The part of it that is dissipated, or done by terms. */
void drape_implicit_audit_dissipation(drape_implicit *implicit, const double *from, const double *to,
                                      double t, double span, drape_step_info *info);

#endif
