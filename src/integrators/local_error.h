/*
 * local_error.h: local error control of one-step methods that choose their own steps: the error test, the
 * size of the next step, and where steps end. A step of such an integrator is
 *
 *     drape_local_error_stop(control, in, out->t)      the next kink in the motion of pins and colliders
 *     g at in->x, in->v                                which a method of this kind needs anyway
 *     drape_local_error_begin(control, in, g, &attempt, info)
 *                                                      a status < 0 ends the step; else attempt.h is its
 *                                                      size, and attempt.t1 its end, to which out->t is set
 *     ... computes out, and the estimate (ex, ev) of its local error; a status > 0 of its own, for a stage
 *     that crosses something or a solver that failed, it simply returns: half of h follows
 *     drape_local_error_test(control, &attempt, ex, ev, info)
 *                                                      its status is that of the step
 *
 * A failed test is an attempt of its own, with the reason "error_test": it is counted and recorded like any
 * other that is rejected. An integrator with this has own_steps, and the parameters of
 * DRAPE_LOCAL_ERROR_PARAMS are the first of its list. Not thread-safe, like the integrator.
 *
 * The norm is the root mean square over the free DOFs of the errors of x and v, weighted by the length and
 * the velocity that ida uses (tolerance.h). An accepted step of size h with the error e, after one of h_ with
 * e_, proposes the smaller one of
 *     safety h e^(-1/q)                              elementary control
 *     safety h e^(-1/q) (h/h_) (e_/e)^(1/q)          predictive control, Gustafsson 1994
 * where e is O(h^q); Hairer & Wanner 1996, IV.8, (8.25). No step is longer than the one before if that took
 * more than one attempt. A step that ends at a kink or at the end of an advance is cut, or what is left is
 * halved, so that no sliver is left over; what was proposed before the cut is kept.
 */
#ifndef DRAPE_INTEGRATORS_LOCAL_ERROR_H
#define DRAPE_INTEGRATORS_LOCAL_ERROR_H

#include "integrators/integrator.h"
#include "integrators/tolerance.h"

enum {
    DRAPE_LOCAL_ERROR_RTOL,
    DRAPE_LOCAL_ERROR_ATOL_X,
    DRAPE_LOCAL_ERROR_ATOL_V,
    DRAPE_LOCAL_ERROR_MAX_STEP,
    DRAPE_LOCAL_ERROR_MAX_STEPS,
    DRAPE_LOCAL_ERROR_PARAM_COUNT
};

/* The beginning of the list of parameters of such an integrator. */
#define DRAPE_LOCAL_ERROR_PARAMS                                                                             \
    [DRAPE_LOCAL_ERROR_RTOL] = DRAPE_RTOL_PARAM, [DRAPE_LOCAL_ERROR_ATOL_X] = DRAPE_ATOL_X_PARAM,            \
    [DRAPE_LOCAL_ERROR_ATOL_V] = DRAPE_ATOL_V_PARAM, [DRAPE_LOCAL_ERROR_MAX_STEP] = DRAPE_MAX_STEP_PARAM,    \
    [DRAPE_LOCAL_ERROR_MAX_STEPS] = DRAPE_MAX_STEPS_PARAM

/* What the size of a step follows from. */
typedef struct drape_step_record {
    double end;      /* [s] where the step ended; NAN: none */
    double h, error; /* [s], 1: of the last step that was not cut; h 0: none */
    double proposed; /* [s] for the next step */
} drape_step_record;

typedef struct drape_local_error {
    const drape_model *model;
    const drape_motion *motion;
    double power; /* q: the estimate is O(h^q) */
    double atol_x, atol_v;
    double size, speed;         /* [m], [m/s]: of the scene, by which time is measured */
    double max_step, max_steps; /* [s], INFINITY: none; [1/s] */
    double kept_growth; /* a step that would grow by less keeps its size, and a method its factors; 1: none */

    /* Kept between steps. */
    drape_step_record past, made; /* of the last accepted step; of the last one whose test was passed */
    double tried;                 /* [s] time from which the last attempt began; NAN: none */
    double second; /* [s] beginning of the second of simulated time in which steps are counted */
    int64_t steps; /* attempted in that second, except those that end an advance */
    int64_t tiny;  /* steps in a row that were too short to move the scene */
} drape_local_error;

/* An attempt, from begin to test. */
typedef struct drape_local_attempt {
    double h, t1; /* [s] */
    double stop;  /* [s] what drape_local_error_stop returned */
    double end;   /* [s] of the advance */
    double bound; /* [s] upper bound of h, as step() gets it */
    bool cut;     /* h is smaller than what was proposed because of `stop` */
    bool again;   /* it is not the first one from its state */
} drape_local_attempt;

/* values: of the parameters. power: the estimate is O(h^power), the order of the embedded solution plus 1. */
void drape_local_error_init(const drape_system *system, const double *values, int power,
                            drape_local_error *control);

/* The time up to which a step from `in` may go: the next kink, or the end of the advance. Between the two
 * the velocities of pins and colliders are smooth. */
double drape_local_error_stop(const drape_local_error *control, const drape_state *in, double end);

/* Chooses h and t1 of an attempt whose stop, end and bound are set. g (nodes) [N]: the forces at `in`, from
 * which the first step's size follows; NULL: it follows from the velocities alone. Sets info->h. Errors:
 * DRAPE_E_STEP_TOO_SMALL, with the reason, if the work of a run is exhausted (max_steps) or time no longer
 * changes. */
drape_status drape_local_error_begin(drape_local_error *control, const drape_state *in, const double *g,
                                     drape_local_attempt *attempt, drape_step_info *info);

/* The error test of a step: ex [m], ev [m/s] (free DOFs). DRAPE_OK, or DRAPE_RETRY_REJECTED with reason,
 * diagnostic and the size of the next attempt in info; DRAPE_RETRY_NONFINITE if the estimate is not finite;
 * DRAPE_E_STEP_TOO_SMALL if the steps have become so short that the scene no longer moves. */
drape_status drape_local_error_test(drape_local_error *control, const drape_local_attempt *attempt,
                                    const double *ex, const double *ev, drape_step_info *info);

/* The weighted root mean square of an estimate; *worst, unless NULL: the node with the largest share. */
double drape_local_error_norm(const drape_local_error *control, const double *ex, const double *ev,
                              int32_t *worst);

/* The next step starts from a state of unknown origin. */
void drape_local_error_restart(drape_local_error *control);

void drape_local_error_archive(drape_local_error *control, drape_archive *a);

#endif
