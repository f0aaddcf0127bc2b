/* recorder.h: an observer that writes the frames, the step log and the energies of a sim into a folder. */
#ifndef DRAPE_IO_RECORDER_H
#define DRAPE_IO_RECORDER_H

#include "base/archive.h"

/* What to write where. Need only live until drape_recorder_create returns. */
typedef struct drape_recorder_def {
    const char *folder;         /* made, with those above it, if it is not there */
    const char *const *formats; /* format_count names of exporters; a name given twice counts once */
    size_t format_count;        /* 0: the step log and the energies alone */
    /* Checkpoints, folder/checkpoint.drape: with each so-manieth frame, counted from the first, and by
     * drape_recorder_checkpoint; 0: by that alone. */
    bool checkpoints;
    int64_t checkpoint_every;
    double start; /* [s] of the clock when the run began: checkpoints say how long it took */
} drape_recorder_def;

typedef struct drape_recorder drape_recorder;

/* Whether a format can hold a run of the sim's scene; faults at pointer ("/output/formats/0", or "" for
 * none). Errors: DRAPE_E_ARGUMENT (there is no such format, it cannot). */
drape_status drape_recorder_check(drape_context *ctx, const drape_sim *sim, const char *pointer,
                                  const char *format);

/* Opens all files, replacing those of an earlier run, and begins to observe the sim. All memory is taken
 * here. Failures of writing stop the advance of the sim with DRAPE_E_FILE; their message is set on ctx, which
 * should be the sim's. A sim cannot be left by an observer: it must not advance after the recorder was
 * destroyed. Errors: DRAPE_E_ARGUMENT (unknown format, no folder, too many observers), DRAPE_E_FILE,
 * DRAPE_E_MEMORY; an unknown format is found before anything is written. */
drape_status drape_recorder_create(drape_context *ctx, drape_sim *sim, const drape_recorder_def *def,
                                   drape_recorder **out);

/* Goes on with a run that was left, in its folder: reads the frames' part of a checkpoint, behind the sim's,
 * which was read; checks that the files have what they had then, and takes away what came later. Where the
 * run had finished (drape_recorder_is_finished) no file is touched. Errors: those of create; the archive's,
 * such as other formats. */
drape_status drape_recorder_resume(drape_context *ctx, drape_sim *sim, const drape_recorder_def *def,
                                   drape_archive *a, drape_recorder **out);
bool drape_recorder_is_finished(const drape_recorder *recorder);

/* Saves sim and recorder as they are now, also after drape_recorder_finish, which then is told to whoever
 * resumes. What the checkpoint says of files is on the disk before. Nothing is allocated. Errors:
 * DRAPE_E_FILE; the checkpoint before is untouched then. */
drape_status drape_recorder_checkpoint(drape_recorder *recorder);

/* [s] of wall clock that the run had taken at the last checkpoint, written or read; 0: there was none. */
double drape_recorder_wall(const drape_recorder *recorder);

/* Writes the sim's present state as the last frame, unless the last frame has it, and closes all files. What
 * the sim does afterwards is not recorded. After a failed write nothing is added, and that failure is
 * returned again with its message; so does a second call. Errors: DRAPE_E_FILE. */
drape_status drape_recorder_finish(drape_recorder *recorder);

/* Closes without a last frame where drape_recorder_finish was not called. */
void drape_recorder_destroy(drape_recorder **recorder);

double drape_recorder_seconds(const drape_recorder *recorder); /* wall time spent in output */
int64_t drape_recorder_frames(const drape_recorder *recorder); /* written by all exporters */

#endif
