/* record.h: reads a finished run from the folder that `drape run --out` wrote: where its scene is, its
 * frames one at a time, and the rows of its tables. */
#ifndef DRAPE_IO_RECORD_H
#define DRAPE_IO_RECORD_H

#include "io/file.h"

#include <jansson.h>

typedef struct drape_record {
    drape_context *ctx;
    char *folder;  /* without a slash at its end */
    int positions; /* descriptor of positions.npy; -1: not open */
    off_t data;    /* where its numbers begin [bytes] */
    int32_t nodes;
    int64_t frames;
    double *times; /* (frames) [s] */
} drape_record;

/* The name of the scene in a folder, to be freed by drape_free; *path is NULL after a failure. Errors:
 * DRAPE_E_FILE (there is no scene: the folder is not that of a run), DRAPE_E_MEMORY. */
drape_status drape_record_scene(drape_context *ctx, const char *folder, char **path);

/* Opens the frames of a run whose scene has so many nodes, and reads their times. Call drape_record_close
 * in any case. Errors: DRAPE_E_FILE, DRAPE_E_PARSE (not an array as drape run writes it, another number of
 * nodes, truncated), DRAPE_E_MEMORY. */
drape_status drape_record_open(drape_context *ctx, const char *folder, int32_t nodes, drape_record *run);
void drape_record_close(drape_record *run); /* does nothing to an empty one */

/* Reads the positions of a frame into x (nodes x 3 [m]). Errors: DRAPE_E_FILE, DRAPE_E_PARSE (a number is not
 * finite). */
drape_status drape_record_read(const drape_record *run, int64_t frame, double *x);

/* Reads a file of the folder, such as summary.json, to be released by json_decref; *out is NULL if there is
 * none, as after a kill, or it is not JSON. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_record_json(const drape_record *run, const char *name, json_t **out);

/* Refuses an output that the user names if it is a file of the run in the folder, as drape_file_check_named
 * does. */
drape_status drape_record_protect(drape_context *ctx, const char *folder, const char *out);

/* Gets one row of a table: the texts of the requested columns, valid during the call. */
typedef void drape_row_reader(void *user, int64_t row, char *const *cells);

#define DRAPE_MOST_COLUMNS 40

/* Calls reader for each row of folder/name, with the columns of these names in this order; *rows: the
 * number of rows. An incomplete last line is left out. Errors: DRAPE_E_FILE, DRAPE_E_PARSE (a column is
 * missing), DRAPE_E_MEMORY. */
drape_status drape_record_rows(const drape_record *run, const char *name, const char *const *columns,
                               size_t count, drape_row_reader *reader, void *user, int64_t *rows);

#endif
