/*
 * sun_linear.h: a linear solver as SUNDIALS sees it: a custom SUNLinearSolver and a custom SUNMatrix over
 * our own values. SUNDIALS initialises the solver at each solve and clears the matrix before each Jacobian;
 * both do nothing here, so the analysis and the pattern are kept and nothing is allocated. (KLU's own
 * wrapper in SUNDIALS repeats the analysis in each KINSol.)
 */
#ifndef DRAPE_SOLVERS_SUN_LINEAR_H
#define DRAPE_SOLVERS_SUN_LINEAR_H

#include "solvers/linear.h"
#include "solvers/refine.h"
#include "solvers/sundials_compat.h"

#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>

/* A SUNLinearSolver and a SUNMatrix of which SUNDIALS calls the setup and the solve alone. */
typedef struct drape_sun_shell {
    SUNLinearSolver solver;
    SUNMatrix matrix;
} drape_sun_shell;

/* Errors: DRAPE_E_MEMORY; even then it must be destroyed. */
drape_status drape_sun_shell_create(drape_context *ctx, SUNContext sun, void *content,
                                    int (*setup)(SUNLinearSolver, SUNMatrix),
                                    int (*solve)(SUNLinearSolver, SUNMatrix, N_Vector, N_Vector, sunrealtype),
                                    drape_sun_shell *shell);
void drape_sun_shell_destroy(drape_sun_shell *shell);

typedef struct drape_sun_linear {
    drape_arena arena; /* holds values and state */
    const drape_linear_ops *ops;
    void *state;
    bool stale;     /* the system's pattern has changed: extend the solver's before its next use */
    void *owner;    /* for an integrator that reduces its system to this one before solving */
    double *values; /* (nonzeros) where the Jacobian is assembled */
    double
        *positions; /* (n) scratch of drape_sun_linear_set_positions; NULL: the solver has no use for them */
    const drape_pattern *pattern; /* of the values */
    bool near;     /* the matrix that is factored may be another one than that which is solved with: */
    bool corrects; /* `values` are near `exact`, and solves are corrected to `correction_tolerance` */
    double *exact; /* (nonzeros) NULL unless `near` */
    double correction_tolerance; /* of |b|, left in the residual of a corrected solve */
    drape_refine refine;         /* the workspace of these solves */
    int64_t nonzeros;
    drape_sun_shell shell;
    drape_pool *pool;                   /* NULL: one thread */
    const atomic_bool *const *cancel;   /* see drape_linear_ops.watch */
    double tolerance;                   /* relative residual that iterative solvers may leave; 0: none */
    int64_t factorizations, iterations; /* of iterative solvers; of direct ones, solves */
    double factor_seconds, solve_seconds;
    drape_status status; /* of the last factor or solve */
} drape_sun_linear;

drape_status drape_sun_linear_create(drape_arena *arena, SUNContext sun, const drape_linear_ops *ops,
                                     const drape_pattern *pattern, drape_pool *pool,
                                     const atomic_bool *const *cancel, drape_sun_linear **out);

/* Replaces the pattern: the values are cleared, the solver is created again. Errors: those of create; after
 * one it can only be destroyed, or be given a pattern again. */
drape_status drape_sun_linear_extend_pattern(drape_sun_linear *linear, const drape_pattern *pattern);
/* The same, unless it has this pattern already. */
drape_status drape_sun_linear_ensure_pattern(drape_sun_linear *linear, const drape_pattern *pattern);

/* From now on A may be solved with by the factors of a nearby matrix: drape_sun_linear_keep_exact. Takes
 * memory. Errors: DRAPE_E_MEMORY, after which it can only be destroyed. */
drape_status drape_sun_linear_use_near(drape_sun_linear *linear, double tolerance);

/* The present values are A. The caller changes them into those of a nearby matrix, factors that one, and
 * solves with A: by GMRES, preconditioned by the factors (refine.h), until the residual is within the
 * tolerance or a cycle has ended. It lasts until drape_sun_linear_forget_exact. */
void drape_sun_linear_keep_exact(drape_sun_linear *linear);
void drape_sun_linear_forget_exact(drape_sun_linear *linear);

/* Tells the solver where the nodes of the next matrix are. x (nodes x 3) [m]; node: of each block. */
void drape_sun_linear_set_positions(drape_sun_linear *linear, const double *x, const int32_t *node);

void drape_sun_linear_destroy(drape_sun_linear **linear); /* call it before the arena is freed */

/* Bytes that libraries took outside the arena; 0 for NULL. */
size_t drape_sun_linear_bytes(const drape_sun_linear *linear);

/* Archives the counted work and the state of the solver; `factors`: the present factors will be used again.
 * Reads into a solver created for the same pattern. */
void drape_sun_linear_archive(drape_sun_linear *linear, drape_archive *a, bool factors);

/* Factors the values and counts time and work; the SUNLinearSolver calls it. definite: refuses a matrix
 * that is not positive definite with DRAPE_RETRY_LINEAR, if the solver can tell. */
drape_status drape_sun_linear_factor(drape_sun_linear *linear, bool definite);

/* x = A^-1 b with the present factors, counting time and work; the SUNLinearSolver calls it. */
drape_status drape_sun_linear_solve(drape_sun_linear *linear, const double *b, double *x);

#endif
