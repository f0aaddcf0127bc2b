/*
 * newton.h: solves a step equation to a tolerance by Newton's method, with KINSOL. The comment at the top
 * of newton.c describes an iteration, and which parts of it are KINSOL's.
 */
#ifndef DRAPE_NONLINEAR_NEWTON_H
#define DRAPE_NONLINEAR_NEWTON_H

#include "base/param.h"
#include "nonlinear/step_equation.h"

/* Indices of the parameters of integrators that use Newton's method, in drape_newton_params and in arrays of
 * their values. */
enum {
    DRAPE_NEWTON_DT,
    DRAPE_NEWTON_TOLERANCE,
    DRAPE_NEWTON_NORM, /* a drape_norm */
    DRAPE_NEWTON_MAX_ITERATIONS,
    DRAPE_NEWTON_ON_FAILURE,
    DRAPE_NEWTON_METHOD,
    DRAPE_NEWTON_GLOBALIZATION,
    DRAPE_NEWTON_PREDICTOR,
    DRAPE_NEWTON_PROJECT,
    DRAPE_NEWTON_LINEAR_SOLVER,
    DRAPE_NEWTON_LINEAR_TOLERANCE,
    DRAPE_NEWTON_PARAM_COUNT
};
extern const drape_param drape_newton_params[DRAPE_NEWTON_PARAM_COUNT];

/* Values of the choices among these parameters. */
enum { DRAPE_NEWTON_FAILURE_REJECT, DRAPE_NEWTON_FAILURE_ACCEPT };
enum { DRAPE_NEWTON_METHOD_EXACT, DRAPE_NEWTON_METHOD_MODIFIED };
enum {
    DRAPE_NEWTON_GLOBAL_LINE_SEARCH,
    DRAPE_NEWTON_GLOBAL_NONE,
    DRAPE_NEWTON_GLOBAL_WORK,
    DRAPE_NEWTON_GLOBAL_AUTO
};
enum { DRAPE_NEWTON_PREDICTOR_INERTIAL, DRAPE_NEWTON_PREDICTOR_REST };

typedef struct drape_newton drape_newton;

/* values: of the parameters. The equation and the arena must outlive it. Errors: DRAPE_E_MEMORY,
 * DRAPE_E_SOLVER; even then drape_newton_destroy must be called, to free what SUNDIALS and the linear
 * solver took. */
drape_status drape_newton_create(drape_arena *arena, drape_step_equation *equation, const double *values,
                                 drape_newton **out);
void drape_newton_destroy(drape_newton **newton);

/* Solves the equation for d (free DOFs; on entry the guess). DRAPE_OK: the residual at d is within the
 * tolerance, in the requested norm. > 0: it is not, and the report says why; report->usable if the settings
 * ask to continue nevertheless. In both cases the equation was evaluated last at d. */
drape_status drape_newton_solve(drape_newton *newton, double *d, drape_solve_report *report);

/* J at a point with the given mass weight, in the pattern that the system has there; valid until the next
 * solve. The factors are discarded. Errors: DRAPE_E_MEMORY. */
drape_status drape_newton_matrix(drape_newton *newton, const drape_point *point, double mass_weight,
                                 const drape_pattern **pattern, const double **values);

/* The parameter values it was made with, in the order of drape_newton_params. */
const double *drape_newton_values(const drape_newton *newton);

/* From now on the factors belong to another equation, so modified Newton must not reuse them. */
void drape_newton_forget_factors(drape_newton *newton);

/* Archives what is kept between solves, and the equation's work. */
void drape_newton_archive(drape_newton *newton, drape_archive *a);

drape_work drape_newton_work(const drape_newton *newton);
size_t drape_newton_bytes(const drape_newton *newton); /* outside of its arena */

#endif
