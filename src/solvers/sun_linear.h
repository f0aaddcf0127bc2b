/*
 * sun_linear.h: a linear solver as SUNDIALS sees it: a custom SUNLinearSolver and a custom
 * SUNMatrix over our own values. SUNDIALS initialises the solver at each solve, clears the matrix before each
 * Jacobian; for ours both do nothing, so analysis and pattern are kept for good and nothing allocates
 * (solvers.md of the design notes: KLU's own wrapper analyses afresh at each KINSol).
 */
#ifndef DRAPE_SOLVERS_SUN_LINEAR_H
#define DRAPE_SOLVERS_SUN_LINEAR_H

#include "solvers/linear.h"
#include "solvers/sundials_compat.h"

#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>

typedef struct drape_sun_linear {
    drape_arena arena; /* holds values and state */
    const drape_linear_ops *ops;
    void *state;
    bool stale;  /* the system's pattern has changed since: the solver must extend its own before it is used
                   again */
    void *owner; /* for an integrator that reduces its system to this one before it solves */
    double *values;               /* (nonzeros) where the Jacobian is assembled */
    const drape_pattern *pattern; /* of the matrix */
    int64_t nonzeros;
    SUNLinearSolver solver;
    SUNMatrix matrix;
    drape_pool *pool;                   /* NULL: one thread */
    double tolerance;                   /* share of the residual that iterative solvers may leave; 0: none */
    int64_t factorizations, iterations; /* of iterative solvers; for direct ones, solves */
    double factor_seconds, solve_seconds;
    drape_status status; /* of the last factor or solve */
} drape_sun_linear;

drape_status drape_sun_linear_create(drape_arena *arena, SUNContext sun, const drape_linear_ops *ops,
                                     const drape_pattern *pattern, drape_pool *pool, drape_sun_linear **out);

/* Takes another pattern: the values are cleared, the solver is made again. Errors: those of create; then it
 * can only be destroyed, or take a pattern again. */
drape_status drape_sun_linear_extend_pattern(drape_sun_linear *linear, const drape_pattern *pattern);
/* The same, unless it is the pattern that it has. */
drape_status drape_sun_linear_ensure_pattern(drape_sun_linear *linear, const drape_pattern *pattern);
void drape_sun_linear_destroy(drape_sun_linear **linear); /* before the arena is freed */

/* Bytes that libraries took beside the arena. */
size_t drape_sun_linear_bytes(const drape_sun_linear *linear);

/* The work done and the state of the solver; factors: the present factors will be used again. It is read into
 * a solver made for the same pattern. */
void drape_sun_linear_archive(drape_sun_linear *linear, drape_archive *a, bool factors);

/* Factors the values, time and work counted: what the SUNLinearSolver does. definite: refuses a matrix that
 * is not positive definite with DRAPE_RETRY_LINEAR, if the solver can tell. */
drape_status drape_sun_linear_factor(drape_sun_linear *linear, bool definite);

/* x = A^-1 b with the factors there are, time and work counted: what the SUNLinearSolver does. */
drape_status drape_sun_linear_solve(drape_sun_linear *linear, const double *b, double *x);

#endif
