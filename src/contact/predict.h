/*
 * predict.h: predicts the normal forces of contacts for the next Jacobian of a Newton iteration, as
 * nonlinear/stress_predictor.h predicts stress. The barrier is so far from linear that Newton's method needs
 * an iteration for each halving of a gap until its force is large, and one for each doubling back; meanwhile
 * the pair, whose correction is cut short, holds up all others. But the solution of the linear system gives a
 * good estimate of the force: N - k dg, with the present force N, the stiffness k in the matrix, and the
 * change dg of the gap by the correction. The next Jacobian has the secant from the present gap to the one at
 * which the law gives that force, and the correction ends at that gap. For a force in inverse proportion to
 * the gap the secant is N/g, as in primal-dual interior point methods (Nocedal & Wright 2006, Numerical
 * Optimization, 19.3).
 *
 * If the pieces pass through each other in the solution, by some length, the force is underestimated at least
 * by the inertia of its points over that length, which is added. Residual and solution are unchanged, and so
 * is the Jacobian where the prediction is near the present force, so that the iteration ends as Newton's.
 */
#ifndef DRAPE_CONTACT_PREDICT_H
#define DRAPE_CONTACT_PREDICT_H

#include "contact/active.h"
#include "contact/restitution.h"

typedef struct drape_predicted {
    int32_t node[4], collider; /* of an active contact */
    int32_t next;              /* index of the next one with the same first point; -1: none */
    double force;              /* [N] */
    /* The secant stiffness computed last, and its gap, weight and velocities: the parts of a Jacobian and the
     * next prediction need the same one. weight NAN: none was computed. */
    double secant, gap, m, weight, v[4][3];
} drape_predicted;

typedef struct drape_predictions {
    drape_arena *arena;
    drape_predicted *list; /* (count of capacity) */
    int32_t *first;        /* (points) index of the first with this first point; -1: none */
    int32_t count, capacity;
} drape_predictions;

/* Makes an empty list for so many points. Errors: DRAPE_E_MEMORY. */
drape_status drape_predictions_init(drape_arena *arena, int32_t points, drape_predictions *predictions);
void drape_predictions_clear(drape_predictions *predictions);

/* Takes memory for so many, so that the list grows only where the active set does. Errors: DRAPE_E_MEMORY. */
drape_status drape_predictions_reserve(drape_predictions *predictions, int32_t capacity);

/* False: the list is full. */
bool drape_predictions_add(drape_predictions *predictions, const drape_active_contact *contact, double force);

/* drape_predicted_stiffness for the force that is predicted for a contact; NAN if there is no prediction or
 * it is near the present force. Not thread-safe. */
double drape_predictions_stiffness(const drape_predictions *predictions, const drape_active_contact *contact,
                                   const drape_contact_law *law, double weight, double v[4][3]);

/* The secant stiffness [N/m] of the normal force of a contact, from its present gap to the gap at which the
 * force is `force`; NAN if that is near the present force. v: velocities of its points, which change with the
 * gap at the given weight (drape_point). */
double drape_predicted_stiffness(const drape_gap *gap, const drape_contact_law *law, double weight,
                                 double v[4][3], double force);

#endif
