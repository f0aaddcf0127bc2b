/*
 * accuracy.h: runs of a model until one is as accurate as its scene asks for: drape_run_accurately of
 * drape.h. Each is compared with the one before at every frame (geometry/deviation.h), and refinement.h
 * chooses the next. The one before goes on only as far as it is needed: a run that is too far off is left
 * where that shows.
 */
#ifndef DRAPE_ACCURACY_ACCURACY_H
#define DRAPE_ACCURACY_ACCURACY_H

#include "sim/sim.h"

/* Whether runs of a model can be compared at all, and be repeated until its accuracy is reached. Errors:
 * DRAPE_E_ARGUMENT: no, with the reason. */
drape_status drape_accuracy_check_runs(drape_context *ctx, const drape_model *model);
drape_status drape_accuracy_check(drape_context *ctx, const drape_model *model);

#endif
