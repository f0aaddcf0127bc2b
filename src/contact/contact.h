/*
 * contact.h: the forces of contact of cloth with colliders and with itself, their derivatives, and what keeps
 * steps from passing through. A part of the system (assemble/system.h): it is asked at points like any term,
 * but which pieces it couples changes as they move.
 *
 * Candidates are the pairs that are near; they are searched anew where some point has moved by more than half
 * of what the last search allowed for. Which pairs act depends on the positions alone, and so does their
 * order: the result does not depend on when was searched.
 */
#ifndef DRAPE_CONTACT_CONTACT_H
#define DRAPE_CONTACT_CONTACT_H

#include "base/archive.h"
#include "contact/search.h"
#include "model/motion.h"

typedef struct drape_contact drape_contact;

/* Where contact is evaluated. Colliders stand at time t; they move with their mean velocity from span[0] to
 * span[1], or not at all where these are equal. */
typedef struct drape_contact_at {
    const double *x, *v; /* (node_count x 3); v NULL: at rest */
    double t, span[2];   /* [s] */
} drape_contact_at;

/* *out is NULL for a model without colliders and without self-contact. Errors: DRAPE_E_MEMORY. */
drape_status drape_contact_create(drape_arena *arena, const drape_motion *motion, drape_contact **out);
void drape_contact_destroy(drape_contact **contact);
size_t drape_contact_bytes(const drape_contact *contact);
double drape_contact_seconds(const drape_contact *contact);        /* spent in all functions here */
double drape_contact_search_seconds(const drape_contact *contact); /* of that, in the broad phase */

/* A step begins at the state x, v at time t: lagged friction takes its normal forces here, and what follows
 * is compared with it. The arrays are copied. Errors: DRAPE_E_MEMORY. */
drape_status drape_contact_begin(drape_contact *contact, const double *x, const double *v, double t);

/* The step has ended. Whatever is asked from now on, the next one finds the candidates as this one left them: its bits
 * are the same, whoever looks on. */
void drape_contact_rest(drape_contact *contact);

/* Goes to a point; what follows is asked there. Errors: DRAPE_E_MEMORY (list of candidates). */
drape_status drape_contact_place(drape_contact *contact, const drape_contact_at *at);

/* Adds the normal forces, and friction, to g (node_count x 3). */
void drape_contact_add_forces(drape_contact *contact, bool normal, bool friction, double *g);

/* What the last drape_contact_add_forces put on each collider (collider_count x 3) [N], signed like g. */
const double *drape_contact_on_colliders(const drape_contact *contact);

double drape_contact_potential(drape_contact *contact); /* [J] */

/* Adds dg/dx + weight dg/dv, or dg/dv alone, of pairs of free nodes to values in the pattern, which has them.
 * positive: the positive semidefinite part of the Hessians of the energy, and a symmetric matrix above friction's
 * dg/dv in place of its derivatives. */
void drape_contact_add_jacobian(drape_contact *contact, double weight, bool velocity_only, bool positive,
                                const drape_pattern *pattern, double *values);

/* Whether every pair that acts has its place in the pattern; and the pairs of cloth with cloth that are near,
 * for a pattern that will serve a while: four nodes each, valid until the next call. */
bool drape_contact_fits(drape_contact *contact, const drape_pattern *pattern);
int32_t drape_contact_couplings(drape_contact *contact, const int32_t **nodes);

int32_t drape_contact_coupled(const drape_contact *contact, const int32_t **nodes); /* the list made last */

/* The last search and the beginning of the step, from which all else follows, into an archive or, where this was just
 * made, out of it. */
void drape_contact_archive(drape_contact *contact, drape_archive *a);

/* The largest fraction of the way from x to y, colliders resting where they are at time t, on which no two
 * pieces pass through each other; a margin is kept. x, y: (node_count x 3). */
double drape_contact_way(drape_contact *contact, const double *x, const double *y, double t);

/* Whether something passes through something on the straight way from the beginning of the step to y, colliders
 * going straight to where they are at time t. */
bool drape_contact_crosses(drape_contact *contact, const double *y, double t);

/* Compares a step's end, x at time t, with its beginning: DRAPE_OK, or DRAPE_RETRY_REJECTED where something
 * lies deeper in a collider than allowed and than before ("penetration"), or passed through something on the
 * straight way ("collision"). */
drape_status drape_contact_check(drape_contact *contact, const double *x, double t, const char **reason,
                                 drape_worst *worst);

/* How many pairs of points, edges and faces act where it was last placed, and the smallest gap among them [m], INFINITY without any. */
int32_t drape_contact_active(drape_contact *contact, double *least_gap);

#endif
