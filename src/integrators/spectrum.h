/*
 * spectrum.h: the fastest waves at a state, for integrators that are unstable if these are faster than the
 * step allows. Matrix-free: a product with K or D is a difference of two forces.
 */
#ifndef DRAPE_INTEGRATORS_SPECTRUM_H
#define DRAPE_INTEGRATORS_SPECTRUM_H

#include "assemble/system.h"

typedef struct drape_spectrum drape_spectrum;

/* Takes the workspace; iterations: the number of products with K, and with D if something dissipates.
 * Errors: DRAPE_E_MEMORY. */
drape_status drape_spectrum_create(drape_arena *arena, drape_system *system, int iterations,
                                   drape_spectrum **out);

/* omega^2, the largest eigenvalue of M^-1 K [1/s2], and the largest one of M^-1 D [1/s], on the free nodes;
 * not negative. Both are lower bounds: after n products the relative error is a few times 1/n^2. The bits
 * depend on the state alone, not on earlier calls. */
void drape_spectrum_largest(drape_spectrum *spectrum, const drape_state *at, double *omega, double *damping);

#endif
