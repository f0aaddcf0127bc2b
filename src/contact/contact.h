/*
 * contact.h: the forces of contact of cloth with colliders and with itself, their derivatives, and
 * continuous collision detection. Contact is a part of the system (assemble/system.h): it is evaluated at
 * points like a term, but which nodes it couples changes as they move.
 *
 * Candidate pairs are searched along straight paths of all points, and again when a point is farther from its
 * path than a margin. Which of them are active or limit a step, and in which order, depends on the positions
 * alone: no result depends on when a search was made, or for which path.
 */
#ifndef DRAPE_CONTACT_CONTACT_H
#define DRAPE_CONTACT_CONTACT_H

#include "base/archive.h"
#include "base/reason.h"
#include "model/motion.h"

#include <stdatomic.h>

typedef struct drape_contact drape_contact;

/* The point at which contact is evaluated. Colliders have their poses at time t; they move with their mean
 * velocity from span[0] to span[1], or rest if these are equal. instant: those that turn have their velocity
 * of time t, on the piece of their motion that contains the middle of the span. */
typedef struct drape_contact_at {
    const double *x, *v; /* (node_count x 3); v NULL: at rest */
    double t, span[2];   /* [s] */
    bool instant;
} drape_contact_at;

/* *out is NULL for a model without colliders and without self-contact. Contact takes all its memory from
 * the arena, later as well, and is freed with it. Errors: DRAPE_E_MEMORY. */
drape_status drape_contact_create(drape_arena *arena, const drape_motion *motion, drape_contact **out);
/* The address of a flag that any thread may raise (see drape_system_watch); both must live as long as the
 * contact. While it is up, drape_contact_step_fraction ends early. */
void drape_contact_watch(drape_contact *contact, const atomic_bool *const *cancel);

double drape_contact_seconds(const drape_contact *contact);        /* spent in all functions of this header */
double drape_contact_search_seconds(const drape_contact *contact); /* part of it: in the broad phase */

/* The nominal step [s], unless the integrator has none: where the scene gives no activation distance, that of
 * a moving collider grows with its path in such a step. */
void drape_contact_set_step(drape_contact *contact, double dt);

/* The longest path [m] of a collider in a nominal step so far, relative to the mean motion of the cloth. */
double drape_contact_longest_path(const drape_contact *contact);

/* Begins a step at the state x, v at time t: lagged friction takes its normal forces here, and the end of
 * the step is compared with it. The arrays are copied. Errors: DRAPE_E_MEMORY. */
drape_status drape_contact_begin(drape_contact *contact, const double *x, const double *v, double t);

/* Whether the last step has begun with the nodes at x (node_count x 3) at time t, and with the colliders
 * where they are then. */
bool drape_contact_has_begun(const drape_contact *contact, const double *x, double t);

/* Whether there is cloth that contact does not hold somewhere (contact/exempt.h). */
bool drape_contact_exempts(const drape_contact *contact);

/* Ends the step. Queries before the next step have candidates of their own, so that the next step can use
 * those of this one. */
void drape_contact_end(drape_contact *contact);

/* Finds the active contacts at a point, where the functions below then evaluate forces, energy and
 * derivatives. Errors: DRAPE_E_MEMORY. */
drape_status drape_contact_evaluate_at(drape_contact *contact, const drape_contact_at *at);

/* Adds the forces of the energy, the dissipative ones (restitution and friction), or both, to g (node_count x
 * 3). */
void drape_contact_add_forces(drape_contact *contact, bool conservative, bool dissipative, double *g);

/* Where the contacts were evaluated last, by the mean velocities of a step of size h: whether something was
 * hit in it. before (node_count x 3): the velocities at its beginning. */
bool drape_contact_impacts(const drape_contact *contact, double h, const double *before);

/* Restitution of an impact that begins and ends within a step, in which the forces above do not see its speed
 * (Newton's law of impact): pairs that crossed their activation distance in such a step part by their
 * coefficient times the speed of the impact, whose square is that at the beginning of the step plus twice the
 * acceleration of a fall times the gap there. v (node_count x 3): to be changed. */
void drape_contact_rebound(const drape_contact *contact, double h, const double *before, double *v);

/* The forces of the last drape_contact_add_forces on each collider (collider_count), with the sign of g. */
const drape_load *drape_contact_on_colliders(const drape_contact *contact);

/* Lists up to `capacity` of the contacts at the last point, with their forces there; returns their number. */
int32_t drape_contact_points(const drape_contact *contact, int32_t capacity, drape_contact_point *points);

double drape_contact_potential(const drape_contact *contact); /* [J] */

/* The energy that changes of stiffness at the beginning of steps have added to the potential since the
 * last call [J]. */
double drape_contact_take_work(drape_contact *contact);

/* Which derivatives of pairs of free nodes are added. */
typedef enum drape_contact_derivatives {
    DRAPE_CONTACT_EXACT,       /* dg/dx + weight dg/dv */
    DRAPE_CONTACT_SYMMETRIC,   /* without implicit friction, the symmetric part of the exact ones, which
                               differs from them only by restitution; with it, the exact ones */
    DRAPE_CONTACT_VELOCITY,    /* dg/dv */
    DRAPE_CONTACT_GAUSS_NEWTON /* a positive semidefinite approximation: the Gauss-Newton part of the Hessians
                                  of the energy (contact/law.h), and symmetric upper bounds of the weight
                                  dg/dv of restitution and friction (contact/restitution.h,
                                  contact/friction.h) */
} drape_contact_derivatives;

