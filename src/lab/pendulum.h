/* pendulum.h: two nodes on a stiff sheet that hangs from an axis. */
#ifndef DRAPE_LAB_PENDULUM_H
#define DRAPE_LAB_PENDULUM_H

#include "lab/validate.h"

/* It is let go at so many degrees. integrator: members of the scene's integrator besides dt. Steps are 1/400 of the period
 * of small swings; the sheet stretches by less than 1e-4. */
int pendulum_scene(const char *integrator, double degrees, char *text, size_t size);

/* The period over that of small swings, from the first two crossings of the vertical. */
drape_status pendulum_measure(drape_reference_run *run, double *value);

/* T/T0 = 2/pi K(sin(a/2)) */
double pendulum_period(double degrees);

/* What rows of it have in common: its period from 30, 90 and 150 degrees. */
#define PENDULUM_ANGLES 3
extern const double pendulum_angles[PENDULUM_ANGLES];
#define PENDULUM_PERIOD                                                                                      \
    .entry.summary = "period over that of small swings", .unit = "1", .parameter = "degrees",                \
    .entry.reference = "T/T0 = 2/pi K(sin(a/2))", .tolerance = 0.001, .parameters = pendulum_angles,         \
    .case_count = PENDULUM_ANGLES, .expected = pendulum_period, .measure = pendulum_measure

#endif
