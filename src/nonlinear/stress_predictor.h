/*
 * stress_predictor.h: predicts the stress for the next Jacobian of a Newton iteration: mixed (stress)
 * iteration. The matrix of a measure q(x) with the force f is f ddq + df/dq dq dq', with dq = grad q as a
 * column, dq' its transpose and ddq = Hess q. A correction that rotates stiff elements stretches them at
 * second order. With the forces f of that stretch in its geometric part f ddq, the next matrix resists all
 * motion except stretching: iterations zigzag. The mixed iteration has the forces on the strain measures
 * as separate unknowns, which are eliminated element by element: it uses f to first order in the last
 * correction p, f + df/dq dq' p. Residual, pattern and solution are unchanged; only the f before ddq
 * differs, until both agree at the end. Magisano, Leonetti & Garcea 2017, "How to improve efficiency and
 * robustness of the Newton method in geometrically non-linear structural problem discretized via
 * displacement-based finite elements", CMAME 313, section 4. The mixed iteration needs 40 to 90 % as many
 * iterations as Newton's method for sheets that hang, fly and buckle.
 */
#ifndef DRAPE_NONLINEAR_STRESS_PREDICTOR_H
#define DRAPE_NONLINEAR_STRESS_PREDICTOR_H

#include "assemble/system.h"

typedef struct drape_stress_predictor {
    drape_system *system;
    double *stress; /* measures; NULL: the model has no measures */
    double *along;  /* nodes: the last correction; 0 on pinned nodes */
    bool active;    /* in this solve */
    bool valid;     /* stress is the one for the next matrix */
} drape_stress_predictor;

/* Errors: DRAPE_E_MEMORY. */
drape_status drape_stress_predictor_init(drape_arena *arena, drape_system *system,
                                         drape_stress_predictor *predictor);

/* Begins a solve. Its guess counts as a first correction from the start of the step, where the forces are
 * accurate: the first matrix uses these. start NULL: no prediction in this solve. */
void drape_stress_predictor_begin(drape_stress_predictor *predictor, const drape_point *start);

/* Predicts for a matrix at the end of the correction p (free DOFs) from a point. */
void drape_stress_predictor_correct(drape_stress_predictor *predictor, const drape_point *from,
                                    const double *p);

/* The next matrix uses the forces of the point where it is evaluated. */
void drape_stress_predictor_forget(drape_stress_predictor *predictor);

/* The value for drape_point.stress; NULL: no prediction. */
const double *drape_stress_predictor_stress(const drape_stress_predictor *predictor);

#endif
