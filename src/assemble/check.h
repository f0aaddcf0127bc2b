/* check.h: every analytic derivative against central differences at a deformed, rotated, moving state. */
#ifndef DRAPE_ASSEMBLE_CHECK_H
#define DRAPE_ASSEMBLE_CHECK_H

#include "assemble/system.h"

typedef struct drape_check_result {
    const char *term; /* name of the row, "contact", "self_contact" or "assembled" */
    const char *what; /* "gradient", "Hessian", "force by rate" ... */
    double error;     /* largest over the sample, relative */
    double limit;
    bool pass;
} drape_check_result;

#define DRAPE_MAX_CHECK_RESULTS 1024

/* Fills rows (DRAPE_MAX_CHECK_RESULTS) for the terms of the system's model, and for its contact. seed: of the
 * deformation. The system's pattern may be another one since: no sim goes on with it. Errors: DRAPE_E_MEMORY,
 * DRAPE_E_STOPPED (the context's cancel); a failed comparison is no error, its row says so. */
drape_status drape_check_derivatives(drape_context *ctx, drape_system *system, unsigned seed,
                                     drape_check_result *rows, int *row_count);

#endif
