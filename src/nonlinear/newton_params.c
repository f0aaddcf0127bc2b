/* newton_params.c: the parameters of integrators that step by Newton. */
#include "nonlinear/newton.h"
#include "solvers/linear.h"

static const char *const norm_choices[] = {
    [DRAPE_NORM_MAX] = "max", [DRAPE_NORM_L1] = "l1", [DRAPE_NORM_L2] = "l2", NULL};
static const char *const failure_choices[] = {"reject", "accept", NULL};
static const char *const method_choices[] = {"exact", "modified", NULL};
static const char *const global_choices[] = {"line_search", "none", "work", "auto", NULL};
static const char *const predictor_choices[] = {"inertial", "rest", NULL};

const drape_param drape_newton_params[DRAPE_NEWTON_PARAM_COUNT] = {
    [DRAPE_NEWTON_DT] = {.name = "dt",
                         .unit = "s",
                         .default_value = 1.0 / 60,
                         .min = 0,
                         .max = 1e6,
                         .open_min = true,
                         .help = "nominal step"},
    [DRAPE_NEWTON_TOLERANCE] = {.name = "tolerance",
                                .unit = "N",
                                .default_value = 1e-6,
                                .min = 0,
                                .max = 1e12,
                                .open_min = true,
                                .help =
                                    "bound on the residual of the free nodes of an accepted state, in norm"},
    [DRAPE_NEWTON_NORM] = {.name = "norm",
                           .kind = DRAPE_PARAM_CHOICE,
                           .unit = "1",
                           .default_value = DRAPE_NORM_MAX,
                           .choices = norm_choices,
                           .help =
                               "norm of the residual: largest component, sum, or root of the sum of squares"},
    [DRAPE_NEWTON_MAX_ITERATIONS] = {.name = "max_iterations",
                                     .kind = DRAPE_PARAM_INTEGER,
                                     .unit = "1",
                                     .default_value = 50,
                                     .min = 1,
                                     .max = 100000,
                                     .help = "Newton iterations before the attempt fails"},
    [DRAPE_NEWTON_ON_FAILURE] =
        {.name = "on_failure",
         .kind = DRAPE_PARAM_CHOICE,
         .unit = "1",
         .default_value = DRAPE_NEWTON_FAILURE_REJECT,
         .choices = failure_choices,
         .help = "accept: go on with an unconverged state, as the DEP report does; the log says so"},
    [DRAPE_NEWTON_METHOD] =
        {.name = "newton",
         .kind = DRAPE_PARAM_CHOICE,
         .unit = "1",
         .default_value = DRAPE_NEWTON_METHOD_EXACT,
         .choices = method_choices,
         .help = "exact: a Jacobian each iteration, but for chords at the end under globalization work; "
                 "modified: factors kept for up to 10 iterations and across steps"},
    [DRAPE_NEWTON_GLOBALIZATION] =
        {.name = "globalization",
         .kind = DRAPE_PARAM_CHOICE,
         .unit = "1",
         .default_value = DRAPE_NEWTON_GLOBAL_AUTO,
         .choices = global_choices,
         .help = "none: full Newton steps, failures go to the controller; line_search: steps shortened "
                 "until the residual falls; work: until its work along them does, with positive matrices "
                 "after short ones and where the exact one is not definite; auto: work"},
    [DRAPE_NEWTON_PREDICTOR] = {.name = "predictor",
                                .kind = DRAPE_PARAM_CHOICE,
                                .unit = "1",
                                .default_value = DRAPE_NEWTON_PREDICTOR_INERTIAL,
                                .choices = predictor_choices,
                                .help =
                                    "guess: the nodes fly on, or stay where they are as in the DEP report"},
    [DRAPE_NEWTON_PROJECT] = {.name = "project",
                              .kind = DRAPE_PARAM_BOOLEAN,
                              .unit = "1",
                              .default_value = 0,
                              .help = "project the Hessian of every element to positive semidefinite"},
    [DRAPE_NEWTON_LINEAR_SOLVER] = {.name = "linear_solver",
                                    .kind = DRAPE_PARAM_CHOICE,
                                    .unit = "1",
                                    .default_value = 0,
                                    .choices = drape_linears_names,
                                    .help = "a row of the linear solvers"},
    [DRAPE_NEWTON_LINEAR_TOLERANCE] = {.name = "linear_tolerance",
                                       .unit = "1",
                                       .default_value = 1e-3,
                                       .min = 1e-14,
                                       .max = 1,
                                       .open_max = true,
                                       .help =
                                           "share of the residual that iterative linear solvers leave in a "
                                           "correction"},
};
