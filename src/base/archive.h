/*
 * archive.h: object state as bytes, written and read back by the same code. A function that archives an
 * object names its parts once, in one order, and the archive knows the direction.
 *
 *     magic, version of the format     12 bytes
 *     the parts                        in the byte order of the machine, which the reader must share
 *     length of all before, checksum   16 bytes
 *
 * The checksum is FNV-1a. Each of its steps is a bijection, so a change of one byte always changes the
 * checksum. It is compared before any part is read; readers therefore need not guard against damage, only
 * against archives of other objects. After a failure nothing more is read or written and the first status is
 * kept, so callers need to check the status only at the end. Nothing is allocated.
 */
#ifndef DRAPE_BASE_ARCHIVE_H
#define DRAPE_BASE_ARCHIVE_H

#include "base/context.h"

#define DRAPE_ARCHIVE_BUFFER 4096

typedef struct drape_archive {
    drape_context *ctx;
    const char *name; /* name of the file, for messages */
    bool reading;
    bool by_ranks;       /* of a run on several ranks: without what only a rank or a solver remembers */
    drape_status status; /* the first failure */
    uint64_t size;       /* bytes written or read so far */
    drape_write *write;  /* writing: receives the bytes, through the buffer */
    void *user;
    uint64_t hash;             /* of the bytes that have left the buffer */
    const unsigned char *from; /* reading: all bytes; the parts end at `end` */
    size_t end;
    size_t used; /* bytes in the buffer */
    unsigned char buffer[DRAPE_ARCHIVE_BUFFER];
} drape_archive;

/* name must outlive the archive. */
void drape_archive_write_to(drape_archive *a, drape_context *ctx, const char *name, drape_write *write,
                            void *user);

/* Checks length, checksum and version of the format. bytes must outlive the archive. The status is returned
 * and kept in a->status. Errors: DRAPE_E_PARSE, DRAPE_E_VERSION. */
drape_status drape_archive_read_from(drape_archive *a, drape_context *ctx, const char *name,
                                     const void *bytes, size_t size);

/* Writes the length and checksum, or checks that everything was read. Returns the status. */
drape_status drape_archive_end(drape_archive *a);

/* Write or read one part. */
void drape_archive_bytes(drape_archive *a, void *data, size_t size);
void drape_archive_doubles(drape_archive *a, double *values, size_t count);
void drape_archive_double(drape_archive *a, double *value);
void drape_archive_int64(drape_archive *a, int64_t *value);
void drape_archive_int32(drape_archive *a, int32_t *value);
void drape_archive_int(drape_archive *a, int *value);
void drape_archive_bool(drape_archive *a, bool *value);

/* A text shorter than size bytes. */
void drape_archive_text(drape_archive *a, char *text, size_t size);

/* A name between parts: reading fails if another name is found. */
void drape_archive_mark(drape_archive *a, const char *name);

/* A value that must be the same when it is read, such as a size. what: its name for the message "WHAT is 3
 * there, 4 here". */
void drape_archive_same(drape_archive *a, const char *what, int64_t value);

/* Whether no failure has occurred: for loops, and for actions that must not follow a failure. */
static inline bool drape_archive_good(const drape_archive *a)
{
    return a->status == DRAPE_OK;
}

/* Whether the archive is reading and no failure has occurred, so that the values named so far were read and
 * can be checked and used. The member `reading` is only the direction: it is also true after a failure, when
 * values are left as they were. */
static inline bool drape_archive_has_read(const drape_archive *a)
{
    return a->reading && a->status == DRAPE_OK;
}

/* Records a failure, unless there was one before, with the message "NAME: text". Returns the status that is
 * kept. */
drape_status drape_archive_fail(drape_archive *a, drape_status status, const char *format, ...)
    DRAPE_PRINTF(3, 4);

/* Records the failure of a function that has set its own message. */
void drape_archive_note(drape_archive *a, drape_status status);

#endif
