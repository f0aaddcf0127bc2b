/*
 * stress_predictor.h: the stress that the next Jacobian of a Newton iteration takes: mixed (stress)
 * iteration. A correction that turns stiff elements stretches them at second order, and with the forces f of
 * that stretch in its geometric part the next matrix f ddq + df/dq dq dq' resists all that is not stretching:
 * iterations zigzag between stretching and moving on. The mixed iteration has forces on the strain measures
 * as unknowns of their own, which are eliminated element by element: it takes f to first order in the last
 * correction p, f + df/dq dq . p. Residual, pattern and solution stay as they are; only the f before ddq
 * differs, until both agree at the end. Magisano, Leonetti & Garcea 2017, "How to improve efficiency and
 * robustness of the Newton method in geometrically non-linear structural problem discretized via
 * displacement-based finite elements", CMAME 313, section 4. It takes .4 to .9 of Newton's iterations in what
 * hangs, flies and buckles.
 */
#ifndef DRAPE_NONLINEAR_STRESS_PREDICTOR_H
#define DRAPE_NONLINEAR_STRESS_PREDICTOR_H

#include "assemble/system.h"

typedef struct drape_stress_predictor {
    drape_system *system;
    double *stress; /* measures; NULL: the model has none */
    double *along;  /* nodes: the last correction; 0 on pinned nodes */
    bool active;    /* in this solve */
    bool valid;     /* stress is that for the next matrix */
} drape_stress_predictor;

/* Errors: DRAPE_E_MEMORY. */
drape_status drape_stress_predictor_init(drape_arena *arena, drape_system *system,
                                         drape_stress_predictor *predictor);

/* A solve begins. Its guess is a first correction, from the start of the step, where the forces are sound:
 * the first matrix takes those. start NULL: there is no prediction in this solve. */
void drape_stress_predictor_begin(drape_stress_predictor *predictor, const drape_point *start);

/* The next matrix is evaluated at the end of the correction p (free DOFs) from a point. */
void drape_stress_predictor_correct(drape_stress_predictor *predictor, const drape_point *from,
                                    const double *p);

/* The next matrix takes the forces of the point where it is evaluated. */
void drape_stress_predictor_forget(drape_stress_predictor *predictor);

/* For drape_point.stress; NULL: no prediction. */
const double *drape_stress_predictor_stress(const drape_stress_predictor *predictor);

#endif
