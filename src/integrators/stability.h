/*
 * stability.h: the fastest waves at a state, for integrators that do not resolve what is faster than their
 * step. Matrix-free: a product with K or D is a difference of two forces.
 */
#ifndef DRAPE_INTEGRATORS_STABILITY_H
#define DRAPE_INTEGRATORS_STABILITY_H

#include "assemble/system.h"

typedef struct drape_spectrum drape_spectrum;

/* Workspace; iterations: products with K, and with D where something dissipates. Errors: DRAPE_E_MEMORY. */
drape_status drape_spectrum_create(drape_arena *arena, drape_system *system, int iterations,
                                   drape_spectrum **out);

/* omega^2, the largest eigenvalue of M^-1 K [1/s2], and the largest of M^-1 D [1/s], on the free nodes; not
 * negative. From below: what is found after n products is off by a few times 1/n^2 of it. A state gives the
 * same bits whatever was asked before. */
void drape_spectrum_largest(drape_spectrum *spectrum, const drape_state *at, double *omega, double *damping);

#endif
