/*
 * file.h: one output file at a time, written such that nobody sees an incomplete one.
 *
 * A file belongs to a folder (folder.h), whose rule says what it may replace, or the user named it, who means
 * to replace a regular file of that name. It is begun under a temporary name, filled through a buffer, and
 * renamed. It is complete then (drape_file_finish), or it is published and grows by records: bytes that are
 * put at its end and bytes in its middle that are overwritten, until drape_file_keep ends the record. A
 * record that fails, as on a full disk, is cut off again. A killed process leaves complete files and complete
 * records. A durable file also survives a power failure, with its content at the time when drape_file_sync or
 * drape_file_finish returned and the folder was synced.
 *
 * write(2) is used instead of stdio, so that no file needs the heap, and errno belongs to the call that
 * failed.
 */
#ifndef DRAPE_IO_FILE_H
#define DRAPE_IO_FILE_H

#include <sys/stat.h>

#include "base/archive.h"
#include "io/folder.h"

/* A file with all members zero does not exist: closing and destroying it does nothing. */
typedef struct drape_file {
    drape_context *ctx;
    drape_folder *folder; /* NULL: the user named the file */
    char *path, *part;    /* its own name; its temporary one until it is published, "" if it has none */
    size_t capacity;      /* of each of these names */
    char *buffer;
    size_t used; /* bytes in the buffer */
    int fd;
    bool open;
    bool durable;                              /* finishing it waits until it is on the disk */
    int error;                                 /* errno of the first failure since the last record; 0: none */
    off_t size, kept;                          /* bytes written; bytes of complete records */
    drape_checksum sum;                        /* of the bytes written */
    drape_disk_bytes change[DRAPE_DISK_BYTES]; /* what later records overwrite */
    struct stat last;                          /* the file that was last published; st_ino 0: none */
    struct drape_file *next;                   /* growing file of the same run; NULL: there are no more */
} drape_file;

/* Takes all memory for files that the user names, with paths of at most path_length bytes; or for the file of
 * a folder. Errors: DRAPE_E_MEMORY. */
drape_status drape_file_create(drape_context *ctx, size_t path_length, drape_file *file);
drape_status drape_file_create_in(drape_context *ctx, drape_folder *folder, drape_file *file);

/* Refuses a file that the user names if it is this input of the command, or a link to a regular file. Errors:
 * DRAPE_E_ARGUMENT. */
drape_status drape_file_check_named(drape_context *ctx, const char *path, const char *input);
/* Closes the file without reporting failures and frees its memory; an unpublished file is removed. */
void drape_file_destroy(drape_file *file);
void drape_file_abandon(drape_file *file); /* the same, but it may be named and begun again */

/* Sets the name for the next drape_file_begin, printf style: a name in the folder, or a path. */
void drape_file_name(drape_file *file, const char *format, ...) DRAPE_PRINTF(2, 3);

/* Opens the file. An existing file of that name stays until drape_file_publish. A device or a pipe that the
 * user named is written through. Errors: DRAPE_E_FILE. */
drape_status drape_file_begin(drape_file *file);

/* The path by which other processes reach the open file of a folder, by its temporary name until it is
 * published. Returns whether it fits. */
bool drape_file_reach(const drape_file *file, char *path, size_t size);

/* These add to the end. A failure is reported by the next call that returns a status. */
void drape_file_put(drape_file *file, const void *data, size_t size);
void drape_file_put_text(drape_file *file, const char *text);
void drape_file_put_word(drape_file *file, uint32_t word); /* little endian, like the next two */
void drape_file_put_float(drape_file *file, float value);
void drape_file_put_doubles(drape_file *file, const double *values, size_t count);
/* Accounts for bytes that other processes wrote at the end, which was at a multiple of 8; sum: what they add
 * to the checksum; error: the errno with which they failed, 0: none. */
void drape_file_put_written(drape_file *file, uint64_t size, uint64_t sum, int error);
/* Text below 1 KiB, in the locale of the thread. */
void drape_file_print(drape_file *file, const char *format, ...) DRAPE_PRINTF(2, 3);

/* Where the next byte will be. */
int64_t drape_file_end(const drape_file *file);

/* Overwrites bytes, after all that was put has been written; they may reach beyond the end. A failure is
 * reported as one of putting. */
void drape_file_overwrite(drape_file *file, off_t offset, const void *data, size_t size);
void drape_file_overwrite_word(drape_file *file, off_t offset, uint32_t word); /* little endian */

/* Declares bytes that records overwrite, so that a checkpoint has them; an offset < 0 counts from the end. */
void drape_file_declare(drape_file *file, int64_t offset, size_t size);

/* Closes the file and gives it its name. After a failure the file is removed, and an existing file of that
 * name is unchanged. Errors: DRAPE_E_FILE. */
drape_status drape_file_finish(drape_file *file);

/* The same for a file that will grow: it stays open. */
drape_status drape_file_publish(drape_file *file);

/* Ends a record of a published file: all its bytes are passed to the system. After a failure the file is
 * cut back to its last complete record and stays open. Errors: DRAPE_E_FILE. */
drape_status drape_file_keep(drape_file *file);

/* Waits until everything that a growing file keeps is on the disk. Errors: DRAPE_E_FILE. */
drape_status drape_file_sync(drape_file *file);

/* Waits until the names in the folder of the file are on the disk. Errors: DRAPE_E_FILE. */
drape_status drape_file_sync_names(drape_file *file);

/* Closes a file that grew, whose manifest then has its checksum; does nothing if it is not open. Errors:
 * DRAPE_E_FILE. */
drape_status drape_file_close(drape_file *file);

/* ---- Resuming a growing file ---- */

/* Archives length and checksum of the complete records, and the declared bytes; a file that is not published
 * has length 0. The bytes of an archive that is read must live until drape_file_trim. */
void drape_file_archive(drape_file *file, drape_archive *a);

/* Opens the file of an earlier process and checks that it begins with the archived records; nothing is
 * changed. Errors: DRAPE_E_FILE, DRAPE_E_PARSE (the file is damaged). */
drape_status drape_file_reopen(drape_file *file);

/* Makes the reopened file what it was when it was archived, to be continued. Errors: DRAPE_E_FILE. */
drape_status drape_file_trim(drape_file *file);

#endif
