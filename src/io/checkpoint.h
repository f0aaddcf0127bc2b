/* checkpoint.h: checkpoints as files. */
#ifndef DRAPE_IO_CHECKPOINT_H
#define DRAPE_IO_CHECKPOINT_H

#include "base/archive.h"
#include "io/file.h"

#define DRAPE_CHECKPOINT_NAME "checkpoint.drape" /* in the folder of a run */

/* Reads all bytes of a file; *bytes is taken by drape_alloc. *there becomes false, without a failure, if
 * there is no such file; with there NULL that is a failure, too. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_checkpoint_read(drape_context *ctx, const char *path, bool *there, void **bytes,
                                   size_t *size);

/* Begins a checkpoint in a file that has been named; the caller then archives, and ends the checkpoint.
 * Neither takes memory, as drape_file_create has. Errors of the end: DRAPE_E_FILE, those of the archive;
 * then a file that had the name before is unchanged. */
void drape_checkpoint_begin(drape_archive *a, drape_context *ctx, drape_file *file);
drape_status drape_checkpoint_end(drape_archive *a, drape_file *file);

#endif
