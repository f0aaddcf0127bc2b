/*
 * barrier.h: the energy of a gap, b(s) with s = gap / activation distance: the logarithmic barrier of Li
 * et al. 2020 (Incremental Potential Contact, eq. 6) scaled to length one,
 *     b = -(s - 1)^2 ln s   for s < 1,  0 beyond,
 * C2 at s = 1. Below s = low it continues as its osculating parabola, also for s < 0, so that it is
 * finite everywhere. For most pairs, low is the least gap that a step may end with (pair.h): the force
 * withstands 1/low times the stiffness there, and only trial states are on the parabola. For pairs
 * that are inside (active.h), low is DRAPE_BARRIER_PARABOLA, so that the force which pushes them out is
 * moderate at any depth of practice. Exempt pairs (exempt.h) have another law, the bounded barrier: with
 * y = 1 - s > 0
 *     b = y^3 / (1 + y)^2,   -b' = (y^3 + 3 y^2) / (1 + y)^3 < 1
 * also C2 at s = 1 and convex, whose force tends to 1 with depth.
 */
#ifndef DRAPE_CONTACT_BARRIER_H
#define DRAPE_CONTACT_BARRIER_H

#include "base/elementary.h"

#include <math.h>

#define DRAPE_BARRIER_PARABOLA 0.1
#define DRAPE_BARRIER_BOUNDED  (-INFINITY) /* as low: selects the bounded barrier */

typedef struct drape_barrier {
    double b, db, ddb; /* b, b', b'' */
} drape_barrier;

static inline drape_barrier drape_barrier_log(double s)
{
    double log_s = drape_ln(s), u = s - 1;
    return (drape_barrier){.b = -u * u * log_s,
                           .db = -2 * u * log_s - u * u / s,
                           .ddb = -2 * log_s - 4 * u / s + u * u / (s * s)};
}

static inline drape_barrier drape_barrier_bounded(double s)
{
    const double y = 1 - s, u = 1 + y;
    return (drape_barrier){
        .b = y * y * y / (u * u), .db = -y * y * (y + 3) / (u * u * u), .ddb = 6 * y / (u * u * (u * u))};
}

static inline drape_barrier drape_barrier_at(double s, double low)
{
    if (s >= 1)
        return (drape_barrier){0};
    if (low < 0)
        return drape_barrier_bounded(s);
    if (s >= low)
        return drape_barrier_log(s);
    drape_barrier at = drape_barrier_log(low);
    double u = s - low;
    return (drape_barrier){
        .b = at.b + u * (at.db + 0.5 * u * at.ddb), .db = at.db + u * at.ddb, .ddb = at.ddb};
}

#endif
