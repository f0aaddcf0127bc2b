/* solve_report.h: the report of the solution of a nonlinear system, and the work that it took. */
#ifndef DRAPE_NONLINEAR_SOLVE_REPORT_H
#define DRAPE_NONLINEAR_SOLVE_REPORT_H

#include "base/archive.h"
#include "base/reason.h"
#include "nonlinear/system_matrix.h"

/* How one solve ended. */
typedef struct drape_solve_report {
    drape_reason reason; /* which rule accepted it, or why none did: of base/reason.h */
    int iterations;
    double residual, tolerance; /* [N] */
    bool laborious; /* near the largest number of iterations: a larger step of the same motion might fail */
    double error;   /* [m] estimated RMS distance of the nodes to the solution; NaN: no estimate */
    double left;    /* [J] what is left to gain, estimated likewise (stopping.h) */
    double own;     /* [J] the same measure of the local error of the method; NaN: no estimate */
    bool solved;    /* the solve ended by one of its rules, not because its effort was spent */
    bool by_error;  /* for a cloth that was the local error */
    double further_seconds; /* [s] spent on iterations that only reduced this error */
    /* lenient: the settings have on_failure accept, so states are only checked for numbers that are not
     * finite and for passing through something. usable: the status is > 0, and the settings ask to continue
     * with the result nevertheless. */
    bool lenient, usable;
    drape_diagnostic diagnostic;
} drape_solve_report;

/* Work done so far. */
typedef struct drape_work {
    bool stability_known;   /* of an equilibrium */
    int64_t unstable_modes; /* negative eigenvalues of the Hessian there */
    int64_t newton_iterations, jacobians, factorizations, linear_iterations, residuals;
    double residual_seconds, jacobian_seconds, factor_seconds, solve_seconds, contact_seconds;
} drape_work;

/* The status of a step that a solver ended for a reason of its own. */
drape_status drape_solver_status(drape_reason reason);

/* What a return code of a library of SUNDIALS means. */
typedef struct drape_solver_code {
    int code;
    drape_reason reason;
} drape_solver_code;

/* The meaning of a code in a table of `count`; DRAPE_REASON_SOLVER if it has no such code: no smaller step
 * helps. */
drape_reason drape_solver_reason(const drape_solver_code *codes, size_t count, int code);

/* The counts and times of both, and the equilibrium of `work`. */
drape_work drape_work_sum(drape_work work, const drape_work *other);

/* The same work with what a matrix counts, unless that is NULL. */
drape_work drape_work_with_linear(drape_work work, const drape_system_matrix *matrix);

void drape_work_archive(drape_work *work, drape_archive *a);

#endif
