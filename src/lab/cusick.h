/* cusick.h: the drape tester of Cusick 1965, ISO 9073-9: a round specimen of 30 cm held between discs of 18 cm; its overhang
 * drapes, and its shadow is measured. Here the overhang alone is cloth, clamped along its inner rim. */
#ifndef DRAPE_LAB_CUSICK_H
#define DRAPE_LAB_CUSICK_H

#include "compile/fabrics.h"
#include "lab/validate.h"

#define CUSICK_INNER 0.09 /* [m] */
#define CUSICK_OUTER 0.15

/* The overhang of a measured fabric, let go level, that falls for 1 s and folds; rows circles of so many columns. Its tension
 * is CUSICK_TENSION, a fiftieth of a woven one's: flat triangles bend across their edges only as far as they stretch. */
#define CUSICK_TENSION 100.0 /* [N/m] */
int cusick_scene(const drape_fabric *fabric, int rows, int columns, char *text, size_t size);

/* The share of the overhang's area that its shadow has. Needs nodes of the grid "annulus". spokes: columns of it. */
double cusick_coefficient(const drape_reference_run *run, int32_t spokes);

#endif
