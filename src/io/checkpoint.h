/* checkpoint.h: checkpoints as files. */
#ifndef DRAPE_IO_CHECKPOINT_H
#define DRAPE_IO_CHECKPOINT_H

#include "base/archive.h"
#include "base/ranks.h"
#include "io/file.h"

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
