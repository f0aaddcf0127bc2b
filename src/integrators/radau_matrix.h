/*
 * radau_matrix.h: the linear systems of Radau IIA's simplified Newton iteration, reduced to the positions.
 * The inverse of the matrix of coefficients A has one real eigenvalue gamma and one pair alpha +- i beta. In
 * its basis the three stages, with the mass M and the symmetric parts K of dg/dx and D of dg/dv at one point,
 * fall apart into
 *     P = K + (gamma/h) D + (gamma/h)^2 M,     C = K + mu D + mu^2 M,  mu = (alpha + i beta)/h.
 *
 * P is the matrix of a backward Euler step of size h/gamma and is factored. C is not: C = P + (mu - gamma/h)
 * D + (mu^2 - (gamma/h)^2) M, and P^-1 C x = P^-1 b is solved by GMRES (Saad & Schultz 1986), of which an
 * iteration is one solve with the factors of P for the real part and one for the imaginary part. For
 * positive semidefinite K and D every Rayleigh quotient of P^-1 C in the inner product of P is a mean of 1,
 * h mu/gamma and (h mu/gamma)^2, which lie at angles of 0, 49 and 97 degrees: the field of values is in a
 * triangle at a distance of 0.73 from 0, whatever the mesh, the stiffness, the damping and h. Without damping
 * it is a segment, and the residual falls by .46 in each iteration: 6 take it to 1e-2.
 *
 * On sheets of 13 x 13 to 50 x 50 nodes these 14 solves take the time of 2.4 to 0.9 factorisations of P. C as
 * a real matrix of 2 n rows, symmetric and quasidefinite once it is multiplied by a phase, takes 6.5 to 8.5
 * of them for its factors, and each solution 4.5 to 12 solves with P; by KLU the factors take 50 to 100.
 */
#ifndef DRAPE_INTEGRATORS_RADAU_MATRIX_H
#define DRAPE_INTEGRATORS_RADAU_MATRIX_H

#include "nonlinear/system_matrix.h"

#define DRAPE_RADAU_GAMMA 3.637834252744495732
#define DRAPE_RADAU_ALPHA 2.681082873627752134
#define DRAPE_RADAU_BETA  3.050430199247410569

typedef struct drape_radau_matrix {
    drape_system *system;
    drape_system_matrix *linear; /* P, K and, if something dissipates, D */
    int64_t n;                   /* free DOFs */
    double *mass;                /* (n) [kg] */
    double h;                    /* [s] of the factors; 0: there are none of the present K and D */
    double *basis;               /* of GMRES (vectors + 1, n real parts and n imaginary parts) */
    double *image;               /* (2 n) */
} drape_radau_matrix;

/* Errors: DRAPE_E_MEMORY, those of the linear solver; after one it must still be destroyed. */
drape_status drape_radau_matrix_create(drape_arena *arena, drape_system *system, const drape_linear_ops *ops,
                                       drape_radau_matrix *matrix);
void drape_radau_matrix_destroy(drape_radau_matrix *matrix);

/* Computes K and D, in a pattern with the contacts at this point; with point->contact
 * DRAPE_CONTACT_GAUSS_NEWTON, D has the upper bounds of restitution and friction. Errors: DRAPE_E_MEMORY and
 * those of the linear solver's create. */
drape_status drape_radau_matrix_evaluate(drape_radau_matrix *matrix, const drape_point *point);

/* Factors P, unless that was done for this h. */
drape_status drape_radau_matrix_factor(drape_radau_matrix *matrix, double h);

/* x = P^-1 b (n); x = C^-1 b, real parts and then imaginary parts (2 n), up to a residual P^-1 (b - C x) of
 * `tolerance` times the initial one in the norm of M. DRAPE_RETRY_LINEAR: P has no factors, or GMRES does not
 * converge. */
drape_status drape_radau_matrix_solve(drape_radau_matrix *matrix, const double *b, double *x);
drape_status drape_radau_matrix_solve_complex(drape_radau_matrix *matrix, const double *b, double tolerance,
                                              double *x);

/* y += D x */
void drape_radau_matrix_add_damping(const drape_radau_matrix *matrix, const double *x, double *y);

void drape_radau_matrix_archive(drape_radau_matrix *matrix, drape_archive *a);
size_t drape_radau_matrix_bytes(const drape_radau_matrix *matrix);

#endif
