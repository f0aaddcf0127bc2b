/*
 * system.h: the forces of all terms and their derivatives, assembled. With
 *     g(x, v) = grad E + g_damp       [N], positive against the motion: M v' + g = 0
 *     J = dg/dx + w dg/dv             [N/m], w the weight of x in v
 * (v = w x + const in a step method, w = c_j in IDA) every time integrator is a choice of x, v, w and of a
 * mass term.
 *
 * Elements are evaluated by several threads if there are any (sum.h): the result has the same bits for any
 * number of them.
 */
#ifndef DRAPE_ASSEMBLE_SYSTEM_H
#define DRAPE_ASSEMBLE_SYSTEM_H

#include <stdatomic.h>

#include "assemble/drag_spring.h"
#include "assemble/state.h"
#include "assemble/wind.h"
#include "base/thread_pool.h"
#include "contact/contact.h"

typedef struct drape_system drape_system;

/* Where the system is evaluated. */
typedef struct drape_point {
    const double *x, *v;    /* (node_count x 3) */
    const double *internal; /* (internal_count) of the last accepted state */
    double weight;          /* w [1/s]: v = w x + const, and q' = w q + history */
    const double *history;  /* (measure_count) [q/s]; NULL: q' = grad q . v, as in continuous time */
    const double *stress;   /* (measure_count) the forces on measures that weigh their second derivatives in a
                               Jacobian; NULL: those here */
    double t;               /* [s] where colliders stand */
    double span[2];         /* [s] over which their velocity is taken; equal: they rest */
} drape_point;

/* Workspace for a model, all of it of the arena but the threads; threads >= 1. Errors: DRAPE_E_MEMORY; then
 * *out is NULL. */
drape_status drape_system_create(drape_arena *arena, const drape_model *model, int threads,
                                 drape_system **out);
void drape_system_destroy(drape_system **system); /* ends the threads; before the arena is freed */

/* From here on terms that are constraints are left out of forces, energies and checks: for integrators that
 * keep constraints by moving nodes. */
void drape_system_leave_constraints(drape_system *system);

const drape_model *drape_system_model(const drape_system *system);
/* Its threads, for those who work on what it assembles; NULL: one thread. */
drape_pool *drape_system_pool(const drape_system *system);

/* A spring that belongs to the system from now on, and its energy to the elastic energy; stiffness 0: no
 * spring. Its node is free. */
void drape_system_set_drag_spring(drape_system *system, const drape_drag_spring *spring);
const drape_drag_spring *drape_system_drag_spring(const drape_system *system);

/* Where pins and colliders are: on the tracks of the model or on paths that a host gave. */
const drape_motion *drape_system_motion(const drape_system *system);
drape_motion *drape_system_steer(drape_system *system);

/* User-defined forces on nodes (node_count x 3) [N], copied; NULL: none. They do not depend on x and belong
 * to the system from now on. They have no energy; drape_system_push_work is their work from x to y [J]. */
void drape_system_set_push(drape_system *system, const double *force);
double drape_system_push_work(const drape_system *system, const double *x, const double *y);

/* A medium that moves, from now on, where the model has a term that feels it; NULL: it rests. */
void drape_system_set_wind(drape_system *system, drape_wind_field *field, void *user);
void drape_system_copy_wind(drape_system *system, const drape_system *from);

/* Adds the loads of a host on nodes at x, drag spring and forces, to g (node_count x 3): a part of
 * drape_system_force. */
void drape_system_add_loads(const drape_system *system, const double *x, double *g);

/* A flag that may be raised at any time: from the next force on drape_system_status is DRAPE_E_STOPPED, until
 * a step begins without it. drape_system_cancelled reads it at once. */
void drape_system_watch(drape_system *system, const atomic_bool *cancel);
bool drape_system_cancelled(drape_system *system);

/* From now on the forces of contact belong to the system, if the model has any. Errors: DRAPE_E_MEMORY. */
drape_status drape_system_add_contact(drape_system *system);
const drape_contact *drape_system_contact(const drape_system *system); /* NULL: there is none */

/* [s] A clock that stands still during contact, which has a clock of its own: what it times does not include
 * contact. */
double drape_system_clock(const drape_system *system);

/* Writes all that it keeps besides the model into an archive or, where it was just made, reads it. The wind
 * is left out: it is a function of the host. */
void drape_system_archive(drape_system *system, drape_archive *a);

/* A step begins at a state: contact is compared with it until the next. Errors: DRAPE_E_MEMORY. */
drape_status drape_system_begin(drape_system *system, const drape_state *in);

/* The step has ended: queries between steps leave no trace in the next one. */
void drape_system_rest(drape_system *system);

/* The sparsity of its matrices. Contact between cloths changes it: drape_system_extend_pattern makes it hold
 * what acts at a point; *changed: it is another one since, in the same place. Errors: DRAPE_E_MEMORY. */
const drape_pattern *drape_system_pattern(const drape_system *system);
drape_status drape_system_extend_pattern(drape_system *system, const drape_point *point, bool *changed);

