/* checkpoint.h: checkpoints as files. */
#ifndef DRAPE_IO_CHECKPOINT_H
#define DRAPE_IO_CHECKPOINT_H

#include "base/archive.h"
#include "io/file.h"

#define DRAPE_CHECKPOINT_NAME "checkpoint.drape" /* in the folder of a run */

/* All bytes of a file; *bytes is taken by drape_alloc. *there: false, and no failure, where there is no such
 * file; NULL: that is a failure, too. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_checkpoint_read(drape_context *ctx, const char *path, bool *there, void **bytes,
                                   size_t *size);

/* Begins a checkpoint in a file that has its name, and ends it: with drape_file_name and memory taken before,
 * nothing is taken. Between these the caller archives. Errors of the end: DRAPE_E_FILE, the archive's; the
 * file that was there before is untouched then. */
void drape_checkpoint_begin(drape_archive *a, drape_context *ctx, drape_file *file);
drape_status drape_checkpoint_end(drape_archive *a, drape_file *file);

#endif
