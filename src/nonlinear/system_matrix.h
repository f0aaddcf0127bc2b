/*
 * system_matrix.h: a matrix in the pattern of a system, and the linear solver that factors it. Contact may
 * couple new nodes at any point: the matrix then takes the new pattern, and its solver is created again.
 *
 * The matrix that is factored may be a symmetric approximation of the matrix A of the equations. Then each
 * solution is corrected by GMRES, preconditioned by the factors (solvers/refine.h), until its residual with A
 * is within a tolerance or a cycle has ended.
 */
#ifndef DRAPE_NONLINEAR_SYSTEM_MATRIX_H
#define DRAPE_NONLINEAR_SYSTEM_MATRIX_H

#include "assemble/system.h"
#include "solvers/linear.h"
#include "solvers/refine.h"

typedef struct drape_system_matrix {
    drape_system *system;
    const drape_linear_ops *ops;
    void *solver;                 /* of ops; NULL: the memory for the last pattern was not there */
    int64_t version;              /* of the system's pattern that the matrix has; -1: none */
    const drape_pattern *pattern; /* that pattern */
    drape_arena arena;            /* of the solver and the arrays */
    double *values;               /* (nonzeros) where the matrix to be factored is assembled */
    int more_count;               /* at most 2 */
    double *more[2];              /* (nonzeros) further matrices, which the solver does not use */
    double *positions;            /* (n) scratch; NULL: the solver has no use for positions */
    double correction_tolerance;  /* of |b|, that GMRES leaves in a residual; 0: it is not used */
    bool corrects;                /* `values` only approximate `exact`: solutions are corrected */
    double *exact;                /* (nonzeros) A; NULL without a correction tolerance */
    drape_refine refine;
    double tolerance;                   /* relative residual that iterative solvers may leave; 0: rounding */
    int64_t factorizations, iterations; /* so far; of direct solvers, solves count as iterations */
    double factor_seconds, solve_seconds;
    drape_status status; /* of the last factor or solve */
} drape_system_matrix;

/* more_count: how many further matrices. The arena and the system must outlive it. Errors: DRAPE_E_MEMORY and
 * those of the solver's create; then *out is NULL. */
drape_status drape_system_matrix_create(drape_arena *arena, drape_system *system, const drape_linear_ops *ops,
                                        int more_count, double correction_tolerance,
                                        drape_system_matrix **out);
void drape_system_matrix_destroy(drape_system_matrix **matrix); /* NULL is allowed */

/* Takes the system's present pattern, unless the matrix has it: all matrices become 0, and there are no
 * factors. Errors: as for create; then the next call tries again. */
drape_status drape_system_matrix_renew(drape_system_matrix *matrix);

/* The same after the system's pattern got the contacts at a point, whose positions the solver gets. Errors:
 * also those of drape_system_extend_pattern. */
drape_status drape_system_matrix_follow(drape_system_matrix *matrix, const drape_point *point);

/* Factors the values. definite: refuses a matrix that is not positive definite with DRAPE_RETRY_LINEAR, if
 * the solver can tell. */
drape_status drape_system_matrix_factor(drape_system_matrix *matrix, bool definite);

/* x = A^-1 b with the present factors. */
drape_status drape_system_matrix_solve(drape_system_matrix *matrix, const double *b, double *x);

/* [s] drape_system_clock without the time of factorisations and analyses, for what assembly takes. */
double drape_system_matrix_clock(const drape_system_matrix *matrix);

/* Bytes that libraries took outside the arena; 0 for NULL. */
size_t drape_system_matrix_bytes(const drape_system_matrix *matrix);

/* Archives the counted work and the state of the solver; `factors`: the present factors will be used again.
 * Reads into a matrix with the system's pattern. */
void drape_system_matrix_archive(drape_system_matrix *matrix, drape_archive *a, bool factors);

#endif
