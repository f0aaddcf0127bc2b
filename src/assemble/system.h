/*
 * system.h: the forces of all terms and their derivatives, assembled. With
 *     g(x, v) = grad E + g_damp       [N], signed so that M v' + g = 0
 *     J = dg/dx + w dg/dv             [N/m], w the weight of x in v
 * (v = w x + const in a step method, w = c_j in IDA) every time integrator is a choice of x, v, w and of a
 * mass term.
 *
 * Several threads may evaluate the elements (sum.h): the result has the same bits for any number of
 * threads.
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

/* The point at which the system is evaluated. */
typedef struct drape_point {
    const double *x, *v;    /* (node_count x 3) */
    const double *internal; /* (internal_count) of the last accepted state */
    double weight;          /* w [1/s]: v = w x + const, and q' = w q + history */
    const double *history;  /* (measure_count) [q/s]; NULL: q' = grad q . v, as in continuous time */
    const double *stress;   /* (measure_count) the f before ddq in a Jacobian; NULL: the forces here */
    double t;               /* [s] time of the colliders' poses, and of terms that depend on it */
    double momentum;        /* r [1/s]: d/dt dT/dv = r dT/dv + const for energies of motion T; 0: without */
    bool done;              /* energies that depend on time are taken at progress 1, loads at their largest */
    bool relaxed;      /* an infinite time after the internal variables: Maxwell branches have no force */
    bool full;         /* loads from outside are taken at progress 1 and without their histories */
    double progressed; /* added to their progress, for differences */
    double ahead;      /* [s] added to the time of directions that turn */
    bool turning;      /* these have their velocities of time t though the ends of span are equal */
    double span[2];    /* [s] over which the velocities of colliders are taken; equal: they are at rest */
    bool instant;      /* those that turn have their velocities of time t instead, as the pins of methods that
                       follow the solution between the kinks of the motion, at the ends of span */
    drape_contact_derivatives contact; /* of contact in a Jacobian without positive parts */
} drape_point;

/* Workspace for a model; threads >= 1. The arena owns all of it except the threads. Errors: DRAPE_E_MEMORY;
 * then *out is NULL. */
drape_status drape_system_create(drape_arena *arena, const drape_model *model, int threads,
                                 drape_system **out);
void drape_system_destroy(drape_system **system); /* stops the threads; call it before the arena is freed */

/* From now on, terms that are constraints are left out of forces, energies and checks. For integrators that
 * enforce constraints by moving nodes. */
void drape_system_leave_constraints(drape_system *system);

/* From now on, the losses of measured fabrics are left out. For explicit integrators, whose steps would have
 * to resolve them. */
void drape_system_leave_losses(drape_system *system);

const drape_model *drape_system_model(const drape_system *system);
/* Its thread pool, for callers that work on what it assembles; NULL: one thread. */
drape_pool *drape_system_pool(const drape_system *system);

/* From now on the system contains these springs and no others, and the elastic energy their energy. Their
 * nodes must be free. */
void drape_system_set_drag_springs(drape_system *system, const drape_drag_springs *springs);
const drape_drag_springs *drape_system_drag_springs(const drape_system *system);

/* Integrators step in the frame that moves with the supports of nodes (model/support.h), in which these rest:
 * x - u(t) in place of x, v - u' in place of v. drape_system_to_frame enters it with the state from which a
 * step begins: from then on functions of the system take positions and velocities in that frame, until
 * drape_system_from_frame, which brings the positions that the step led to back to space, unless out is
 * NULL. Velocities there are left without u'. If no support moves it returns `in`. */
const drape_state *drape_system_to_frame(drape_system *system, const drape_state *in);
void drape_system_from_frame(drape_system *system, drape_state *out);

/* The work of supports that move from t0 to t1 [J], and their power at time t [W], against forces g
 * (node_count x 3); NULL: against those of the last evaluation of forces. */
