/* plate.h: a square plate of side 1 m under its weight, on all sides, by D = 1 N m. */
#ifndef DRAPE_LAB_PLATE_H
#define DRAPE_LAB_PLATE_H

#include "lab/validate.h"

/* mesh: the members of the mesh but its size; terms: the two terms. */
int plate_scene(const char *mesh, const char *terms, double poisson, bool clamp, char *text, size_t size);

/* w D/(q a^4) in the middle. */
drape_status plate_measure(drape_reference_run *run, double *value);

/* Of a plate supported on all sides, by Navier's double series: it does not depend on nu. */
double plate_navier(void);

#endif
