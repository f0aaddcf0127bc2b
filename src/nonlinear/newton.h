/*
 * newton.h: solves a step equation to a tolerance or to the local error of the step by Newton's method, with
 * KINSOL. The comment at the top of newton.c describes an iteration, and which parts of it are KINSOL's.
 */
#ifndef DRAPE_NONLINEAR_NEWTON_H
#define DRAPE_NONLINEAR_NEWTON_H

#include "base/param.h"
#include "nonlinear/matrix.h"
#include "nonlinear/step_equation.h"
#include "solvers/linear.h"

/* Indices of the parameters of integrators that use Newton's method, in drape_newton_params and in arrays of
 * their values. */
enum {
    DRAPE_NEWTON_DT,
    DRAPE_NEWTON_TOLERANCE,
    DRAPE_NEWTON_NORM, /* a drape_norm */
    DRAPE_NEWTON_MAX_ITERATIONS,
    DRAPE_NEWTON_GLOBALIZATION,
    DRAPE_NEWTON_LINEAR_SOLVER,
    DRAPE_NEWTON_PARAM_COUNT
};

/* Their choices, NULL-ended. */
extern const char *const drape_newton_norms[];
extern const char *const drape_newton_globalizations[];

/* The list of an integrator without parameters of its own. */
extern const drape_param drape_newton_params[DRAPE_NEWTON_PARAM_COUNT];

/* The default of tolerance, which residual_bound.h derives. */
#define DRAPE_TOLERANCE_WORDS "3e-4 of the load of each node"

#define DRAPE_TOLERANCE_PARAM                                                                                \
    DRAPE_NUMBER("tolerance", "N", DRAPE_DERIVED(DRAPE_TOLERANCE_WORDS), DRAPE_ABOVE(0), 1e12,               \
                 "bound on the residual of the free nodes, measured by norm; at most 1 % of their load. By " \
                 "default be and bdf2 with globalization work also end a solve when what is left is small "  \
                 "beside the local error of the step; newton_k ends by its error")

/* The beginning of the list of an integrator with further parameters, the first of which has the index
 * DRAPE_NEWTON_PARAM_COUNT. Each parameter is one value, so these are also the indices of the values. */
#define DRAPE_NEWTON_PARAMS                                                                                  \
    [DRAPE_NEWTON_DT] = DRAPE_NUMBER("dt", "s", 1.0 / 60, DRAPE_ABOVE(0), 1e6, "nominal step"),              \
    [DRAPE_NEWTON_TOLERANCE] = DRAPE_TOLERANCE_PARAM,                                                        \
    [DRAPE_NEWTON_NORM] =                                                                                    \
        DRAPE_CHOICE("norm", DRAPE_NORM_MAX, drape_newton_norms,                                             \
                     "norm of the residual: largest component, sum, or root of the sum of squares"),         \
    [DRAPE_NEWTON_MAX_ITERATIONS] =                                                                          \
        DRAPE_INTEGER("max_iterations", "1", 50, 1, 100000, "Newton iterations before the attempt fails"),   \
    [DRAPE_NEWTON_GLOBALIZATION] = DRAPE_CHOICE(                                                             \
        "globalization", DRAPE_NEWTON_GLOBAL_AUTO, drape_newton_globalizations,                              \
        "none: full Newton steps, failures go to the controller; line_search: steps shortened until the "    \
        "residual falls; work: steps shortened until the work of the residual along them falls, with "       \
        "positive matrices after short steps and where the exact one is indefinite; auto: work"),            \
    [DRAPE_NEWTON_LINEAR_SOLVER] = DRAPE_CHOICE("linear_solver", 0, drape_linears_names,                     \
                                                "name of a linear solver", .aliases = drape_linears_aliases)

/* Of integrators that may go on with a state that has not converged (drape_newton_set_lenient), as the code
 * of the DEP report does. */
#define DRAPE_ON_FAILURE_PARAM                                                                               \
    DRAPE_CHOICE("on_failure", 0, drape_newton_failures,                                                     \
                 "accept: continue with an unconverged state, as in the DEP report, and log it")
extern const char *const drape_newton_failures[]; /* reject, accept */

/* Values of globalization. */
enum {
    DRAPE_NEWTON_GLOBAL_LINE_SEARCH,
    DRAPE_NEWTON_GLOBAL_NONE,
    DRAPE_NEWTON_GLOBAL_WORK,
    DRAPE_NEWTON_GLOBAL_AUTO
};

typedef struct drape_newton drape_newton;

/* What a solve may cost, and which rules end it besides that of the residual. */
typedef struct drape_newton_effort {
    int least, most; /* corrections before an error ends it; at which it ends in any case */
    bool by_error;   /* it ends by the local error of the step, where the equation has one (stopping.h) */
    /* [m] it also ends when what is left is estimated as at most this, RMS over all nodes, and as small
     * beside the local error; 0: no */
    double error;
    double deadline; /* [s of drape_clock_seconds] after which no correction is begun beyond the least and, in
                        contact, some more; INFINITY: none */
    bool keeps;      /* when all is spent, what is nearer than the guess is accepted */
    double linear_tolerance; /* relative residual that iterative solvers leave in a correction */
    /* Of a matrix of matrix.h: the most iterations of conjugate gradients in a correction; cheap: corrections
     * are by the approximate matrix, if there is one besides the usual one, and without friction. */
    int linear_iterations;
    bool cheap;
} drape_newton_effort;

/* values: of the parameters; dt: nominal step [s] for which an approximate matrix is chosen (matrix.h), 0:
 * the matrix is the exact Jacobian. The equation and the arena must outlive it. Errors: DRAPE_E_MEMORY,
 * DRAPE_E_SOLVER; even then drape_newton_destroy must be called, to free what SUNDIALS and the linear
 * solver took. */
drape_status drape_newton_create(drape_arena *arena, drape_step_equation *equation, const double *values,
                                 double dt, drape_newton **out);
void drape_newton_destroy(drape_newton **newton);

/* Solves the equation for d (free DOFs; on entry the guess). effort NULL: as the parameters say. DRAPE_OK:
 * the residual at d is within the tolerance, in the requested norm, or one of the other rules of stopping.h
 * and the settings holds, which the report names. > 0: none does, and the report says why; report->usable if
 * the settings ask to continue nevertheless. In both cases the equation was evaluated last at d. */
drape_status drape_newton_solve(drape_newton *newton, const drape_newton_effort *effort, double *d,
                                drape_solve_report *report);

/* J at a point with the given mass weight, in the pattern that the system has there; valid until the next
 * solve. The factors are discarded. Errors: DRAPE_E_MEMORY. */
drape_status drape_newton_matrix(drape_newton *newton, const drape_point *point, double mass_weight,
                                 const drape_pattern **pattern, const double **values);

/* The parameter values it was made with, in the order of drape_newton_params; the tolerance as it is used. */
const double *drape_newton_values(const drape_newton *newton);

/* Whether a report says that a state which has not converged is usable. */
void drape_newton_set_lenient(drape_newton *newton, bool lenient);

/* The bound on the residual of the next solves [N]. */
void drape_newton_set_tolerance(drape_newton *newton, double tolerance);

/* Archives what is kept between solves, and the equation's work. */
void drape_newton_archive(drape_newton *newton, drape_archive *a);

size_t drape_newton_bytes(const drape_newton *newton); /* outside of its arena */

#endif
