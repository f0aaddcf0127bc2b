/*
 * relaxation.h: a Maxwell branch, a spring in series with a dashpot: e' = q' - e/time for the extension e of
 * the spring, q its strain measure, and the force is k e. Over a step in which q changes steadily by d,
 *     e1 = keeps e0 + follows d,  keeps = exp(-z), follows = (1 - exp(-z))/z, z = elapsed/time,
 * which is exact (Taylor, Pister & Goudreau 1970; Simo & Hughes 1998, 10.3). k e1 is the derivative by q of
 *     k (follows d^2/2 + keeps e0 d + keeps^2 e0^2/(2 follows)),
 * the square k e1^2/(2 follows), which is k e1^2/2, the energy of the spring, if no time has elapsed.
 */
#ifndef DRAPE_MODEL_RELAXATION_H
#define DRAPE_MODEL_RELAXATION_H

#include "base/elementary.h"

#include <math.h>

/* A branch of every strain measure of a cloth: its stiffness over the measure's own, and its time [s]. */
typedef struct drape_branch {
    double fraction, time;
} drape_branch;

#define DRAPE_FRACTION_ROUNDING 1e-12 /* of a sum of decimal fractions */

/* The part of the stiffness that no branch relaxes; 0 if no more than rounding is left of it. */
static inline double drape_branches_lasting(const drape_branch *branches, int count)
{
    double part = 1;
    for (int i = 0; i < count; i++)
        part -= branches[i].fraction;
    return part > DRAPE_FRACTION_ROUNDING ? part : 0;
}

/* keeps and follows; mean: of the extensions that follow d = 1 over the step; constant: keeps^2/follows. */
typedef struct drape_decay {
    double keeps, follows, mean, constant;
} drape_decay;

/* elapsed [s]: 0 or less is an instant, infinity the relaxed limit, in which the branch has no force. */
static inline drape_decay drape_decay_over(double time, double elapsed)
{
    const double z = elapsed > 0 ? elapsed / time : 0;
    drape_decay d = {.follows = 1, .mean = 0.5};
    if (z < 0.5) { /* sum (-z)^n/(n + 1)! and sum (-z)^n/(n + 2)!: the 15th terms are below rounding */
        double power = 1;
        for (int n = 1; n <= 15; n++) {
            power *= -z / (n + 1);
            d.follows += power;
            d.mean += power / (n + 2);
        }
        d.keeps = 1 - z * d.follows;
    } else {
        d.keeps = drape_pow(2.718281828459045, -z);
        d.follows = (1 - d.keeps) / z;
        d.mean = (1 - d.follows) / z;
    }
    d.constant = d.follows > 0 ? d.keeps * d.keeps / d.follows : 0;
    return d;
}

static inline double drape_decay_extension(const drape_decay *decay, double e0, double d)
{
    return decay->keeps * e0 + decay->follows * d;
}

/* The energy that the dashpot dissipates for k = 1: the work on the branch less what its spring gains. */
static inline double drape_decay_loss(const drape_decay *decay, double e0, double d)
{
    const double e1 = drape_decay_extension(decay, e0, d);
    return fmax(0, d * (decay->follows * e0 + decay->mean * d) - (e1 - e0) * (e1 + e0) / 2);
}

#endif
