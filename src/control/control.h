/*
 * control.h: what to do with an attempted step, as rows of one table. A row is the constant
 * drape_controller_<word> of control_<word>.c.
 */
#ifndef DRAPE_CONTROL_CONTROL_H
#define DRAPE_CONTROL_CONTROL_H

#include "integrators/integrator.h"

typedef enum drape_verdict {
    DRAPE_ACCEPT,
    DRAPE_HALVE, /* forget the attempt, try half of it */
    DRAPE_STOP   /* forget it and stop: *status says why */
} drape_verdict;

typedef struct drape_controller_ops {
    const char *name, *summary, *reference;
    const drape_param *params;
    int param_count;
    /* Judges an attempt from time t of size h that ended with *status. On DRAPE_STOP *status becomes the
     * negative one to return. */
    drape_verdict (*judge)(const double *values, double t, double h, const drape_step_info *info,
                           drape_status *status);
} drape_controller_ops;

extern const drape_controller_ops *const drape_controllers[]; /* NULL-ended */
extern const char *const drape_controllers_words[];

#endif
