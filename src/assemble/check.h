/* check.h: compares every analytic derivative with central differences at a deformed, rotated, moving
 * state. */
#ifndef DRAPE_ASSEMBLE_CHECK_H
#define DRAPE_ASSEMBLE_CHECK_H

#include "assemble/system.h"

#define DRAPE_MAX_CHECK_RESULTS 1024

/* Compares the derivatives of all terms of the system's model, and of its contact; results
 * (DRAPE_MAX_CHECK_RESULTS) gets one entry for each comparison. seed: of the random deformation. The
 * system's pattern may be another one afterwards, so no sim can continue with this system. Errors:
 * DRAPE_E_MEMORY, DRAPE_E_STOPPED (the context was cancelled); a failed comparison is not an error but an
 * entry. */
drape_status drape_check_derivatives(drape_context *ctx, drape_system *system, unsigned seed,
                                     drape_check_result *results, int *result_count);

#endif
