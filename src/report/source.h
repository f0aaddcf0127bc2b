/* source.h: what a page is made from: the frames and tables of a run, its scene, compiled again, and its
 * summary. */
#ifndef DRAPE_REPORT_SOURCE_H
#define DRAPE_REPORT_SOURCE_H

#include <jansson.h>

#include "base/arena.h"
#include "io/record.h"
#include "model/model.h"

typedef struct drape_report_source {
    drape_context *ctx;
    drape_record record;
    drape_model *model;
    char *scene_text;
    json_t *summary; /* NULL: the run did not end */
} drape_report_source;

/* drape_report_source_close in any case. Errors: DRAPE_E_FILE, DRAPE_E_PARSE, DRAPE_E_ARGUMENT,
 * DRAPE_E_MEMORY. */
drape_status drape_report_source_open(drape_context *ctx, const char *folder, drape_report_source *source);
void drape_report_source_close(drape_report_source *source);

#endif
