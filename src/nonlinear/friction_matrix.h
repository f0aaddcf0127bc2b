/*
 * friction_matrix.h: solves E x = b by iterations with a symmetric matrix A near E, for a few inexact Newton
 * iterations in contact with friction:
 *     A  has of contact the Gauss-Newton part and upper bounds of friction and restitution
 *     E  = A + (what the exact Jacobian of contact has beyond that)
 * With A alone, friction follows the normal force only from one iteration to the next: barriers that a guess
 * has pressed too far stop the cloth, and corrections that release it are short, as if it were near its
 * solution. The solver is GMRES preconditioned by A (solvers/refine.h), whose solutions may be inexact.
 */
#ifndef DRAPE_NONLINEAR_FRICTION_MATRIX_H
#define DRAPE_NONLINEAR_FRICTION_MATRIX_H

#include "assemble/system.h"
#include "solvers/pcg.h"
#include "solvers/refine.h"

typedef struct drape_friction_matrix {
    drape_system *system; /* NULL: the model has no friction */
    void *owner;          /* of A */
    drape_pcg_map *multiply;
    drape_preconditioner *solve;
    bool acts;              /* there were active contacts at the last update */
    drape_arena arena;      /* of the arrays of a pattern */
    int64_t version;        /* of that pattern */
    double *values;         /* (nonzeros) of E - A */
    int32_t *column, *slot; /* (blocks) those of E - A that are not 0 */
    int32_t count;
    double *product; /* (n) */
    drape_refine refine;
} drape_friction_matrix;

/* multiply, solve: y = A x and x = A^-1 b, of `owner`. Errors: DRAPE_E_MEMORY; even then
 * drape_friction_matrix_free must be called. */
drape_status drape_friction_matrix_init(drape_arena *arena, drape_system *system, void *owner,
                                        drape_pcg_map *multiply, drape_preconditioner *solve,
                                        drape_friction_matrix *matrix);
void drape_friction_matrix_free(drape_friction_matrix *matrix);

/* Computes E - A at the point for which A was computed, whose pattern has all active contacts. Errors:
 * DRAPE_E_MEMORY, for a new pattern. */
drape_status drape_friction_matrix_update(drape_friction_matrix *matrix, const drape_point *point);

/* x = E^-1 b, and adds the number of iterations; false: no friction acts, or x is not finite or not a
 * direction along which b does work. */
bool drape_friction_matrix_solve(drape_friction_matrix *matrix, const double *b, double *x, int *iterations);

#endif
