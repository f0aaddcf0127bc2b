/* recorder.h: an observer that writes the frames, the step log and the energies of a sim into a folder. */
#ifndef DRAPE_IO_RECORDER_H
#define DRAPE_IO_RECORDER_H

#include "base/archive.h"
#include "base/ranks.h"
#include "io/file.h"

/* Where to write what. It is needed only until drape_recorder_create returns. */
typedef struct drape_recorder_def {
    const char *folder;      /* created, with its parents, if it does not exist; see folder.h */
    const char *scene;       /* path of the scene; NULL: it was not read from a file */
    const char *const *also; /* (also_count) other files that the caller will write into the folder: names, or
                                   "scene_mesh_*" for all that begin so */
    size_t also_count;
    const char *const *formats; /* format_count names of formats; a repeated name counts once */
    size_t format_count;        /* 0: only the step log and the energies are written */
    /* Checkpoints, folder/checkpoint.drape: one at every checkpoint_every-th frame, and one at each call of
     * drape_recorder_checkpoint; 0: only the latter. */
    bool checkpoints;
    int64_t checkpoint_every;
    drape_archive *archive; /* of a checkpoint in the folder, of which the sim's part was read: the run is
                               continued. NULL: it begins */
    double start;           /* [s] clock when the run began: checkpoints contain how long it took */
    /* Number of frames, where the caller notifies of each, and none is added at the end; 0: those of the
     * scene's duration. */
    int64_t frames;
} drape_recorder_def;

typedef struct drape_recorder drape_recorder;

/* Whether a format can hold a run of the sim's scene; errors are reported at pointer ("/output/formats/0",
 * or "" for none). Errors: DRAPE_E_ARGUMENT (there is no such format, or it cannot). */
drape_status drape_recorder_check(drape_context *ctx, const drape_sim *sim, const char *pointer,
                                  const char *format);

/* Opens all files, replacing those that an earlier run wrote, and begins to observe the sim. All memory is
 * taken here. A failed write stops the advance of the sim with DRAPE_E_FILE; its message is set on ctx,
 * which should be the sim's. An observer cannot be removed from a sim, so the sim must not advance after
 * the recorder is destroyed. Errors: DRAPE_E_ARGUMENT (unknown format, no folder, another process writes
 * into it, it has a file of a name to be written that is not ours or is an input of the model, too many
 * observers), DRAPE_E_FILE, DRAPE_E_MEMORY; those of the first kind are found before anything is written.
 *
 * A run that is continued: all files are compared by their checksums with what they were at the checkpoint,
 * before what came later is removed. If the run had finished no file is changed. Further errors: those of the
 * archive, such as other formats. */
drape_status drape_recorder_create(drape_context *ctx, drape_sim *sim, const drape_recorder_def *def,
                                   drape_recorder **out);

/* Saves sim and recorder as they are now, even after drape_recorder_finish; a resumed run is then finished,
 * too. What the checkpoint claims about files is on the disk before it. Nothing is allocated. Errors:
 * DRAPE_E_FILE; then the previous checkpoint is unchanged. */
drape_status drape_recorder_checkpoint(drape_recorder *recorder);

/* The folder, in which the caller may write the files of def->also; open until drape_recorder_destroy. */
drape_folder *drape_recorder_folder(const drape_recorder *recorder);

/* All 0 for NULL. */
typedef struct drape_recorder_progress {
    bool writes; /* this process writes the files: of several ranks, rank 0 does */
    bool finished;
    int64_t frames; /* written by all exporters */
    double seconds; /* [s] wall time spent in output */
    double wall;    /* [s] of the run until the last checkpoint, written or read; 0: there was none */
} drape_recorder_progress;
drape_recorder_progress drape_recorder_done(const drape_recorder *recorder);

/* Writes the sim's present state as the last frame, unless the last frame shows it already, and closes all
 * files. What the sim does afterwards is not recorded. After a failed write nothing is added, and that
 * failure is returned again with its message; a second call also returns it. Errors: DRAPE_E_FILE. */
drape_status drape_recorder_finish(drape_recorder *recorder);

/* Closes the files without a last frame if drape_recorder_finish was not called, and frees the recorder. */
void drape_recorder_destroy(drape_recorder **recorder);

/* ---- A checkpoint as a file ---- */

#define DRAPE_CHECKPOINT_NAME "checkpoint.drape" /* in the folder of a run */

/* A checkpoint that is being written. */
typedef struct drape_checkpoint {
    drape_archive archive;
    drape_file *file;         /* NULL: rank 0 has it */
    const drape_ranks *ranks; /* that share the model; NULL: none */
    bool together;            /* the ranks have the file open */
} drape_checkpoint;

/* Begins a checkpoint in a file that has been named, of a folder if ranks share the model; the caller then
 * archives, and ends the checkpoint. Neither takes memory in one process, as drape_file_create has. Both are
 * collective. Errors of the end: DRAPE_E_FILE, those of the archive; then a file that had the name
 * before is unchanged. */
void drape_checkpoint_begin(drape_checkpoint *c, drape_context *ctx, const drape_ranks *ranks,
                            drape_file *file);
drape_status drape_checkpoint_end(drape_checkpoint *c);

#endif
