/*
 * mixed.h: forces on the strain measures as unknowns of their own, while Newton is on its way. A correction that turns
 * stiff elements stretches them at second order, and with the forces of that stretch in its geometric part the next
 * matrix f ddq + df/dq dq dq' holds all back that is not stretching: iterations zigzag between stretching and moving on.
 * The mixed iteration keeps f to first order in the correction instead: f + df/dq dq . p. Its unknowns are eliminated
 * element by element, which leaves the residual, the pattern and the solution as they are: only the f before ddq is
 * another one, until both agree at the end. Magisano, Leonetti & Garcea 2017, "How to improve efficiency and robustness
 * of the Newton method in geometrically non-linear structural problem discretized via displacement-based finite
 * elements", CMAME 313, section 4. It takes .4 to .9 of Newton's iterations in what hangs, flies and buckles.
 */
#ifndef DRAPE_INTEGRATORS_MIXED_H
#define DRAPE_INTEGRATORS_MIXED_H

#include "assemble/system.h"

typedef struct drape_mixed {
    drape_context *ctx;
    drape_system *system;
    double *stress; /* measures; NULL: the model has none */
    double *along;  /* nodes */
    bool wanted;    /* in this solve */
    bool holds;     /* stress belongs to the next matrix */
} drape_mixed;

/* Errors: DRAPE_E_MEMORY; what was taken is freed by drape_mixed_free. */
drape_status drape_mixed_init(drape_context *ctx, drape_system *system, drape_mixed *mixed);
void drape_mixed_free(drape_mixed *mixed);

/* The guess is a first correction, from a state in which the forces are sound: they are the first. NULL: none is wanted
 * in this solve. */
void drape_mixed_begin(drape_mixed *mixed, const drape_point *start);

/* The next matrix belongs to the end of the correction p (free DOFs) from a point. */
void drape_mixed_correct(drape_mixed *mixed, const drape_point *from, const double *p);

/* The next matrix takes the forces where it is evaluated. */
void drape_mixed_forget(drape_mixed *mixed);

/* For drape_point.stress; NULL: none. */
const double *drape_mixed_stress(const drape_mixed *mixed);

size_t drape_mixed_bytes(const drape_mixed *mixed);

#endif
