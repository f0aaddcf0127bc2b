/*
 * force.h: energy and friction of one contact of up to four points, with exact derivatives. A gap s has the
 * energy and the normal force
 *     E = m K d b(s / d)                  [J],  lambda = -m K b'(s / d)      [N]
 * with d the activation distance, K the stiffness times an area [N], m the mollifier of nearly parallel edges
 * (Li et al. 2020, eq. 24). Friction acts against the relative tangential velocity u_t of the closest points
 * (eq. 15 to 17 there, with velocities in place of displacements over a step):
 *     g_i = c_i mu lambda f(|u_t|/eps) u_t/|u_t|,   f(y) = 2 y - y^2 for y < 1, else 1.
 */
#ifndef DRAPE_CONTACT_FORCE_H
#define DRAPE_CONTACT_FORCE_H

#include <stdbool.h>

/* How the gap of a contact changes with its points. Column 3 i + k is coordinate k of point i. */
typedef struct drape_gap {
    int points;       /* 1 to 4 */
    double value;     /* [m] */
    double c[4];      /* weights of the points in the relative motion */
    double normal[3]; /* d gap / dx_i = c_i normal */
    double dc[4][12]; /* dc/dx */
    double dn[3][12]; /* d normal / dx */
    bool mollified;   /* m, dm, ddm are set; else m = 1 */
    double m, dm[12], ddm[12][12];
} drape_gap;

/* Its constants. */
typedef struct drape_contact_law {
    double distance;  /* d [m] */
    double stiffness; /* K [N] */
    double friction;  /* mu [1] */
    double velocity;  /* eps [m/s] */
} drape_contact_law;

/* The mollifier of edges 0 1 and 2 3 as a function of q = |e1 x e2|^2: m = q/w (2 - q/w) below w, 1 above.
 * derivatives: fill dm and ddm too. */
void drape_mollify(double x[4][3], double w, bool derivatives, drape_gap *gap);

double drape_contact_energy(const drape_gap *gap, const drape_contact_law *law);
double drape_contact_normal_force(const drape_gap *gap, const drape_contact_law *law);

/* g (12), h (12 x 12) are overwritten; h may be NULL, and then only value, c, normal, m and dm are read. */
void drape_contact_normal(const drape_gap *gap, const drape_contact_law *law, double *g, double *h);

/* The positive semidefinite part of h that is known without eigenvalues: m K/d b'' dgap dgap'. */
void drape_contact_positive(const drape_gap *gap, const drape_contact_law *law, double *h);

/* The friction with normal force lambda at velocities v of the points: g (12), dg/dv (12 x 12), dg/dx at fixed
 * lambda, c and normal being zero. dgdv may be NULL. */
void drape_contact_friction(const drape_gap *gap, const drape_contact_law *law, double lambda, double v[4][3],
                            double *g, double *dgdv);

/* A symmetric matrix above dg/dv: c_i c_j mu lambda f(y)/|u_t| (I - n n'). What slides is stiff in it the way it goes
 * too, so that a step by it does not turn its friction round. */
void drape_contact_friction_bound(const drape_gap *gap, const drape_contact_law *law, double lambda,
                                  double v[4][3], double *dgdv);

/* Adds to dgdx (12 x 12) how that friction changes with lambda, c and normal. */
void drape_contact_friction_slope(const drape_gap *gap, const drape_contact_law *law, double v[4][3],
                                  double *dgdx);

#endif
