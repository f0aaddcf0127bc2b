/*
 * newton.h: the nonlinear system of one implicit step, solved by KINSOL. With the displacement d of the free
 * nodes from a base state,
 *     x = x_base + d,  v = v_base + w d
 *     F(d) = m_w M (d - p) + g(x, v) = 0       [N]
 *     J(d) = m_w M + dg/dx + w dg/dv           [N/m]
 * Backward Euler: m_w = 1/h^2, w = 1/h, p = h v0. Displacements and not positions are unknown, so that
 * M (d - p) keeps its digits at small h, wherever the scene lies.
 */
#ifndef DRAPE_INTEGRATORS_NEWTON_H
#define DRAPE_INTEGRATORS_NEWTON_H

#include "integrators/integrator.h"

/* The parameters of rows that step by Newton, in this order, at the head of their lists. */
enum {
    DRAPE_NEWTON_DT,
    DRAPE_NEWTON_TOLERANCE,
    DRAPE_NEWTON_NORM,
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

typedef struct drape_newton drape_newton;

/* One system. Arrays of nodes are (node_count x 3), of free DOFs (dofs). */
typedef struct drape_newton_problem {
    const double *x_base, *v_base; /* nodes: at d = 0; pinned ones where they are at the end of the step */
    /* nodes: where the step, or its stage, goes from; NULL: neither the mixed iteration (mixed.h) nor chords */
    const double *x_start;
    double weight;         /* w [1/s] */
    double mass_weight;    /* m_w [1/s2] */
    const double *inertia; /* p, free DOFs [m] */
    const double *internal;
    const double *history; /* of the measures' rates, see drape_point */
    double t, span[2];     /* [s] where colliders stand, and the step, see drape_point */
} drape_newton_problem;

drape_status drape_newton_create(drape_arena *arena, drape_system *system, const double *values,
                                 drape_newton **out);
void drape_newton_destroy(drape_newton **newton);

/* Solves for d (free DOFs; on entry the guess). DRAPE_OK: the residual at d is within the tolerance in the
 * norm that was asked for. > 0: it is not, info says why; info->usable if the settings say to go on all the
 * same. */
drape_status drape_newton_solve(drape_newton *newton, const drape_newton_problem *problem, double *d,
                                drape_step_info *info);

/* The point of the last evaluation, which after a solve is its solution, and g there (nodes). */
const drape_point *drape_newton_point(const drape_newton *newton);
const double *drape_newton_force(const drape_newton *newton);
/* F there (free DOFs). */
const double *drape_newton_residual(const drape_newton *newton);

/* J at a point with a weight of its own, in the pattern that the system has there; valid until the next solve. The
 * factors are forgotten. Errors: DRAPE_E_MEMORY. */
drape_status drape_newton_matrix(drape_newton *newton, const drape_point *point, double mass_weight,
                                 const drape_pattern **pattern, const double **values);

/* The parameter values it was made with, in the order of drape_newton_params. */
const double *drape_newton_values(const drape_newton *newton);

/* The factors belong to another system now: modified Newton must not reuse them. */
void drape_newton_forget_factors(drape_newton *newton);

/* What it keeps from solve to solve. */
void drape_newton_archive(drape_newton *newton, drape_archive *a);

drape_work drape_newton_work(const drape_newton *newton);
size_t drape_newton_bytes(const drape_newton *newton);

#endif
