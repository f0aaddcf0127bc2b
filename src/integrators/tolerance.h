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

/* Where all nodes are pinned no error bounds a step, whose work by pins and colliders is yet a sum over
 * steps: the least number of steps in the duration of the scene. */
#define DRAPE_STEPS_WITHOUT_UNKNOWNS 200

/* Replaces NaN by the derived value that the parameters describe. */
void drape_derive_tolerances(const drape_model *model, double rtol, double *atol_x, double *atol_v);

/* Whether a run whose last step had this size still moves. False: DRAPE_MAX_TINY_STEPS in a row were tiny, as
 * where nothing can yield. size, speed: of the scene [m], [m/s]; last: the step ends an advance or at a kink
 * and does not count; *tiny: how many there were, kept between steps. */
bool drape_step_moves(double h, double size, double speed, bool last, int64_t *tiny);
#define DRAPE_MAX_TINY_STEPS 20 /* a few may start a run */

#endif
