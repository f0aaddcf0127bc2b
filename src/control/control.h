/*
 * control.h: decides what becomes of an attempt at a step. A controller is the constant
 * drape_controller_<name> of control_<name>.c. Its verdict is the first; others may change it (sim/step.c):
 *
 *     controller --ACCEPT------> events --ACCEPT--------------> the step is taken
 *         |                        |------REPEAT--------------> again, to end at a root, or after the actions
 *         |                        |                            of a root at the present state
 *         |                        '------STOP
 *         '------RETRY, STOP---> rescue --RETRY--> schedule --> again, with a smaller step
 *                                  |      STOP <------'           (STOP if none is left)
 *                                  |------REPEAT--------------> again, with other equations
 *                                  '------SUBSTITUTE----------> another step is taken in its place
 */
#ifndef DRAPE_CONTROL_CONTROL_H
#define DRAPE_CONTROL_CONTROL_H

#include "integrators/integrator.h"

typedef enum drape_verdict {
    DRAPE_ACCEPT,
    DRAPE_RETRY,  /* roll back and try again with a step of h_next */
    DRAPE_STOP,   /* roll back and end the advance; `stop` says why */
    DRAPE_REPEAT, /* roll back; the schedule (events) or the equations (rescue) of the next attempt differ */
    DRAPE_SUBSTITUTE /* take the step that a rescue has put in the place of the attempt (sim/rescue.h) */
} drape_verdict;

/* An attempted step to be judged, and the judgement. */
typedef struct drape_trial {
    const drape_model *model;
    const drape_state *past[2];  /* the states before `in`, latest first; NULL if there is none or the
                                    controller did not ask for it */
    const drape_state *in, *out; /* out is meaningful only if status is 0 or info->usable */
    int order;                   /* order of accuracy of the integrator */
    double *scratch;             /* [2] values that a controller keeps between steps; initially 0 */
    double h;                    /* [s] the size of the attempted step */
    double dt;                   /* [s] the nominal size */
    const drape_integrator_ops *integrator; /* for its stability limit, whose estimate takes evaluations of
                                               forces */
    void *integrator_state;
    drape_step_info *info; /* a controller that rejects a step sets reason and diagnostic */
    drape_status status;   /* of the attempt; if it is 0 or info->usable, `out` may be accepted */
    drape_status stop;     /* set on DRAPE_STOP: the negative status with which the advance ends */
    double h_next;         /* [s] set on DRAPE_RETRY, and by controllers with own_steps on DRAPE_ACCEPT */
} drape_trial;

/* Whether there is no state `out` to accept. */
static inline bool drape_trial_failed(const drape_trial *trial)
{
    return trial->status && !trial->info->usable;
}

typedef struct drape_controller_ops {
    drape_entry entry;
    bool own_steps;    /* steps follow h_next, not the fixed grid of dt */
    bool by_ranks;     /* it judges by what all ranks know (base/ranks.h) */
    int history_depth; /* number of states before `in` that it needs, at most 2 */
    int max_attempts;  /* within one dt; one more ends the run. 0: no bound */
    drape_verdict (*judge)(const double *values, drape_trial *trial);
} drape_controller_ops;

extern const drape_controller_ops *const drape_controllers[]; /* NULL-terminated */
extern const drape_registry drape_controller_registry;

#endif
