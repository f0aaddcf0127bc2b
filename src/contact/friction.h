/*
 * friction.h: friction of one contact of up to four points, with exact derivatives. It opposes the relative
 * tangential velocity u_t of the closest points (Li et al. 2020, eq. 15 to 17, with velocities instead of
 * displacements over a step):
 *     g_i = c_i mu lambda f(|u_t|/eps) u_t/|u_t|,   f(y) = 2 y - y^2 for y < 1, else 1
 * with the normal force lambda at the same point (restitution.h) or, lagged, at the beginning of the step.
 */
#ifndef DRAPE_CONTACT_FRICTION_H
#define DRAPE_CONTACT_FRICTION_H

#include "contact/restitution.h"

/* At velocities v of the points: g (12) and, unless it is NULL, dg/dv (12 x 12). dg/dx is zero for fixed
 * lambda, c and normal. */
void drape_friction_force(const drape_gap *gap, const drape_contact_law *law, double lambda, double v[4][3],
                          double *g, double *dgdv);

/* A symmetric upper bound of dg/dv (in the Loewner order): c_i c_j mu lambda f(y)/|u_t| (I - n n'). Unlike
 * dg/dv the bound is as stiff along the sliding velocity as across it, so that a step that is computed with
 * it does not reverse the friction. */
void drape_friction_bound(const drape_gap *gap, const drape_contact_law *law, double lambda, double v[4][3],
                          double *dgdv);

/* Derivatives of friction that is not lagged, added to dg (12 x 12): for a change dlambda (12) of the normal
 * force, and by x through c and the normal. */
void drape_friction_add_normal(const drape_gap *gap, const drape_contact_law *law, const double *dlambda,
                               double v[4][3], double *dg);
void drape_friction_add_dgdx(const drape_gap *gap, const drape_gap_derivatives *derivatives,
                             const drape_contact_law *law, double lambda, double v[4][3], double *dg);

#endif
