/*
 * iterations: chooses the step by the number of Newton iterations that it takes, as incremental analyses of
 * structures do. A step of buckling or colliding cloth takes about as many iterations as two of half the
 * size: then the smaller ones are more accurate at about the same cost. Where cloth moves freely, half the
 * step takes hardly fewer iterations, and steps stay as large as the nominal one.
 */
#include "control/halve.h"

#include <math.h>

#define MOST     8 /* the step after one that took more iterations has half its size */
#define LEAST    3 /* the step after one that took fewer iterations has twice its size */
#define SUBSTEPS 4 /* steps in one dt, at most, except where a step has to be repeated */

static const drape_param params[] = {DRAPE_DT_MIN_PARAM};

/* A step that was cut short by the end of an advance says nothing about a step larger than itself. */
static double next_size(const drape_trial *trial)
{
    const double least = trial->dt / SUBSTEPS;
    if (trial->info->iterations > MOST)
        return fmin(trial->h, fmax(trial->h / 2, least));
    if (trial->info->iterations < LEAST)
        return fmin(2 * trial->h, trial->dt);
    return trial->h;
}

static drape_verdict judge(const double *values, drape_trial *trial)
{
    if (trial->status && !trial->info->usable)
        return drape_halve(*values, trial);
    trial->h_next = next_size(trial);
    return DRAPE_ACCEPT;
}

const drape_controller_ops drape_controller_iterations = {
    .entry = {.name = "iterations",
              .summary =
                  "smaller steps where Newton's method takes many iterations, which cost no more there; "
                  "failed steps are halved",
              .reference = "Crisfield 1991, 9.5: increments by the number of iterations",
              DRAPE_PARAMS(params)},
    .own_steps = true,
    .by_ranks = true,
    .max_attempts = 10000,
    .judge = judge,
};
