/* report.h: a run as one animated HTML file, for a browser without a network. */
#ifndef DRAPE_REPORT_REPORT_H
#define DRAPE_REPORT_REPORT_H

#include "base/context.h"

typedef struct drape_report_def {
    const char *run;  /* folder of `drape run --out` */
    const char *out;  /* the file; NULL: report.html in that folder */
    size_t max_bytes; /* for frames in the page: if they need more, some are left out, evenly */
} drape_report_def;

typedef struct drape_report_result {
    char path[1024];
    int64_t frames, kept; /* of the run; in the page */
    int64_t bytes;        /* of the page */
} drape_report_result;

/* Writes the page, completely or not at all. Errors: DRAPE_E_FILE, DRAPE_E_PARSE, DRAPE_E_ARGUMENT (the
 * folder is not that of a run), DRAPE_E_MEMORY. *input: whether the error lies in what was read. */
drape_status drape_report_write(drape_context *ctx, const drape_report_def *def, drape_report_result *result,
                                bool *input);

#endif
