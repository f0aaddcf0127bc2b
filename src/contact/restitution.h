/*
 * restitution.h: the normal force of one contact of up to four points, which returns a share of the energy
 * of an impact, with exact derivatives:
 *     N = lambda (1 - kappa f(u/eps)),   kappa = (1 - e^2)/(1 + e^2),
 *     f(y) = 2 y - y |y| for |y| < 1,    sign(y) beyond
 * with lambda the force of the barrier (law.h), u the rate of the gap, e the coefficient of restitution and
 * eps the restitution velocity. Damping in proportion to the elastic force is that of Hunt and Crossley 1975
 * (Coefficient of restitution interpreted as damping in vibroimpact, J. Appl. Mech. 42); f, which is that
 * of friction (friction.h), bounds it:
 *   - N >= 0 because kappa <= 1, so a contact never holds pieces together;
 *   - N = lambda at rest, so equilibria do not depend on e;
 *   - the dissipated power kappa f lambda u is at least 0 for either sign of u;
 *   - beyond eps N is 2/(1 + e^2) lambda in approach and e^2 times that in separation, so an impact much
 *     faster than eps returns e^2 of its energy, for every barrier: e is the energetic coefficient of
 *     Stronge 1990 (Rigid body collisions with friction, Proc. R. Soc. A 431);
 *   - with e = 0 no separation that the barrier drives is faster than eps.
 * The mollifier of nearly parallel edges multiplies lambda; the forces along its own gradient are elastic.
 */
#ifndef DRAPE_CONTACT_RESTITUTION_H
#define DRAPE_CONTACT_RESTITUTION_H

#include "contact/law.h"

/* f(speed/eps)/speed [s/m], for a speed of at least 0; also that of friction. */
static inline double drape_secant_of_speed(double speed, double eps)
{
    return speed < eps ? (2 - speed / eps) / eps : 1 / speed;
}

typedef struct drape_normal {
    double lambda; /* [N] */
    double share;  /* kappa f(u/eps): the dissipative share of lambda; 0 if e = 1 */
    double slope;  /* its derivative by u [s/m], >= 0 */
    double secant; /* share/u [s/m], >= slope/2: for the symmetric bound, as for friction */
} drape_normal;

/* The derivatives by x of lambda and of u, (3 points) each. */
typedef struct drape_normal_derivatives {
    double lambda[12], rate[12];
} drape_normal_derivatives;

/* v: of the points, relative to the collider if the contact is with a surface. */
drape_normal drape_normal_at(const drape_gap *gap, const drape_contact_law *law, double v[4][3]);
void drape_normal_derive(const drape_gap *gap, const drape_gap_derivatives *derivatives,
                         const drape_contact_law *law, double v[4][3], drape_normal_derivatives *out);

static inline double drape_normal_force(const drape_normal *normal) /* N [N] */
{
    return normal->lambda * (1 - normal->share);
}

/* dn = weight dN/dv (12), overwritten; dn += dN/dx. */
void drape_normal_by_v(const drape_gap *gap, const drape_normal *normal, double weight, double *dn);
void drape_normal_add_by_x(const drape_gap *gap, const drape_normal *normal,
                           const drape_normal_derivatives *derivatives, double *dn);

/* g = the dissipative part of the force (12), overwritten. */
void drape_restitution_force(const drape_gap *gap, const drape_normal *normal, double *g);

/* h += slope lambda dgap dgap' (12 x 12), which is positive semidefinite: dg/dv of the dissipative part if
 * slope is that of the normal, and an upper bound of it if slope is the secant. */
void drape_restitution_add_dgdv(const drape_gap *gap, const drape_normal *normal, double slope, double *h);

/* h += dg/dx of the dissipative part (12 x 12). */
void drape_restitution_add_dgdx(const drape_gap *gap, const drape_gap_derivatives *derivatives,
                                const drape_normal *normal, const drape_normal_derivatives *by_x, double *h);

#endif
