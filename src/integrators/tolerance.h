/*
 * tolerance.h: local errors are measured relative to a length and a velocity, the same for every node: a
 * part relative to the positions would make the error depend on where the scene is. Both follow from one
 * number, rtol, and the size of the scene.
 */
#ifndef DRAPE_INTEGRATORS_TOLERANCE_H
#define DRAPE_INTEGRATORS_TOLERANCE_H

#include "model/model.h"

/* Parameters of integrators and controllers that bound a local error. */
#define DRAPE_RTOL_PARAM                                                                                     \
    DRAPE_NUMBER(                                                                                            \
        "rtol", "1", 1e-3, 1e-12, 1,                                                                         \
        "local error relative to the size of the scene; only sets the defaults of atol_x and atol_v")
#define DRAPE_ATOL_X_PARAM                                                                                   \
    DRAPE_NUMBER("atol_x", "m", DRAPE_DERIVED("rtol times the diagonal of the rest bounding box"),           \
                 DRAPE_ABOVE(0), 1e9, "local error of positions")
#define DRAPE_ATOL_V_PARAM                                                                                   \
    DRAPE_NUMBER("atol_v", "m/s",                                                                            \
                 DRAPE_DERIVED("rtol sqrt(g L), or rtol L/s without gravity, L the diagonal"),               \
                 DRAPE_ABOVE(0), 1e9, "local error of velocities")

/* And their bounds on steps. */
#define DRAPE_MAX_STEP_PARAM                                                                                 \
    DRAPE_NUMBER("max_step", "s", DRAPE_DERIVED("none"), DRAPE_ABOVE(0), 1e9, "largest step")
#define DRAPE_MAX_STEPS_PARAM                                                                                \
    DRAPE_INTEGER("max_steps", "1/s", 100000, 1, 1e9,                                                        \
                  "largest number of steps within one second of simulated time, not counting those that "    \
                  "end an advance; one more ends the run")

/* Energy that a run may gain without a source, for drape_integrator_ops.gain. At rtol 1e-3 the energy of a
 * smooth fall oscillates by half a percent: a larger gain means that waves are amplified. */
#define DRAPE_LOCAL_ERROR_GAIN 0.02

/* Of the error tolerance: bound for the error that Newton's iteration leaves, the largest that Hairer &
 * Wanner 1996 advise (IV.8, kappa). With IDA's own, 0.33, an undamped sheet of E h = 1e9 N/m lost a third
 * of its energy in 0.5 s at rtol 1e-3 and ended 0.22 m off; with this a tenth, and 0.04 m off. */
#define DRAPE_NEWTON_SHARE 0.1

/* Where all nodes are pinned no error bounds a step, whose work by pins and colliders is yet a sum over
 * steps: the least number of steps in the duration of the scene. */
#define DRAPE_STEPS_WITHOUT_UNKNOWNS 200

/* What a step is beside that which its local error would allow, how much larger and smaller than the one
 * before it may be, and the relative error below which it is noise: growth is limited there in any case
 * (Hairer, Norsett & Wanner 1993, II.4). A growth below DRAPE_STEP_KEPT is not worth new factors (Hairer &
 * Wanner 1996, IV.8). */
#define DRAPE_STEP_SAFETY 0.9
#define DRAPE_STEP_GROWTH 5.0
#define DRAPE_STEP_CUT    0.2
#define DRAPE_STEP_KEPT   1.2
#define DRAPE_LEAST_ERROR 1e-4

/* The next step over this one, from its error and that of the one before, each relative to the tolerance and
 * O(h^power): S e^(-0.7/power) before^(0.4/power), a PI controller (Gustafsson 1991), bounded by growth and
 * cut. */
double drape_step_factor(double error, double before, int power);

/* Replaces NaN by the derived value that the parameters describe. */
void drape_derive_tolerances(const drape_model *model, double rtol, double *atol_x, double *atol_v);

/* Bounds the work, because steps may follow a degenerate, undamped sheet for ever without a failure.
 * Whether so many steps of the second of simulated time that t is in have been attempted, with one from t,
 * unless it does not count: steps that end an advance are the host's choice, and those are left out. The
 * bound is a rate, so that it does not depend on how a host divides its advances; a host that continues
 * after the failure gets the same number of steps again. *second, *steps: kept between steps. */
bool drape_steps_exhausted(double t, double most, bool counts, double *second, int64_t *steps);

/* Whether a run whose last step had this size still moves. False: DRAPE_MAX_TINY_STEPS in a row were tiny, as
 * where nothing can yield. size, speed: of the scene [m], [m/s]; last: the step ends an advance or at a kink
 * and does not count; *tiny: how many there were, kept between steps. */
bool drape_step_moves(double h, double size, double speed, bool last, int64_t *tiny);
#define DRAPE_MAX_TINY_STEPS 20 /* a few may start a run */

#endif