double drape_system_support_work(const drape_system *system, const double *g, double t0, double t1);
double drape_system_support_power(const drape_system *system, const double *g, double t);

/* Whether some of the forces of pins, supports and colliders do work. */
bool drape_system_is_driven(const drape_system *system);

/* Where pins and colliders are: on the tracks of the model, or on paths set by the host. */
const drape_motion *drape_system_motion(const drape_system *system);
drape_motion *drape_system_steer(drape_system *system);

/* User-defined forces on nodes (node_count x 3) [N], which are copied and apply from now on; NULL: none.
 * They do not depend on x. They have no energy; drape_system_push_work returns their work from x to y [J]. */
void drape_system_set_push(drape_system *system, const double *force);
double drape_system_push_work(const drape_system *system, const double *x, const double *y);

/* What does work on cloth from outside; from DRAPE_BY_TERMS on, each term of the model. */
enum { DRAPE_BY_PINS, DRAPE_BY_COLLIDERS, DRAPE_BY_HOST, DRAPE_BY_TERMS };

/* The work of each in a step (drape_system_work_count) [J], to which integrators add; 0 after
 * drape_system_begin_work. That of loads with a potential is what their change by itself does. */
double *drape_system_work(const drape_system *system);
size_t drape_system_work_count(const drape_system *system);
void drape_system_begin_work(drape_system *system);

/* Whether a term depends on time. The second adds to work the work that this does in a step from one state
 * to another [J], by the internal variables of the former. *open grows by the possible error of that work: a
 * history may change within the step, of which some integrators see only the end. *dissipated grows by what
 * of the work is done on dashpots; NULL: nothing moves them. */
bool drape_system_is_timed(const drape_system *system);
void drape_system_add_timed_work(drape_system *system, const drape_state *before, const drape_state *after,
                                 double *work, double *open, double *dissipated);

/* The sum of the potentials of loads at a point [J], which drape_system_energy has in `gravity`; and of each
 * of them (drape_system_work_count), unless NULL. */
double drape_system_measure_loads(drape_system *system, const drape_point *point, double *potential);

/* From now on the medium moves with this field, if the model has a term that feels it; NULL: it is at
 * rest. */
void drape_system_set_wind(drape_system *system, drape_wind_field *field, void *user);
void drape_system_copy_wind(drape_system *system, const drape_system *from);
bool drape_system_has_wind(const drape_system *system); /* it moves, and is felt */

/* Adds the host's loads on nodes at x, the drag springs and the forces, to g (node_count x 3).
 * drape_system_force contains them. */
void drape_system_add_loads(const drape_system *system, const double *x, double *g);

/* Sets a flag that any thread may raise at any time. At the next drape_system_force, drape_system_status
 * becomes DRAPE_E_STOPPED, until a step begins with the flag down. drape_system_cancelled reads the flag at
 * once. */
void drape_system_watch(drape_system *system, const atomic_bool *cancel);
bool drape_system_cancelled(drape_system *system);
/* Where the address of that flag is; valid as long as the system. */
const atomic_bool *const *drape_system_cancel_flag(const drape_system *system);

/* From now on the system contains the forces of contact, if the model has any. Errors: DRAPE_E_MEMORY. */
drape_status drape_system_add_contact(drape_system *system);
drape_contact *drape_system_contact(const drape_system *system); /* NULL: there is none */

/* Whether a pair of contact was active where forces or a matrix were computed last; of this rank. */
bool drape_system_touches(const drape_system *system);

/* [s] A clock that stops during contact queries, which are timed separately: an interval measured by it
 * does not include contact. */
double drape_system_clock(const drape_system *system);

/* Writes everything that the system keeps besides the model to an archive or, if the system was just
 * created, reads it back. The wind is left out: it is a function of the host. */
void drape_system_archive(drape_system *system, drape_archive *a);

/* Takes what another system of the same cloth keeps besides its model, except the wind; drag springs on nodes
 * that are pinned here are gone. before (collider_count): the number that each collider has there; -1: it is
 * new. Errors: DRAPE_E_MEMORY. */