/* The first failure since drape_system_begin in functions that return no status: memory for contacts,
 * cancelling. */
drape_status drape_system_status(const drape_system *system);

/* g (node_count x 3) of all nodes, pinned ones too. */
void drape_system_force(drape_system *system, const drape_point *point, double *g);

/* The same without the terms that `without` (term_count) marks: for callers that sum those themselves. */
void drape_system_force_without(drape_system *system, const drape_point *point, const bool *without,
                                double *g);

/* values (pattern.nonzeros) = mass_weight M + J over the free nodes. positive_share, 0 to 1: each element's
 * Hessian H is H + positive_share (H+ - H), with its positive semidefinite part H+: 0 exact, 1 positive
 * semidefinite. Of contact it is H+ for any share above 0. */
void drape_system_jacobian(drape_system *system, const drape_point *point, double mass_weight,
                           double positive_share, double *values);

/* The parts of an approximate Jacobian that is cheaper than J (nonlinear/approx_jacobian.h), term by term.
 *
 * drape_system_pairs, of a term with pairs: the symmetric 3 x 3 block H of each element, xx xy xz yy yz zz,
 * as (6 x element count), such that [H -H; -H H] is the positive semidefinite part of its Hessian.
 * drape_system_remainder: values (pattern.nonzeros) = the part of J, energies with their positive part, that
 * belongs to no strain measure, and contact; drape_system_has_remainder: whether there is any. */
void drape_system_pairs(const drape_system *system, int32_t term, const drape_point *point, double *h);
void drape_system_remainder(drape_system *system, const drape_point *point, double *values);
bool drape_system_has_remainder(const drape_system *system);

/* values (pattern.nonzeros) = D = dg/dv over the free nodes, in continuous time. */
void drape_system_damping(drape_system *system, const drape_point *point, double *values);

/* The dissipative part of g: laws and terms that take energy out. */
void drape_system_dissipation(drape_system *system, const drape_point *point, double *g);

/* Force on each collider at the last drape_system_force, or its dissipative part at the last
 * drape_system_dissipation (collider_count x 3) [N], signed like g; NULL without contact. */
const double *drape_system_on_colliders(const drape_system *system);

/* Energies of the terms [J], and of contact. */
void drape_system_energy(drape_system *system, const drape_point *point, double *elastic, double *gravity);
double drape_system_contact_energy(drape_system *system, const drape_point *point);

/* The elastic energy by node (node_count) [J]: that of each element in equal parts on its nodes. */
void drape_system_node_energy(drape_system *system, const drape_point *point, double *energy);

/* Contact alone, for checks: overwrites g (node_count x 3), with friction or without, and values
 * (pattern.nonzeros, after drape_system_extend_pattern at this point) with its J; either may be NULL. */
void drape_system_contact_part(drape_system *system, const drape_point *point, bool friction, double *g,
                               double *values);

/* The largest fraction of the step from nodes x to y on which no two pieces pass through each other, while
 * colliders rest where they are at time t. */
double drape_system_step_fraction(drape_system *system, const double *x, const double *y, double t);

/* q of all measures (measure_count). */
void drape_system_measures(drape_system *system, const drape_point *point, double *q);

/* The forces f on all measures, dE/dq and laws (measure_count), to first order after the nodes move by
 * `along` (node_count x 3); NULL: at the point itself, without dissipative forces. */
void drape_system_stress(drape_system *system, const drape_point *point, const double *along, double *stress);

/* One term alone, for checks and profiles: adds to g and to J in values, and sets *energy. Any of the three
 * may be NULL. */
void drape_system_term(drape_system *system, int32_t term, const drape_point *point, double *energy,
                       double *g, double *values);

/* Searches all terms for an element that a step made degenerate: DRAPE_OK or DRAPE_RETRY_DEGENERATE, with
 * *worst filled in. x is the new state; before and internal are of the one before. before NULL: also those
 * that were degenerate already. */
drape_status drape_system_check(const drape_system *system, const double *x, const double *before,
                                const double *internal, const char **reason, drape_diagnostic *diagnostic);

/* Whether x is beyond a limit that a term with `constraint` keeps: drape_system_check of these terms
 * alone. */
bool drape_system_breaks_limit(const drape_system *system, const double *x, const double *before,
                               const double *internal);

/* Whether anything passes through anything on the straight path from the beginning of the step to y. */
bool drape_system_crosses(drape_system *system, const double *y, double t);

/* Searches for a piece that a step brought into a collider or through another piece: x is the new state at
 * time t, the one before that of drape_system_begin. DRAPE_OK, or DRAPE_RETRY_REJECTED with reason and
 * worst. */
drape_status drape_system_check_contact(drape_system *system, const double *x, double t, const char **reason,
                                        drape_diagnostic *diagnostic);

/* For a message about a vector over free DOFs: the node, and its cloth, of the entry of largest magnitude or
 * the first that is not finite. */
drape_diagnostic drape_system_diagnose_dof(const drape_system *system, const double *free_vector,
                                           const char *what, double limit);

#endif
