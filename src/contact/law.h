/*
 * law.h: energy and normal force of one contact of up to four points, with exact derivatives. A gap s has
 *     E = m K d b(s / d)                  [J],  lambda = -m K b'(s / d)      [N]
 * with d the activation distance, K the stiffness times an area [N], b the barrier (barrier.h) and m the
 * mollifier of nearly parallel edges (gap.h).
 */
#ifndef DRAPE_CONTACT_LAW_H
#define DRAPE_CONTACT_LAW_H

#include "contact/gap.h"

/* The constants of a contact. */
typedef struct drape_contact_law {
    double distance;             /* d [m] */
    double low;                  /* of the barrier, in activation distances */
    double stiffness;            /* K [N] */
    double friction;             /* mu [1] */
    double velocity;             /* eps [m/s] */
    double damping;              /* kappa of restitution.h [1]; 0: elastic */
    double restitution_velocity; /* its eps [m/s] */
} drape_contact_law;

double drape_law_energy(const drape_gap *gap, const drape_contact_law *law);
double drape_law_normal_force(const drape_gap *gap, const drape_contact_law *law);

/* g = dE/dx (12) and h = dg/dx (12 x 12), both overwritten. */
void drape_law_gradient(const drape_gap *gap, const drape_contact_law *law, double *g);
void drape_law_hessian(const drape_gap *gap, const drape_gap_derivatives *derivatives,
                       const drape_contact_law *law, double *h);

/* The Gauss-Newton part of h, m K/d b'' dgap dgap', which is positive semidefinite because b'' > 0: without
 * the curvature of the gap, m K b' ddgap, and the derivatives of the mollifier. */
void drape_law_gauss_newton(const drape_gap *gap, const drape_contact_law *law, double *h);

#endif
