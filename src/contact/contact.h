/*
 * contact.h: the forces of contact of cloth with colliders and with itself, their derivatives, and
 * continuous collision detection. Contact is a part of the system (assemble/system.h): it is evaluated at
 * points like a term, but which nodes it couples changes as they move.
 *
 * Candidate pairs are searched again when a point has moved farther than the margin of the last search.
 * Which of them are active, and in which order, depends on the positions alone: the result does not depend
 * on when the search was made.
 */
#ifndef DRAPE_CONTACT_CONTACT_H
#define DRAPE_CONTACT_CONTACT_H

#include "base/archive.h"
#include "model/motion.h"

typedef struct drape_contact drape_contact;

/* The point at which contact is evaluated. Colliders have their poses at time t; they move with their mean
 * velocity from span[0] to span[1], or rest if these are equal. */
typedef struct drape_contact_at {
    const double *x, *v; /* (node_count x 3); v NULL: at rest */
    double t, span[2];   /* [s] */
} drape_contact_at;

/* *out is NULL for a model without colliders and without self-contact. Contact takes all its memory from
 * the arena, later as well, and is freed with it. Errors: DRAPE_E_MEMORY. */
drape_status drape_contact_create(drape_arena *arena, const drape_motion *motion, drape_contact **out);
double drape_contact_seconds(const drape_contact *contact);        /* spent in all functions of this header */
double drape_contact_search_seconds(const drape_contact *contact); /* part of it: in the broad phase */

/* Begins a step at the state x, v at time t: lagged friction takes its normal forces here, and the end of
 * the step is compared with it. The arrays are copied. Errors: DRAPE_E_MEMORY. */
drape_status drape_contact_begin(drape_contact *contact, const double *x, const double *v, double t);

/* Ends the step. Queries until the next one do not change the candidates of steps, so the bits of steps do
 * not depend on queries. */
void drape_contact_end(drape_contact *contact);

/* Finds the active contacts at a point, where the functions below then evaluate forces, energy and
 * derivatives. Errors: DRAPE_E_MEMORY. */
drape_status drape_contact_evaluate_at(drape_contact *contact, const drape_contact_at *at);

/* Adds the normal forces, friction, or both, to g (node_count x 3). */
void drape_contact_add_forces(drape_contact *contact, bool normal, bool friction, double *g);

/* The forces of the last drape_contact_add_forces on each collider (collider_count x 3) [N], with the sign of
 * g. */
const double *drape_contact_on_colliders(const drape_contact *contact);

double drape_contact_potential(const drape_contact *contact); /* [J] */

/* Adds dg/dx + weight dg/dv, or dg/dv alone, of pairs of free nodes to values in the pattern, which must
 * have their blocks. gauss_newton: adds a positive semidefinite approximation, the Gauss-Newton part of the
 * Hessians of the energy (contact/force.h), and instead of the derivatives of friction a symmetric upper
 * bound of its dg/dv (contact/friction.h). */
void drape_contact_add_jacobian(drape_contact *contact, double weight, bool velocity_only, bool gauss_newton,
                                const drape_pattern *pattern, double *values);

/* Whether the pattern has the blocks of all active contacts. */
bool drape_contact_is_in_pattern(const drape_contact *contact, const drape_pattern *pattern);

/* Lists the pairs of cloth with cloth that are near each other, for a pattern that will hold for a while:
 * four nodes each, valid until the next call. Returns their number; -1: out of memory. */
int32_t drape_contact_list_couplings(drape_contact *contact, const int32_t **nodes);

/* The list made by the last drape_contact_list_couplings, or read from an archive. */
int32_t drape_contact_last_couplings(const drape_contact *contact, const int32_t **nodes);

/* Archives the last search of the steps and the beginning of the step, from which everything else follows. */
void drape_contact_archive(drape_contact *contact, drape_archive *a);

/* The largest step fraction from x to y (node_count x 3) on which no two pieces pass through each other,
 * with a margin; colliders rest in their poses at time t. */
double drape_contact_step_fraction(drape_contact *contact, const double *x, const double *y, double t);

/* The same, and lowers `fraction` (node_count) at each node to the smallest of its pairs. */
double drape_contact_node_fractions(drape_contact *contact, const double *x, const double *y, double t,
                                    double *fraction);

/* Whether two pieces pass through each other on the straight path from the beginning of the step to y,
 * while colliders move straight to their poses at time t. */
bool drape_contact_crosses(drape_contact *contact, const double *y, double t);

/* Compares the end of a step, x at time t, with its beginning: DRAPE_OK, or DRAPE_RETRY_REJECTED if a piece
 * is deeper in a collider than allowed and than before ("penetration"), or passed through another one on the
 * straight path ("collision"). */
drape_status drape_contact_check(drape_contact *contact, const double *x, double t, const char **reason,
                                 drape_diagnostic *diagnostic);

/* The number of active contacts at the last point, and their smallest gap [m], INFINITY if there are none. */
int32_t drape_contact_active(const drape_contact *contact, double *least_gap);

#endif
