/* newton_params.c: the parameters of integrators that use Newton's method. */
#include "nonlinear/newton.h"
#include "solvers/linear.h"

static const char *const norm_choices[] = {
    [DRAPE_NORM_MAX] = "max", [DRAPE_NORM_L1] = "l1", [DRAPE_NORM_L2] = "l2", NULL};
static const char *const failure_choices[] = {"reject", "accept", NULL};
static const char *const method_choices[] = {"exact", "modified", NULL};
static const char *const global_choices[] = {"line_search", "none", "work", "auto", NULL};
static const char *const predictor_choices[] = {"inertial", "rest", NULL};

const drape_param drape_newton_params[DRAPE_NEWTON_PARAM_COUNT] = {
    [DRAPE_NEWTON_DT] = DRAPE_NUMBER("dt", "s", 1.0 / 60, DRAPE_ABOVE(0), 1e6, "nominal step"),
    [DRAPE_NEWTON_TOLERANCE] =
        DRAPE_NUMBER("tolerance", "N", 1e-6, DRAPE_ABOVE(0), 1e12,
                     "bound on the residual of the free nodes of an accepted state, measured by norm"),
    [DRAPE_NEWTON_NORM] =
        DRAPE_CHOICE("norm", DRAPE_NORM_MAX, norm_choices,
                     "norm of the residual: largest component, sum, or root of the sum of squares"),
    [DRAPE_NEWTON_MAX_ITERATIONS] =
        DRAPE_INTEGER("max_iterations", "1", 50, 1, 100000, "Newton iterations before the attempt fails"),
    [DRAPE_NEWTON_ON_FAILURE] =
        DRAPE_CHOICE("on_failure", DRAPE_NEWTON_FAILURE_REJECT, failure_choices,
                     "accept: continue with an unconverged state, as in the DEP report, and log it"),
    [DRAPE_NEWTON_METHOD] =
        DRAPE_CHOICE("newton", DRAPE_NEWTON_METHOD_EXACT, method_choices,
                     "exact: a Jacobian in each iteration, except for chord steps at the end with "
                     "globalization work; modified: factors kept for up to 10 iterations and across steps"),
    [DRAPE_NEWTON_GLOBALIZATION] = DRAPE_CHOICE(
        "globalization", DRAPE_NEWTON_GLOBAL_AUTO, global_choices,
        "none: full Newton steps, failures go to the controller; line_search: steps shortened until the "
        "residual falls; work: steps shortened until the work of the residual along them falls, with "
        "positive matrices after short steps and where the exact one is indefinite; auto: work"),
    [DRAPE_NEWTON_PREDICTOR] = DRAPE_CHOICE("predictor", DRAPE_NEWTON_PREDICTOR_INERTIAL, predictor_choices,
                                            "guess; inertial: the nodes keep their velocity; rest: they stay "
                                            "where they are, as in the DEP report"),
    [DRAPE_NEWTON_PROJECT] =
        DRAPE_BOOLEAN("project", false, "project the Hessian of every element to positive semidefinite"),
    [DRAPE_NEWTON_LINEAR_SOLVER] =
        DRAPE_CHOICE("linear_solver", 0, drape_linears_names, "name of a linear solver"),
    [DRAPE_NEWTON_LINEAR_TOLERANCE] =
        DRAPE_NUMBER("linear_tolerance", "1", 1e-3, 1e-14, DRAPE_BELOW(1),
                     "relative residual that iterative linear solvers leave in a correction"),
};
