/* cusick.h: the drape tester of Cusick 1965, ISO 9073-9: a round specimen of 30 cm held between discs of 18 cm; its overhang
 * drapes, and its shadow is measured. Here the overhang alone is cloth, clamped along its inner rim. */
#ifndef DRAPE_LAB_CUSICK_H
#define DRAPE_LAB_CUSICK_H

#include "lab/validate.h"

#define CUSICK_INNER 0.09 /* [m] */
#define CUSICK_OUTER 0.15

/* The overhang of the measured fabric at a place of the table, let go level, that falls for 1 s and folds; and the share of its
 * area that its shadow has then. */
int cusick_scene(double place, double load, char *text, size_t size);
drape_status cusick_measure(drape_reference_run *run, double *value);

/* What rows have in common whose cases are places in the table. Folds that begin otherwise end otherwise: the tolerance covers
 * what another order of the sums, or another processor, makes of it. */
#define CUSICK_CASES                                                                                         \
    .unit = "1", .parameter = "fabric, by its place", .model = "stretch.cst, bend.midedge; annulus; be",     \
    .tolerance = 0.05, .scene = cusick_scene, .measure = cusick_measure

#endif