drape_status drape_system_continue(drape_system *system, drape_system *from, const int32_t *before, double t);

/* Begins a step at a state, against which contact compares until the next call. Errors: DRAPE_E_MEMORY. */
drape_status drape_system_begin(drape_system *system, const drape_state *in);

/* For forces in a state that no step has led to: begins a step there and ends it, unless a step that failed
 * has begun there; beginning another one would make contact stiffer. Errors: DRAPE_E_MEMORY. */
drape_status drape_system_begin_reading(drape_system *system, const drape_state *at);

/* Ends the step, so that queries between steps leave no trace in the next one. */
void drape_system_end_step(drape_system *system);

/* The sparsity of the assembled matrices. Contact between cloths changes it: drape_system_extend_pattern
 * makes it include every pair that acts at the point. *changed: the pattern was rebuilt,
 * perhaps at the same address. Errors: DRAPE_E_MEMORY. */
const drape_pattern *drape_system_pattern(const drape_system *system);
drape_status drape_system_extend_pattern(drape_system *system, const drape_point *point, bool *changed);

/* Differs after each change of the pattern: for several owners of matrices in it. */
int64_t drape_system_pattern_version(const drape_system *system);

/* From now on the pattern is without what only these terms (term_count) couple, which no matrix in it may
 * then contain; NULL: it has all of them, as at first. terms must outlive the system. Errors: DRAPE_E_MEMORY,
 * after which the pattern has all of them until it changes. */
drape_status drape_system_leave_out(drape_system *system, const bool *terms);

/* The first failure since drape_system_begin in functions that return no status: out of memory for
 * contacts, or cancelled. */
drape_status drape_system_status(const drape_system *system);

/* Where ranks share the model: the status of the lowest rank that has failed, on all ranks. Collective. */
drape_status drape_system_agree(drape_system *system);

/* Whether these numbers, of which each rank has some, are all finite. It takes one exchange while all is
 * well, and else agrees on a status, too. Collective. */
bool drape_system_agree_finite(drape_system *system, const double *f, size_t count);

/* g (node_count x 3) of all nodes, including pinned ones; without what lies along the directions in which
 * supports hold nodes (model/support.h). */
void drape_system_force(drape_system *system, const drape_point *point, double *g);

/* dT/dv (node_count x 3) [kg m/s] of the terms with an energy of motion T. */
void drape_system_momentum(drape_system *system, const drape_point *point, double *p);

/* The same as drape_system_force without the terms marked in `without` (term_count; NULL: none), for callers
 * that sum those themselves; drape_system_sum_forces: also along these directions. */
void drape_system_force_without(drape_system *system, const drape_point *point, const bool *without,
                                double *g);
void drape_system_sum_forces(drape_system *system, const drape_point *point, const bool *without, double *g);

/* The forces of pins and supports (node_count x 3), with the sign of g; 0 at nodes that are free. */
void drape_system_reactions(drape_system *system, const drape_point *point, double *g);

/* The projections of model/support.h, for callers that add forces and matrices of their own. */
void drape_system_project(const drape_system *system, double *nodes);
/* The same of forces, of which those on supports are kept for drape_system_support_work. */
void drape_system_project_forces(drape_system *system, double *g);
void drape_system_project_free(const drape_system *system, double *free_nodes);
void drape_system_project_matrix(const drape_system *system, double *values);

/* values (pattern.nonzeros) = mass_weight M + J over the free nodes. With positive_share from 0 to 1, each
 * element's Hessian H becomes H + positive_share (H+ - H), where H+ is its positive semidefinite part: 0 is
 * exact, 1 is positive semidefinite. So does that of contact, whose positive semidefinite part is
 * DRAPE_CONTACT_GAUSS_NEWTON. */
void drape_system_jacobian(drape_system *system, const drape_point *point, double mass_weight,
                           double positive_share, double *values);

