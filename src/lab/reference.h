/*
 * reference.h: the reference solution of a work-precision diagram: the motion of the most accurate run that
 * the time allows, with its distance from the next less accurate one as the estimate of its error.
 */
#ifndef DRAPE_LAB_REFERENCE_H
#define DRAPE_LAB_REFERENCE_H

#include "lab/lab.h"

/* Makes l->reference and l->reference_error, or reads them if the folder has them (reference.json,
 * reference.f64). There are two sequences of refinements: ida over rtol at order 5, and trbdf2 over dt; the
 * one with the smaller distance between its last two levels is taken. Errors: those of lab_run;
 * DRAPE_E_SOLVER if neither has two levels that complete. */
drape_status lab_make_reference(lab *l);

/* Whether the scene compiles for every sequence, before anything is written. Errors: those of loading. */
drape_status lab_check_reference(lab *l);

#endif
