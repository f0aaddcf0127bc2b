/*
 * control.h: decides what to do with an attempted step. A controller is the constant drape_controller_<name>
 * of control_<name>.c.
 */
#ifndef DRAPE_CONTROL_CONTROL_H
#define DRAPE_CONTROL_CONTROL_H

#include "integrators/integrator.h"

typedef enum drape_verdict {
    DRAPE_ACCEPT,
    DRAPE_RETRY, /* roll back and try again with a step of h_next */
    DRAPE_STOP   /* roll back and stop; status says why */
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
    drape_status status;   /* status of the attempt; on DRAPE_STOP, set to the negative status to return */
    double h_next;         /* [s] set on DRAPE_RETRY, and by controllers with own_steps on DRAPE_ACCEPT */
} drape_trial;

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
