/* cusick.h: the drape tester of Cusick 1965, ISO 9073-9: a round specimen of 30 cm held between discs of 18 cm; its overhang
 * drapes, and its shadow is measured. Here the overhang alone is cloth, clamped along its inner rim. */
#ifndef DRAPE_LAB_CUSICK_H
#define DRAPE_LAB_CUSICK_H

#include "lab/validate.h"

#define CUSICK_INNER 0.09 /* [m] */
#define CUSICK_OUTER 0.15

/* The share of the overhang's area that its shadow has. Needs nodes of the grid "annulus". spokes: columns of it. */
double cusick_coefficient(const drape_reference_run *run, int32_t spokes);

#endif
