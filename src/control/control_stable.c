/*
 * stable: steps of the nominal size where they are stable, otherwise the stability limit of an explicit
 * integrator times a safety factor. The limit is estimated again every few steps, because stretching and
 * folding change the stiffness of the sheet, and also after a failed step: a step above the new limit is
 * rolled back. Integrators without a limit take nominal steps. A step that fails below the limit is halved.
 *
 * A step of verlet consists of as many substeps as the scene says; it is the substeps that must stay below
 * 2/omega.
 */
#include "base/reason.h"
#include "control/halve.h"
#include "integrators/tolerance.h"

#include <math.h>

enum { PARAM_DT_MIN, PARAM_COUNT };
enum { SCRATCH_LIMIT, SCRATCH_LEFT };

#define EVERY 10 /* steps between two estimates of the stability limit */
#define SLACK                                                                                                \
    1e-6 /* relative tolerance between the limit from which a step was chosen and the same limit estimated
            again */

static const drape_param params[PARAM_COUNT] = {
    [PARAM_DT_MIN] = DRAPE_DT_MIN_PARAM,
};

/* Returns the largest stable step: at the end of the attempt if that state is known, otherwise at its
 * start. */
static double limit_of(drape_trial *trial)
{
    double *limit = &trial->scratch[SCRATCH_LIMIT], *left = &trial->scratch[SCRATCH_LEFT];
    bool failed = drape_trial_failed(trial);
    if (!failed && *left > 0) {
        --*left;
        return *limit;
    }
    *limit = INFINITY;
    if (trial->integrator && trial->integrator->stability) {
        drape_stability found;
        trial->integrator->stability(trial->integrator_state, failed ? trial->in : trial->out, trial->h,
                                     &found);
        *limit = found.step;
    }
    *left = failed ? 0 : EVERY - 1;
    return *limit;
}

static drape_verdict reject(const double *values, drape_trial *trial, double limit)
{
    trial->info->reason = DRAPE_REASON_UNSTABLE;
    trial->info->diagnostic = (drape_diagnostic){.what = "step / stable step",
                                                 .term = "",
                                                 .element = -1,
                                                 .node = {-1, -1, -1, -1},
                                                 .cloth = -1,
                                                 .value = trial->h / limit,
                                                 .limit = 1};
    drape_verdict verdict = drape_halve(values[PARAM_DT_MIN], trial);
    if (verdict == DRAPE_RETRY)
        trial->h_next = fmax(values[PARAM_DT_MIN], DRAPE_STEP_SAFETY * limit);
    trial->scratch[SCRATCH_LEFT] = 0;
    return verdict;
}

static drape_verdict judge(const double *values, drape_trial *trial)
{
    if (trial->status < 0)
        return drape_halve(values[PARAM_DT_MIN], trial);
    double limit = limit_of(trial);
    if (trial->h > limit * (1 + SLACK))
        return reject(values, trial, limit);
    if (drape_trial_failed(trial))
        return drape_halve(values[PARAM_DT_MIN], trial);
    trial->h_next = fmax(values[PARAM_DT_MIN], fmin(DRAPE_STEP_SAFETY * limit, trial->dt));
    return DRAPE_ACCEPT;
}

const drape_controller_ops drape_controller_stable = {
    .entry = {.name = "stable",
              .summary = "nominal steps, reduced where an explicit integrator's stability limit requires it",
              .reference = "2/omega: Courant, Friedrichs & Lewy 1928; Hairer, Lubich & Wanner 2003",
              DRAPE_PARAMS(params)},
    .own_steps = true,
    .max_attempts = 1000000,
    .judge = judge,
};
