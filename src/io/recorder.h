/* recorder.h: an observer that writes the frames, the step log and the energies of a sim into a folder. */
#ifndef DRAPE_IO_RECORDER_H
#define DRAPE_IO_RECORDER_H

#include "base/context.h"

/* What to write where. Need only live until drape_recorder_create returns. */
typedef struct drape_recorder_def {
    const char *folder;         /* made, with those above it, if it is not there */
    const char *const *formats; /* format_count names of exporters; a name given twice counts once */
    size_t format_count;        /* 0: the step log and the energies alone */
} drape_recorder_def;

typedef struct drape_recorder drape_recorder;

/* Whether a format can hold a run of the sim's scene; faults at pointer ("/output/formats/0", or "" for none).
 * Errors: DRAPE_E_ARGUMENT (there is no such format, it cannot). */
drape_status drape_recorder_check(drape_context *ctx, const drape_sim *sim, const char *pointer,
                                  const char *format);

/* Opens all files, replacing those of an earlier run, and begins to observe the sim. All memory is taken
 * here. Failures of writing stop the advance of the sim with DRAPE_E_FILE; their message is set on ctx, which
 * should be the sim's. A sim cannot be left by an observer: it must not advance after the recorder was
 * destroyed. Errors: DRAPE_E_ARGUMENT (unknown format, no folder, too many observers), DRAPE_E_FILE,
 * DRAPE_E_MEMORY; an unknown format is found before anything is written. */
drape_status drape_recorder_create(drape_context *ctx, drape_sim *sim, const drape_recorder_def *def,
                                   drape_recorder **out);

/* Writes the sim's present state as the last frame, unless the last frame has it, and closes all files. What
 * the sim does afterwards is not recorded. After a failed write nothing is added, and that failure is
 * returned again with its message; so does a second call. Errors: DRAPE_E_FILE. */
drape_status drape_recorder_finish(drape_recorder *recorder);

/* Closes without a last frame where drape_recorder_finish was not called. */
void drape_recorder_destroy(drape_recorder **recorder);

double drape_recorder_seconds(const drape_recorder *recorder); /* wall time spent in output */
int64_t drape_recorder_frames(const drape_recorder *recorder); /* written by all exporters */

#endif
