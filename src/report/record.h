/* record.h: a finished run, read from the folder that `drape run --out` wrote: its scene compiled again, its frames one
 * at a time, the rows of its tables. */
#ifndef DRAPE_REPORT_RECORD_H
#define DRAPE_REPORT_RECORD_H

#include <jansson.h>
#include <sys/types.h>

#include "model/model.h"

typedef struct drape_record {
    drape_context *ctx;
    char *folder; /* without a slash at its end */
    drape_model *model;
    char *scene_text;
    json_t *summary; /* NULL: there is none, the run did not end */
    int positions;   /* descriptor of positions.npy; -1 */
    off_t data;      /* where its numbers begin */
    int64_t frames;
    double *times; /* (frames) [s] */
} drape_record;

/* Reads all but the frames. drape_record_close in any case. Errors: DRAPE_E_FILE, DRAPE_E_PARSE, DRAPE_E_ARGUMENT,
 * DRAPE_E_MEMORY. */
drape_status drape_record_open(drape_context *ctx, const char *folder, drape_record *run);
void drape_record_close(drape_record *run);

/* Positions of a frame into x (node_count x 3 [m]). Errors: DRAPE_E_FILE. */
drape_status drape_record_read(const drape_record *run, int64_t frame, double *x);

/* One row of a table: the texts of the columns that were asked for, valid during the call. */
typedef void drape_row_reader(void *user, int64_t row, char *const *cells);

#define DRAPE_MOST_COLUMNS 16

/* Calls reader for each row of folder/name with the columns of those names, in their order; how many rows in *rows.
 * A last line that is not whole is left out. Errors: DRAPE_E_FILE, DRAPE_E_PARSE (a column is not there),
 * DRAPE_E_MEMORY. */
drape_status drape_record_rows(const drape_record *run, const char *name, const char *const *columns,
                               size_t count, drape_row_reader *reader, void *user, int64_t *rows);

#endif
