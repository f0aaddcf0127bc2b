/*
 * file.h: one output file at a time, such that nobody sees half of one.
 *
 * A file is begun under a temporary name beside its own, filled through a buffer, and gets its own by a
 * rename. Some files then grow by records: a record that does not fit on the disk is cut off again. A killed
 * process leaves whole files and whole records; a power failure is guarded against where a file is durable,
 * for what there was when drape_file_sync or drape_file_finish returned and the folder was synced. Plain
 * write(2) instead of stdio: no heap per file, and errno belongs to the call that failed.
 */
#ifndef DRAPE_IO_FILE_H
#define DRAPE_IO_FILE_H

#include <sys/types.h>

#include "base/context.h"

#define DRAPE_FILE_PART ".part" /* ending of temporary names */

/* All zero is a file that is not there: closing and destroying it is fine. */
typedef struct drape_file {
    drape_context *ctx;
    char *path;       /* the file's own name */
    char *part;       /* the name it has until it is published; "" if it is written in place */
    size_t path_size; /* of either buffer */
    char *buffer;
    size_t used; /* bytes in the buffer */
    int fd;
    bool open;
    bool durable;     /* finishing it waits until the disk has it */
    int error;        /* errno of the first write that failed since the last record, 0 for none */
    off_t size, kept; /* bytes written; bytes of whole records */
} drape_file;

/* Takes all memory for files whose names have at most path_length bytes. Errors: DRAPE_E_MEMORY. */
drape_status drape_file_create(drape_context *ctx, size_t path_length, drape_file *file);
/* Closes without a word and frees; a file not published is removed. */
void drape_file_destroy(drape_file *file);
void drape_file_abandon(drape_file *file); /* the same, but it may be named and begun again */

/* The name for the next drape_file_begin, printf style. */
void drape_file_name(drape_file *file, const char *format, ...) DRAPE_PRINTF(2, 3);

/* Opens. What already has the name stays until drape_file_publish, unless it is no regular file: a link, a
 * device or a pipe is written through, since a rename would replace it. Errors: DRAPE_E_FILE. */
drape_status drape_file_begin(drape_file *file);

/* Add to the end. A failure is reported by the next call that returns a status. */
void drape_file_put(drape_file *file, const void *data, size_t size);
void drape_file_put_text(drape_file *file, const char *text);
void drape_file_put_word(drape_file *file, uint32_t word); /* little endian, as are the next two */
void drape_file_put_float(drape_file *file, float value);
void drape_file_put_doubles(drape_file *file, const double *values, size_t count);
/* A piece of text below 1 KiB; in the locale of the thread. */
void drape_file_print(drape_file *file, const char *format, ...) DRAPE_PRINTF(2, 3);

/* Closes the file and gives it its name. On failure it is removed, and what had the name is untouched.
 * Errors: DRAPE_E_FILE. */
drape_status drape_file_finish(drape_file *file);

/* The same for a file that is to grow: it stays open. */
drape_status drape_file_publish(drape_file *file);

/* Ends a record of a published file: all bytes are with the system. On failure the file is cut back to its
 * last whole record and stays open. Errors: DRAPE_E_FILE. */
drape_status drape_file_keep(drape_file *file);

/* Writes over bytes that are already kept. Errors: DRAPE_E_FILE. */
drape_status drape_file_overwrite(drape_file *file, off_t offset, const void *data, size_t size);

/* Puts bytes back after a drape_file_overwrite that failed, where there was room for as many before, and ends
 * the file with them, as far as it can. */
void drape_file_restore(drape_file *file, off_t offset, const void *data, size_t size);

/* Cuts a published file to its first size bytes, as far as it can. */
void drape_file_cut(drape_file *file, off_t size);

/* Opens a published file again that an earlier process left, to go on behind its first size bytes; it has at
 * least so many. Overwrite what must be before drape_file_trim ends it there. Errors: DRAPE_E_FILE. */
drape_status drape_file_reopen(drape_file *file, off_t size);
drape_status drape_file_trim(drape_file *file);

/* Waits until the disk has all that a growing file keeps. Errors: DRAPE_E_FILE. */
drape_status drape_file_sync(drape_file *file);

/* Waits until the disk has the names of the files that lie beside path. path is changed during the call.
 * Errors: DRAPE_E_FILE. */
drape_status drape_folder_sync(drape_context *ctx, char *path);

/* Closes a file that grew; does nothing to one that is not open. Errors: DRAPE_E_FILE. */
drape_status drape_file_close(drape_file *file);

/* The message `cannot DEED "PATH": strerror(error)`; returns DRAPE_E_FILE. */
drape_status drape_file_fail(drape_context *ctx, const char *deed, const char *path, int error);

/* Makes a folder and those above it where they are missing, 0777 & ~umask. path is changed during the call.
 * Errors: DRAPE_E_FILE. */
drape_status drape_folder_make(drape_context *ctx, char *path);

#endif
