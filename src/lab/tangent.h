/*
 * tangent.h: the exact stiffness of a sim's present state, about which modes are computed: K = d2E/dx2 over
 * the free nodes, with the nodes at rest, so that only stiffness is in it; and how K changes with the loads.
 * The loads are the scene's external terms (drape_term_ops.external), all multiplied by the same factor. At
 * the time 0 of a sim they have the values that the scene gives, even if they rise from 0 in time; later on
 * those of the time.
 */
#ifndef DRAPE_LAB_TANGENT_H
#define DRAPE_LAB_TANGENT_H

#include "sim/sim.h"
#include "solvers/linear.h"

typedef struct lab_tangent {
    drape_context *ctx;
    const drape_sim *sim;
    drape_system *system; /* of its own: reading leaves no trace in the sim's */
    const drape_pattern *pattern;
    double *mass;      /* (n) [kg] of each degree of freedom */
    double *values;    /* (pattern.nonzeros) K [N/m] at the load factor that it was opened for */
    double force;      /* [N] the largest force on a free node there; 0 in an equilibrium */
    double *zero;      /* (nodes x 3) velocities */
    double *scratch;   /* (pattern.nonzeros) */
    double *nodes;     /* (2 x nodes x 3) scratch */
    bool *dissipative; /* (term_count) terms such as drag in the wind: they have no part in an equilibrium or
                          in K */
    bool *without;     /* (term_count) these, and the loads */
    bool *potential;   /* (term_count) all but loads without a potential */
    bool follows;      /* there are such loads */
    bool linear;       /* no load has a part in K */
    double factor;     /* of the loads */
    bool full;         /* loads have the values that the scene gives, whatever they are at this time */
    const drape_linear_ops *solver;
    void *factors;     /* of the solver */
    drape_arena arena; /* of all arrays, also those of the caller */
} lab_tangent;

/* Evaluates K, and creates a solver for matrices of its pattern. The caller closes the tangent in any case.
 * needs_potential: refuses a K that is not symmetric. Errors: DRAPE_E_MEMORY; DRAPE_E_ARGUMENT (no free node,
 * or such a K); DRAPE_E_SOLVER (K is not finite). */
drape_status lab_tangent_open(drape_sim *sim, double factor, bool needs_potential, lab_tangent *tangent);
void lab_tangent_close(lab_tangent *tangent);

/* At nodes x (nodes x 3), with the internal variables of the sim's present state, and a factor of the loads:
 * force (n) = dE/dx on free nodes; load (n) = the part of it that belongs to the loads at factor 1; values
 * (pattern.nonzeros) = K; any of them may be NULL. Returns the largest force on any node, pinned ones too,
 * without the loads [N]. All may be not finite. */
double lab_tangent_evaluate(const lab_tangent *tangent, const double *x, double factor, double *force,
                            double *load, double *values);

/* Whether a K is symmetric within rounding, as that of loads with a potential is: then it becomes so to the
 * bit. */
bool lab_tangent_is_symmetric(const lab_tangent *tangent, double *values);

/* Factors a symmetric matrix of the pattern if it is positive definite; *definite: it is. A Cholesky
 * factorisation finds that of matrices whose inertia is too inexact to be counted. Errors: DRAPE_E_MEMORY,
 * DRAPE_E_STOPPED, DRAPE_E_SOLVER. */
drape_status lab_tangent_factor_definite(const lab_tangent *tangent, const double *values, bool *definite);

/* x = A^-1 b by the factors of the last matrix. Returns the status of the solver. */
drape_status lab_tangent_solve(const lab_tangent *tangent, double *b, double *x);

/* y = A x for a symmetric matrix in the pattern. */
void lab_tangent_multiply(const lab_tangent *tangent, const double *values, const double *x, double *y);

/* to = K + share M, or K + share G for another matrix of the pattern. */
void lab_tangent_shift(const lab_tangent *tangent, double share, const double *other, double *to);

/* values (pattern.nonzeros) = dK/dfactor [N/m] along the path of equilibria, whose nodes move by u (n) [m]
 * per unit of the factor: by central differences of K, which is exact in x and in the factor. Errors:
 * DRAPE_E_MEMORY; DRAPE_E_ARGUMENT (cloth comes into contact within the difference, or u is 0). */
drape_status lab_tangent_slope(lab_tangent *tangent, const double *u, double *values);

#endif
