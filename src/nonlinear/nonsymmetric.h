/*
 * nonsymmetric.h: solves E x = b by iterations with a symmetric matrix A near E, for a few inexact Newton
 * iterations with friction, and with drag and loads that follow the cloth:
 *     A  has of contact the Gauss-Newton part and upper bounds of friction and restitution, and of the terms
 *        the symmetric part
 *     E  = A + (what the exact Jacobian of contact has beyond that) + (the antisymmetric part of the terms)
 * With A alone, friction follows the normal force only from one iteration to the next: barriers that a guess
 * has pressed too far stop the cloth, and corrections that release it are short, as if it were near its
 * solution. The solver is GMRES preconditioned by A (solvers/refine.h), whose solutions may be inexact.
 */
#ifndef DRAPE_NONLINEAR_NONSYMMETRIC_H
#define DRAPE_NONLINEAR_NONSYMMETRIC_H

#include "assemble/system.h"
#include "solvers/pcg.h"
#include "solvers/refine.h"

typedef struct drape_nonsymmetric {
    drape_system *system; /* NULL: E is A */
    void *owner;          /* of A */
    drape_pcg_map *multiply;
    drape_preconditioner *solve;
    bool acts;              /* E differed from A at the last update */
    drape_arena arena;      /* of the arrays of a pattern */
    int64_t version;        /* of that pattern */
    double *values;         /* (nonzeros) of E - A */
    int32_t *column, *slot; /* (blocks) those of E - A that are not 0 */
    int32_t count;
    double *product; /* (n) */
    drape_refine refine;
} drape_nonsymmetric;

/* multiply, solve: y = A x and x = A^-1 b, of `owner`. terms: updates have the antisymmetric part of the
 * terms; without, E is A unless the model has friction. Errors: DRAPE_E_MEMORY; even then
 * drape_nonsymmetric_free must be called. */
drape_status drape_nonsymmetric_init(drape_arena *arena, drape_system *system, bool terms, void *owner,
                                     drape_pcg_map *multiply, drape_preconditioner *solve,
                                     drape_nonsymmetric *matrix);
void drape_nonsymmetric_free(drape_nonsymmetric *matrix);

/* Computes E - A at the point for which A was computed, whose pattern has all active contacts. terms
 * (nonzeros): A before it was made symmetric, for the part of the terms; NULL: without. Errors:
 * DRAPE_E_MEMORY, for a new pattern. */
drape_status drape_nonsymmetric_update(drape_nonsymmetric *matrix, const drape_point *point,
                                       const double *terms);

/* x = E^-1 b, and adds the number of iterations; false: E is A, or x is not finite or not a
 * direction along which b does work. */
bool drape_nonsymmetric_solve(drape_nonsymmetric *matrix, const double *b, double *x, int *iterations);

#endif