/* The same without the terms marked in `without` (term_count), for callers that add those themselves. */
void drape_system_jacobian_without(drape_system *system, const drape_point *point, double mass_weight,
                                   double positive_share, const bool *without, double *values);

/* drape_contact_predict. */
void drape_system_predict_contact(drape_system *system, const double *p, double weight, double mass_weight);

/* Whether the Jacobian of contact is symmetric in every state. */
bool drape_system_is_symmetric(const drape_system *system);

/* Whether that of the terms is, in a step: not with drag and dashpots that couple nodes, loads that follow
 * the cloth, and energies of motion. */
bool drape_system_has_symmetric_terms(const drape_system *system);

/* values (pattern.nonzeros) = what the exact Jacobian of contact has beyond its positive semidefinite
 * approximation, as drape_contact_add_remainder. */
void drape_system_contact_remainder(drape_system *system, const drape_point *point, double *values);

/* Whether the model has a contact with friction. */
bool drape_system_has_friction(const drape_system *system);

/* Makes the values of drape_system_jacobian at a point with a share of the positive parts symmetric: takes
 * out how friction changes with the normal force and the place of contact, and of the rest, what is
 * antisymmetric. */
void drape_system_symmetrize(drape_system *system, const drape_point *point, double positive_share,
                             double *values);

/* The parts of an approximate Jacobian that is cheaper than J (nonlinear/approx_jacobian.h), term by term.
 *
 * drape_system_pairs, for a term of pairs: the symmetric 3 x 3 block H of each element, xx xy xz yy yz zz,
 * as (6 x element count), such that [H -H; -H H] is the positive semidefinite part of its Hessian.
 * drape_system_remainder: values (pattern.nonzeros) = the part of J that belongs to no strain measure:
 * contact, by its positive semidefinite approximation, and the other terms, energies with their positive
 * semidefinite part. drape_system_has_remainder: whether there is such a part. */
void drape_system_pairs(const drape_system *system, int32_t term, const drape_point *point, double *h);
void drape_system_remainder(drape_system *system, const drape_point *point, double *values);
bool drape_system_has_remainder(const drape_system *system);

/* values (pattern.nonzeros) = D = dg/dv over the free nodes, in continuous time. */
void drape_system_damping(drape_system *system, const drape_point *point, double *values);

/* The dissipative part of g: dissipative laws, and terms and friction that dissipate energy. Returns what it
 * takes over a time [s] from nodes and supports, at the velocities of the point and the mean ones in its span
 * [J]. Loads without a potential, and terms whose medium pushes cloth at rest, are no part of it: what they
 * do in that time is added to the work of the system. */
double drape_system_dissipation(drape_system *system, const drape_point *point, double time, double *g);

/* Force on each collider at the last drape_system_force, or its dissipative part at the last
 * drape_system_dissipation (collider_count), with the sign of g; NULL without contact. */
const drape_load *drape_system_on_colliders(const drape_system *system);

/* Energies of the terms, elastic and gravitational [J]; energy of contact [J], NaN where drape_system_status
 * says why it is not known. */
void drape_system_energy(drape_system *system, const drape_point *point, double *elastic, double *gravity);
double drape_system_contact_energy(drape_system *system, const drape_point *point);

/* Of the energies of motion T of terms, which with v - w in place of v are T2 + T1 + T0 by powers of v: T2,
 * and -T0, the potential of the force that steady wind w has on cloth at rest [J]. Their sum v . dT/dv - T is
 * conserved in steady wind. */
void drape_system_motion_energy(drape_system *system, const drape_point *point, double *kinetic,
                                double *potential);

/* The elastic energy by node (node_count) [J]: each element's energy in equal parts on its nodes. */
void drape_system_node_energy(drape_system *system, const drape_point *point, double *energy);

/* Contact alone, for checks: overwrites g (node_count x 3), with or without friction, and values
 * (pattern.nonzeros, after drape_system_extend_pattern at this point) with its J. Either may be NULL. */
