/* export.h: frame formats. Each is a row; the recorder drives all of them in the same way. */
#ifndef DRAPE_IO_EXPORT_H
#define DRAPE_IO_EXPORT_H

#include "io/file.h"

/*
 * A format. The recorder zeroes state_size bytes, calls open once, write for each frame, close once, also
 * after an open that failed. All are called in the C locale. Only open may take memory. After a failure the
 * frames before it are whole and readable.
 */
typedef struct drape_exporter_ops {
    const char *name;      /* "npy" */
    const char *summary;   /* what it writes where */
    const char *reference; /* the format's definition */
    size_t state_size;

    /* model and folder, without a slash at its end, live until close.
     * Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
    drape_status (*open)(drape_context *ctx, const drape_model *model, const char *folder, void *state);
    /* Removes what an earlier run left in folder in this format, and nothing else. Called for every row,
     * whatever is written now: frames of two runs must not lie side by side. */
    drape_status (*clean)(drape_context *ctx, const char *folder);

    /* frame counts from 0 without gaps; time [s]; positions (node_count x 3) [m]. Errors: DRAPE_E_FILE. */
    drape_status (*write)(drape_context *ctx, void *state, int64_t frame, double time,
                          const double *positions);

    /* Errors: DRAPE_E_FILE; all is released nevertheless. */
    drape_status (*close)(drape_context *ctx, void *state);
} drape_exporter_ops;
extern const drape_exporter_ops *const drape_exporters[]; /* NULL-ended */

/* The row of a name. Errors: DRAPE_E_ARGUMENT at pointer ("/output/formats/0", or "" for none), with the
 * names that there are. */
drape_status drape_exporter_find(drape_context *ctx, const char *pointer, const char *name,
                                 const drape_exporter_ops **out);

/* For formats with a file a frame, folder/frame_000000.ENDING: */

typedef struct drape_frame_files {
    const drape_model *model;
    const char *folder, *ending; /* "obj" */
    drape_file file;
} drape_frame_files;

/* Removes the files of that pattern, and only those, from the folder. Errors: DRAPE_E_FILE. */
drape_status drape_frame_files_clean(drape_context *ctx, const char *folder, const char *ending);
/* Takes the memory. Errors: DRAPE_E_MEMORY. */
drape_status drape_frame_files_open(drape_context *ctx, const drape_model *model, const char *folder,
                                    const char *ending, drape_frame_files *frames);
/* Begins the file of one frame, to be filled and ended by drape_frame_files_end. Errors: DRAPE_E_FILE. */
drape_status drape_frame_files_begin(drape_frame_files *frames, int64_t frame);
/* Gives the frame's file its name and closes it. Errors: DRAPE_E_FILE; there is no such frame then. */
drape_status drape_frame_files_end(drape_frame_files *frames);
void drape_frame_files_close(drape_frame_files *frames);

#endif
