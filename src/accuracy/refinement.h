/*
 * refinement.h: by which method and setting a model is run next, so that it becomes as accurate as was asked.
 * A run is a level: a method of fixed steps with dt, or one with error control with rtol. The next level
 * follows from how far apart the last two are; docs/accuracy.md has the measurements.
 *
 * The first levels halve the step: of bdf2 or, where there are bodies to hit, of newton_k. If they are
 * further from the aim than one more halving is worth, error control comes next, from a tolerance ten times
 * the accuracy on, with as much work as the halvings would take. If that is spent, steps are halved after
 * all. Where levels differ as much as those before them, twice in a row, so would the next: the motion is not
 * predictable.
 */
#ifndef DRAPE_ACCURACY_REFINEMENT_H
#define DRAPE_ACCURACY_REFINEMENT_H

#include "model/model.h"

typedef struct drape_level {
    const char *method, *key; /* of the integrator, and "dt" [s] or "rtol" [1] */
    double value;
    bool controlled; /* it has error control */
    double share; /* of the distance to the level before, that this one is off by, if nothing else is known */
    double most;  /* [work] after which it is given up; INFINITY: never */
} drape_level;

/* What a level has shown, in a run that may have been cut short. */
typedef struct drape_level_result {
    double apart;    /* [1] largest distance to the level before; NAN: there is none */
    double expected; /* [1] the same until the end, if it grows on as it did */
    double fraction; /* of the run that was made */
    double work;   /* evaluations of the residual, and of the matrix with its factors, which count as four */
    bool failed;   /* a step could not be made */
    bool given_up; /* it has done its work */
} drape_level_result;

typedef struct drape_refinement {
    double accuracy;                /* [1] asked */
    double least_step;              /* [s] */
    bool hits;                      /* there are bodies, at which all methods are of order 1 */
    bool can_control;               /* methods with error control can run the model */
    double spent;                   /* [work] for which they could not */
    double gain;                    /* by a halving, of the error */
    drape_level level, fixed;       /* the present one; the last one of fixed steps */
    double fixed_error, fixed_work; /* [1], [work] of the latter, of a whole run */
    double trust; /* by how much errors of fixed steps are larger than they seem: error control showed it */
    double
        before; /* [1] how far the two levels before were apart; NAN: unknown, or they were of two methods */
    double parted; /* fraction of the run until which they were compared */
    int failures;  /* in a row, at no later time */
    double failed; /* fraction of the run at the last */
    int stuck;     /* levels in a row that are as far from the one before as that was from its own */
} drape_refinement;

/* Begins on the first level, for cloth of this size: the smallest diagonal [m]. */
void drape_refinement_init(drape_refinement *refinement, const drape_model *model, double size,
                           double accuracy);

/* [1] how far the present level is off, where it is `apart` from the one before: by the ratio of that
 * distance to the one before it (Richardson), if both are of whole runs, and otherwise by the level's share.
 * */
double drape_refinement_error(const drape_refinement *refinement, double apart, bool whole);

/* The distance to the level before from which on the present one cannot be the last. */
double drape_refinement_hopeless(const drape_refinement *refinement);

/* Whether a level that has done its work may go on, being so far apart from the one before: if that is more
 * than the estimated error of fixed steps, these are not to be trusted, and would take more work. */
bool drape_refinement_goes_on(drape_refinement *refinement, double apart);

/* Moves to the next level; false: the present one is the last. */
bool drape_refinement_next(drape_refinement *refinement, const drape_level_result *result);

#endif