/* Adds (1 - s) times these derivatives and s times DRAPE_CONTACT_GAUSS_NEWTON, s = positive_share in [0, 1],
 * to values in the pattern, which must have their blocks. */
void drape_contact_add_jacobian(drape_contact *contact, double weight, drape_contact_derivatives which,
                                double positive_share, const drape_pattern *pattern, double *values);

/* Predicts the normal forces (contact/predict.h) at the end of a correction p (node_count x 3) from the last
 * point, where the Jacobian had these weights; p NULL: forgets what was predicted. The next Jacobians use
 * the predictions, until a step begins. */
void drape_contact_predict(drape_contact *contact, const double *p, double weight, double mass_weight);

/* Whether there is friction, with colliders or of cloth with itself. */
bool drape_contact_has_friction(const drape_contact *contact);

/* Whether DRAPE_CONTACT_SYMMETRIC is symmetric: no friction follows the normal force within a step. */
bool drape_contact_is_symmetric(const drape_contact *contact);

/* Subtracts from values, to which drape_contact_add_jacobian added a share of DRAPE_CONTACT_SYMMETRIC with
 * the same weight, the derivatives of friction by the normal force and by the place of contact. The rest of
 * friction is symmetric, and for each contact positive semidefinite in its tangential plane. */
void drape_contact_fix_friction(drape_contact *contact, double weight, double share,
                                const drape_pattern *pattern, double *values);

/* Adds to values the difference of DRAPE_CONTACT_EXACT and DRAPE_CONTACT_GAUSS_NEWTON. */
void drape_contact_add_remainder(drape_contact *contact, double weight, const drape_pattern *pattern,
                                 double *values);

/* Whether the pattern has the blocks of all active contacts. */
bool drape_contact_is_in_pattern(const drape_contact *contact, const drape_pattern *pattern);

/* Lists the pairs of cloth with cloth that are near each other, four nodes each, for a pattern that has the
 * blocks of later contacts, too; valid until the next call. Returns their number; -1: out of memory. */
int32_t drape_contact_list_couplings(drape_contact *contact, const int32_t **nodes);

/* The list made by the last drape_contact_list_couplings, or read from an archive. */
int32_t drape_contact_last_couplings(const drape_contact *contact, const int32_t **nodes);

/* Copies from contact of the same cloth what a step leaves for the next one: the pairs that are inside, the
 * stiffness and the activation distances. before (collider_count): the number that each collider has there;
 * -1: it is new. Errors: DRAPE_E_MEMORY. */
drape_status drape_contact_continue(drape_contact *contact, const drape_contact *from, const int32_t *before);

/* Archives the beginning of the step, from which everything else follows, and the couplings. */
void drape_contact_archive(drape_contact *contact, drape_archive *a);

/* Archives only the part that is the same on all ranks: the stiffness and the activation distances, as before
 * the first step. */
void drape_contact_archive_stiffness(drape_contact *contact, drape_archive *a);

/* The largest step fraction from x to y (node_count x 3) on which no two pieces pass through each other, with
 * a margin; colliders rest in their poses at time t. of_node (node_count), unless NULL, is lowered at each
 * node to the smallest fraction of its pairs. If some node goes farther than a few edges, pairs are not
 * searched: such nodes are shortened to that length, or to about an edge if the displacement throws nodes
 * farther than the scene is large. again: this is a second call from the same x, with the displacement that
 * the first result has left; of_node still has that result, and is replaced. Pairs of nodes that the first
 * call did not shorten limit nothing, and are skipped. If the watched flag is raised meanwhile, the result is
 * 0, also at each node. */
double drape_contact_step_fraction(drape_contact *contact, const double *x, const double *y, double t,
                                   bool again, double *of_node);

/* Moves the free nodes of y (node_count x 3), a guess of the end of the step at time t, aside from moving
 * colliders: a node that would meet a collider on the straight path from the beginning of the step slides on
 * the collider from there on. Nodes that begin inside keep their place. */
void drape_contact_sweep(drape_contact *contact, double t, double *y);

/* Moves cloth that would pass through cloth on the straight path from the beginning of the step to y along
 * with the nearest rigid collider. y: the beginning of the step after drape_contact_sweep; it is unchanged if
 * this does not keep all cloth apart. */
void drape_contact_carry_layers(drape_contact *contact, double t, double *y);

/* Whether cloth at x with velocities v (node_count x 3) at time t may meet a body or another piece of cloth
 * in the next so many seconds. An estimate: free nodes are taken to keep their velocities, pins and colliders
 * follow their motion. */
bool drape_contact_may_meet(drape_contact *contact, const double *x, const double *v, double t,
                            double seconds);

/* Whether drape_contact_check would refuse a step that ends at x and time t because of a pair of features, at
 * its end or on its path. */
bool drape_contact_crosses(drape_contact *contact, const double *x, double t, drape_reason *reason,
                           drape_diagnostic *diagnostic);

/* Compares the end of a step, x at time t, with its beginning: DRAPE_OK, or DRAPE_RETRY_REJECTED if a
 * pair is nearer than the least gap, and than before ("penetration"), or came nearer than half of that on
 * the path ("collision"). */
drape_status drape_contact_check(drape_contact *contact, const double *x, double t, drape_reason *reason,
                                 drape_diagnostic *diagnostic);

/* The nearest active pair at the last point, which may be why the equations of a step have no solution. */
bool drape_contact_nearest(const drape_contact *contact, drape_diagnostic *diagnostic);

/* The number of active contacts at the last point, and their smallest gap [m], INFINITY if there are none. */
int32_t drape_contact_active(const drape_contact *contact, double *least_gap);

#endif
