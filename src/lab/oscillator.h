/* oscillator.h: two nodes on an elastic sheet, its other side held: what a time integrator makes of an oscillation. */
#ifndef DRAPE_LAB_OSCILLATOR_H
#define DRAPE_LAB_OSCILLATOR_H

#include "lab/validate.h"

/* k = E h w/L = 1 N/m, half of 1 kg moves: omega^2 = 2. It starts at rest length with the speed OSCILLATOR_SPEED; at
 * strains of 1e-5 the sheet is linear to 1e-5. integrator: members of the scene's integrator besides dt and tolerance.
 */
int oscillator_scene(const char *integrator, double angle, char *text, size_t size);

#define OSCILLATOR_SPEED 1e-5 /* [m/s] */
#define OSCILLATOR_OMEGA 1.41421356237309504880

/* Advances by so many steps of omega h = angle. */
drape_status oscillator_advance(drape_reference_run *run, double angle, int steps);

/* Kinetic and elastic energy. */
double oscillator_energy(const drape_reference_run *run);

/* The share of the amplitude that a step leaves, from the energies after `from` and after `to` steps; of the first 20. */
drape_status oscillator_amplitude_between(drape_reference_run *run, int from, int to, double *value);
drape_status oscillator_amplitude(drape_reference_run *run, double *value);

/* The angle of a step over omega h: every method that advances x and v by one matrix of determinant 1 has
 * x(n+1) + x(n-1) = 2 cos(angle) x(n). */
drape_status oscillator_phase(drape_reference_run *run, double *value);

/* What rows have in common: cases of omega h, 0.1, 0.5 and 2 unless they have others; those that measure an amplitude, and
 * those that measure an angle. */
#define OSCILLATOR_ANGLES 3
extern const double oscillator_angles[OSCILLATOR_ANGLES];
#define OSCILLATOR_CASES                                                                                     \
    .unit = "1", .parameter = "omega h", .tolerance = 1e-4, .case_count = OSCILLATOR_ANGLES
#define OSCILLATOR_AMPLITUDE .entry.summary = "share of the amplitude left by a step", OSCILLATOR_CASES
#define OSCILLATOR_PHASE                                                                                     \
    .entry.summary = "angle of a step over omega h", OSCILLATOR_CASES, .measure = oscillator_phase

#endif
