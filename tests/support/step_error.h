/* step_error.h: how far a step of a sim ends from the converged step from the same state, for tests and
 * benchmarks. */
#ifndef DRAPE_TESTS_STEP_ERROR_H
#define DRAPE_TESTS_STEP_ERROR_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "drape/drape.h"

typedef struct step_error {
    drape_sim *exact; /* makes the converged steps */
    size_t n;         /* numbers in x and v */
    double *x, *v;    /* the state before the step; the caller's memory */
} step_error;

/* RMS over the nodes [m]. */
static inline double rms_distance(const double *a, const double *b, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(3 * sum / (double)n);
}

/* The next step begins at the present state of the sim. */
static inline void step_error_keep(step_error *e, const drape_sim *sim)
{
    memcpy(e->x, drape_sim_positions(sim), e->n * sizeof *e->x);
    memcpy(e->v, drape_sim_velocities(sim), e->n * sizeof *e->v);
}

/* RMS over the nodes [m], for an accepted attempt; NAN: there is no converged step. */
static inline double step_error_of(step_error *e, const drape_event *event)
{
    const drape_attempt *a = event->attempt;
    const drape_status status = drape_sim_set_state(e->exact, a->t, e->x, e->v);
    const bool made = !status && !drape_sim_advance(e->exact, a->t + a->h);
    const double *end = drape_sim_positions(event->sim);
    step_error_keep(e, event->sim);
    return made ? rms_distance(end, drape_sim_positions(e->exact), e->n) : NAN;
}

#endif
