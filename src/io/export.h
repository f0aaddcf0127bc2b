/* export.h: frame formats. Each is a row; the recorder drives all of them in the same way. */
#ifndef DRAPE_IO_EXPORT_H
#define DRAPE_IO_EXPORT_H

#include "base/archive.h"
#include "base/arena.h"
#include "base/registry.h"
#include "io/file.h"

/* What is written where, known before the first frame. All of it lives until close. */
typedef struct drape_export_def {
    drape_arena *arena; /* for the memory that open takes */
    const drape_model *model;
    const char *folder;  /* without a slash at its end */
    double frame_rate;   /* [1/s] */
    int64_t most_frames; /* that a run of the scene's duration writes, the one at its end included */
    bool durable;        /* a checkpoint may say of each frame that it is on the disk */
} drape_export_def;

/* A frame. Vectors are turned where another axis points up than in the scene. */
typedef struct drape_frame {
    int64_t index;           /* counts from 0 without gaps */
    double time;             /* [s] */
    const double *positions; /* (node_count x 3) [m] */
    /* Of rows that want fields; else NULL: */
    const double *velocities;     /* (node_count x 3) [m/s] */
    const double *strain;         /* (triangle_count x 2) as drape_model_strain */
    const double *energy_density; /* (node_count) [J/m2], of the state at or after the frame */
} drape_frame;

/*
 * A format. The recorder zeroes state_size bytes, calls open once, write for each frame, close once, also
 * after an open or a write that failed. All are called in the C locale. Only open may take memory. After a
 * failure the frames before it are whole and readable.
 */
typedef struct drape_exporter_ops {
    drape_entry entry; /* summary: what it writes where; reference: the format's definition */
    size_t state_size;
    bool wants_fields;
    bool y_up; /* always: its frames are never turned */

    /* Optional: refuses at pointer what is more than the format can hold, before anything is written; folder
     * is NULL. Errors: DRAPE_E_ARGUMENT. */
    drape_status (*check)(drape_context *ctx, const char *pointer, const drape_export_def *def);

    /* Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
    drape_status (*open)(drape_context *ctx, const drape_export_def *def, void *state);
    /* Removes what an earlier run left in folder in this format, and nothing else. Called for every row,
     * whatever is written now: frames of two runs must not lie side by side. */
    drape_status (*clean)(drape_context *ctx, const char *folder);

    /* Errors: DRAPE_E_FILE. */
    drape_status (*write)(drape_context *ctx, void *state, const drape_frame *frame);

    /* For checkpoints. archive: what it knows of the frames so far, between frames. resume: in place of open,
     * of a run that was left: takes the memory, reads what archive wrote, checks that the `frames` frames are
     * there, and changes nothing; then cut: takes away what is after them, to go on behind them. sync: waits
     * until the disk has all that was written; NULL: it has, with durable. Errors: DRAPE_E_FILE,
     * DRAPE_E_MEMORY. */
    void (*archive)(void *state, drape_archive *a);
    drape_status (*resume)(drape_context *ctx, const drape_export_def *def, void *state, int64_t frames,
                           drape_archive *a);
    drape_status (*cut)(drape_context *ctx, void *state, int64_t frames);
    drape_status (*sync)(void *state);

    /* Errors: DRAPE_E_FILE; all is released nevertheless. */
    drape_status (*close)(drape_context *ctx, void *state);
} drape_exporter_ops;
extern const drape_exporter_ops *const drape_exporters[]; /* NULL-ended */
extern const drape_registry drape_exporter_registry;

/* ---- For formats with one file, folder/NAME ---- */

/* Removes it, unless it is no regular file: frames are written through that. Errors: DRAPE_E_FILE,
 * DRAPE_E_MEMORY. */
drape_status drape_export_clean(drape_context *ctx, const char *folder, const char *name);
/* Takes the memory and begins the file; drape_file_destroy it in any case. Errors: DRAPE_E_FILE,
 * DRAPE_E_MEMORY. */
drape_status drape_export_begin(drape_context *ctx, const char *folder, const char *name, drape_file *file);

/* Takes the memory and opens the file again that an earlier run left, to go on behind its first size bytes,
 * as drape_file_reopen. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_export_reopen(drape_context *ctx, const char *folder, const char *name, off_t size,
                                 drape_file *file);

/* The number of bytes that a file keeps. */
void drape_export_archive_size(drape_archive *a, off_t *size);

/* ---- For formats with a file a frame, folder/frame_000000.ENDING ---- */

#define DRAPE_FRAME_NAME "frame_%06" PRId64 ".%s"

typedef struct drape_frame_files {
    const drape_model *model;
    const char *folder, *ending; /* "obj" */
    drape_file file;
} drape_frame_files;

#define DRAPE_FRAME_DIGITS 6 /* in those names, at least */

/* Removes the files of that pattern, with that many digits or more, and only those, from the folder. Errors:
 * DRAPE_E_FILE. */
drape_status drape_frame_files_clean(drape_context *ctx, const char *folder, size_t digits,
                                     const char *ending);
/* Takes the memory. Errors: DRAPE_E_MEMORY. */
drape_status drape_frame_files_open(drape_context *ctx, const drape_export_def *def, const char *ending,
                                    drape_frame_files *frames);
/* The same where `count` frames are there already. Errors: DRAPE_E_FILE (one is not there),
 * DRAPE_E_MEMORY. */
drape_status drape_frame_files_resume(drape_context *ctx, const drape_export_def *def, const char *ending,
                                      int64_t count, drape_frame_files *frames);
/* Of a state that begins with a drape_frame_files: nothing, as the number of frames says it all; and the
 * removal of those after so many. */
void drape_frame_files_archive(void *state, drape_archive *a);
drape_status drape_frame_files_cut(drape_context *ctx, void *state, int64_t frames);
/* Begins the file of one frame, to be filled and ended by drape_frame_files_end. Errors: DRAPE_E_FILE. */
drape_status drape_frame_files_begin(drape_frame_files *frames, int64_t frame);
/* Gives the frame's file its name and closes it. Errors: DRAPE_E_FILE; there is no such frame then. */
drape_status drape_frame_files_end(drape_frame_files *frames);
void drape_frame_files_close(drape_frame_files *frames);

/* ---- Pieces of OBJ ---- */

/* `v x y z` of nodes, 17 digits, and `f a b c` of triangles, which count nodes from 0. */
void drape_obj_put_nodes(drape_file *file, const double *x, int32_t count);
void drape_obj_put_triangles(drape_file *file, const int32_t *triangle, int32_t count);

#endif