void drape_system_contact_part(drape_system *system, const drape_point *point, bool friction, double *g,
                               double *values);

/* The largest fraction of the displacement from nodes x to y along which nothing passes through anything
 * else, with the colliders in their pose at time t. of_node (node_count), unless NULL, receives the fraction
 * to which the pieces at each node limit it: 1 without contact. again: as in contact/contact.h. */
double drape_system_step_fraction(drape_system *system, const double *x, const double *y, double t,
                                  bool again, double *of_node);

/* See contact/contact.h. */
void drape_system_set_contact_step(drape_system *system, double dt);

/* drape_contact_sweep and drape_contact_carry_layers. */
void drape_system_sweep(drape_system *system, double t, double *y);
void drape_system_carry_layers(drape_system *system, double t, double *y);

/* q of all measures (measure_count). */
void drape_system_measures(drape_system *system, const drape_point *point, double *q);

/* The forces f on all measures, dE/dq and laws (measure_count), extrapolated to first order along a
 * displacement of the nodes (node_count x 3); along NULL: at the point itself, without dissipative forces. */
void drape_system_stress(drape_system *system, const drape_point *point, const double *along, double *stress);

/* One term alone, for checks and profiles: adds to g, adds its J to values, and sets *energy. Any of the
 * three may be NULL. */
void drape_system_term(drape_system *system, int32_t term, const drape_point *point, double *energy,
                       double *g, double *values);

#define DRAPE_OWN_REASONS 31 /* of user-defined terms; any more are DRAPE_REASON_OTHER */

/* The number of a reason by its name, which may be that of a user-defined term, and stays valid; and the name
 * of a reason by its number. */
drape_reason drape_system_reason(drape_system *system, const char *name);
const char *drape_system_reason_name(const drape_system *system, drape_reason reason);

/* Searches all terms for an element that a step made degenerate. Returns DRAPE_OK, or
 * DRAPE_RETRY_DEGENERATE with *reason and *diagnostic filled in. x is the new state; before and
 * internal belong to the previous one. In the frame of supports both are at the time of the last evaluation.
 * before NULL: reports elements that were degenerate already, too. */
drape_status drape_system_check(drape_system *system, const double *x, const double *before,
                                const double *internal, drape_reason *reason, drape_diagnostic *diagnostic);

/* Whether x violates a limit imposed by a term with `constraint`: drape_system_check restricted to those
 * terms. */
bool drape_system_breaks_limit(const drape_system *system, const double *x, const double *before,
                               const double *internal);

/* Whether features come too near at x, or pass through each other on the straight path from the beginning
 * of the step to there; with *reason and *diagnostic filled in if so. */
bool drape_system_crosses(drape_system *system, const double *x, double t, drape_reason *reason,
                          drape_diagnostic *diagnostic);

/* drape_contact_nearest; false without contact. */
bool drape_system_nearest(drape_system *system, drape_diagnostic *diagnostic);

/* The energy that changes of the stiffness of contact between steps have added since the last call [J]. */
double drape_system_take_contact_work(drape_system *system);

/* Searches for a place where a step brought cloth into a collider or through another piece of cloth. x is
 * the new state at time t; the previous one is that of drape_system_begin. Returns DRAPE_OK, or
 * DRAPE_RETRY_REJECTED with *reason and *diagnostic filled in. */
drape_status drape_system_check_contact(drape_system *system, const double *x, double t, drape_reason *reason,
                                        drape_diagnostic *diagnostic);

/* drape_agree_largest (assemble/agree.h); the texts are valid until the next diagnostic. */
void drape_system_agree_largest(drape_system *system, double value, drape_diagnostic *diagnostic);

/* For a message about a vector over free DOFs: the node of its first entry that is not finite or, if all are
 * finite, of its largest one, and the cloth of that node. */
drape_diagnostic drape_system_diagnose_dof(drape_system *system, const double *free_vector, const char *what,
                                           double limit);

#endif
