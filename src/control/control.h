/*
 * control.h: what to do with an attempted step. A controller is the constant drape_controller_<name> of
 * control_<name>.c.
 */
#ifndef DRAPE_CONTROL_CONTROL_H
#define DRAPE_CONTROL_CONTROL_H

#include "integrators/integrator.h"

typedef enum drape_verdict {
    DRAPE_ACCEPT,
    DRAPE_RETRY, /* forget the attempt, try again with a step of h_next */
    DRAPE_STOP   /* forget it and stop: status says why */
} drape_verdict;

/* An attempt to be judged, and what the judge has to say. */
typedef struct drape_trial {
    const drape_model *model;
    const drape_state *past[2];  /* the states before in, latest first; NULL where there is none, or the row
                                    did not ask */
    const drape_state *in, *out; /* out is of worth only with status 0, or with info->usable */
    int order;                   /* of the integrator */
    double *scratch;             /* [2] a controller's memory between steps; 0 at first */
    double h;                    /* [s] the size that was tried */
    double dt;                   /* [s] the nominal size */
    const drape_integrator_ops *integrator; /* for its stability limit, which costs evaluations of forces */
    void *integrator_state;
    drape_step_info *info; /* a controller that rejects sets reason and worst */
    drape_status status;   /* of the attempt; on DRAPE_STOP the negative one to return */
    double h_next;         /* [s] set on DRAPE_RETRY, and by controllers with own_steps on DRAPE_ACCEPT */
} drape_trial;

typedef struct drape_controller_ops {
    drape_entry entry;
    bool own_steps;    /* steps follow h_next, not the counted grid of dt */
    int history_depth; /* how many states before in it wants, at most 2 */
    drape_verdict (*judge)(const double *values, drape_trial *trial);
} drape_controller_ops;

extern const drape_controller_ops *const drape_controllers[]; /* NULL-ended */
extern const drape_registry drape_controller_registry;

#endif
