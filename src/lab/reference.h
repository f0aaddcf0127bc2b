/*
 * reference.h: the motion that a work-precision diagram compares with: of the most accurate run that the time allows,
 * with the distance to the next less accurate one as the estimate of its error.
 */
#ifndef DRAPE_LAB_REFERENCE_H
#define DRAPE_LAB_REFERENCE_H

#include "lab/lab.h"

/* Makes l->reference and l->reference_error, or reads them where the folder has them (reference.json,
 * reference.f64). Two ladders are climbed, each rung tighter than the one before: ida over rtol at order 5, and
 * trbdf2 over dt; the smaller distance between the last two rungs wins. Errors: those of lab_run;
 * DRAPE_E_SOLVER where no ladder has two rungs that end. */
drape_status lab_make_reference(lab *l);

/* Whether the scene compiles for every ladder, before anything is written. Errors: those of loading. */
drape_status lab_check_reference(lab *l);

#endif
