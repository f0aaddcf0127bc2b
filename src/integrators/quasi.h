/*
 * quasi.h: a matrix near the Jacobian of an implicit step (newton.h) that costs a fraction of it, for steps of a
 * few inexact Newton iterations:
 *     A = m_w M + C (x) I + sum over pairs [H -H; -H H] + R
 * H: 3 x 3, of measures that depend on the distance of two nodes, positive part, at each update.
 * C: of all other measures, bending above all: one scalar a pair of nodes, constant (scalar.h). Liu, Bouaziz & Kavan
 *    2017 take such a matrix for all terms; on stretching it holds the sheet back across itself, by thousands of
 *    times its inertia, and ten iterations do not undo that.
 * R: energies and dissipation that are of no measure, and contact, as they are.
 *
 * It is solved by conjugate gradients with two parts added: the inverse of the diagonal blocks, and the
 * inverse of the matrix on a coarse space (solvers/prolong.h), which carries what the whole sheet does together:
 * 3 to 6 iterations a digit at any size.
 */
#ifndef DRAPE_INTEGRATORS_QUASI_H
#define DRAPE_INTEGRATORS_QUASI_H

#include "assemble/system.h"

typedef struct drape_quasi drape_quasi;

/* For a system with at least one free node. spacing: edges between the centres of the coarse functions; 0: by the
 * number of nodes. Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER. */
drape_status drape_quasi_create(drape_context *ctx, drape_system *system, int spacing, drape_quasi **out);
void drape_quasi_destroy(drape_quasi **quasi);

/* The matrix at a point. > 0: it has no factors on the coarse space. Errors: DRAPE_E_MEMORY, where contact couples
 * what it did not before. */
drape_status drape_quasi_update(drape_quasi *quasi, const drape_point *point, double mass_weight);

/* x = A^-1 b (free DOFs) until the residual falls to a share `tolerance`, in the norm of the preconditioner.
 * Returns the iterations. */
int drape_quasi_solve(drape_quasi *quasi, const double *b, double *x, double tolerance, int max_iterations);

/* y = A x, for tests. */
void drape_quasi_multiply(const drape_quasi *quasi, const double *x, double *y);

/* What it keeps from update to update. */
void drape_quasi_archive(drape_quasi *quasi, drape_archive *a);

int32_t drape_quasi_coarse_nodes(const drape_quasi *quasi);
int64_t drape_quasi_factorizations(const drape_quasi *quasi);
double drape_quasi_factor_seconds(const drape_quasi *quasi);
size_t drape_quasi_bytes(const drape_quasi *quasi);

#endif
