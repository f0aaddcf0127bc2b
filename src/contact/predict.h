/*
 * predict.h: predicts the normal forces of contacts for the next Jacobian of a Newton iteration, as
 * nonlinear/stress_predictor.h predicts stress. The barrier is so far from linear that Newton's method
 * needs an iteration for each halving of a gap until its force is large, in which a pair that is cut short
 * holds up all others, and one for each doubling back. But the linear system of an
 * iteration finds a good estimate of the force itself: with the stiffness k that it assumed, the present
 * force N, and the change dg of the gap by its solution, N - k dg. The next Jacobian has the secant from the
 * present gap to the one at which the law gives that force: for a force in inverse proportion to the gap it
 * is N/g, as in primal-dual interior point methods (Nocedal & Wright 2006, Numerical Optimization, 19.3),
 * and the correction ends at that gap.
 *
 * A solution in which a pair passes through by dg underestimates its force at least by the inertia of its
 * points over that length, which is added. Residual and solution are unchanged, and so is the Jacobian where
 * the prediction is near the present force, so that the iteration ends as Newton's.
 */
#ifndef DRAPE_CONTACT_PREDICT_H
#define DRAPE_CONTACT_PREDICT_H

#include "contact/active.h"
#include "contact/restitution.h"

typedef struct drape_predicted {
    int32_t node[4], collider; /* of an active contact */
    int32_t next;              /* of the same first point; -1: none */
    double force;              /* [N] */
    /* The secant stiffness found last, and for which gap, weight and velocities: the parts of a Jacobian and
     * the next prediction ask for the same one. weight NAN: none was. */
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

/* The secant stiffness [N/m] by drape_predicted_stiffness at the force that is predicted for a contact; NAN:
 * none is, or it is near the present one. Not thread-safe. */
double drape_predictions_stiffness(const drape_predictions *predictions, const drape_active_contact *contact,
                                   const drape_contact_law *law, double weight, double v[4][3]);

/* The secant stiffness [N/m] of the normal force of a contact, whose gap changes with the velocities v of its
 * points at the given weight (drape_point), from its gap to that at which the force is `force`; NAN where
 * that is near the present force. */
double drape_predicted_stiffness(const drape_gap *gap, const drape_contact_law *law, double weight,
                                 double v[4][3], double force);

#endif
