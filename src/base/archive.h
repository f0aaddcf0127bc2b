/*
 * archive.h: object state as bytes, written and read back by the same code. A function that archives an
 * object names its parts once, in one order, and the archive knows the direction.
 *
 *     magic, version of the format     12 bytes
 *     the parts                        in the byte order of the machine, which the reader must share
 *     length of all before, checksum   16 bytes
 *
 * The checksum (base/checksum.h) is of all bytes before it, and can be computed in any order: where ranks
 * share a model, each writes its own rows of an array. It always detects a change within one word of 8 bytes,
 * and misses any other change, such as words that change places, with a probability of 2^-64; the length
 * detects a cut. Both are compared before any part is read; readers
 * therefore need not guard against damage, only against archives of other objects. After a failure nothing
 * more is read or written and the first status is kept, so callers need to check the status only at the end.
 * Nothing is allocated.
 */
#ifndef DRAPE_BASE_ARCHIVE_H
#define DRAPE_BASE_ARCHIVE_H

#include "base/checksum.h"
#include "base/context.h"

#define DRAPE_ARCHIVE_BUFFER 4096

struct drape_rows;

/* Bytes of the longest text that an archive has: the description of a build. */
#define DRAPE_ARCHIVE_TEXT 320

/* Writes the rows of all ranks (base/ranks.h) from this offset on, where the next bytes would be. `size`: of
 * the whole array; *sum: what it adds to the checksum. Collective. The file reports a failure when it
 * ends. */
typedef void drape_write_rows(void *user, uint64_t offset, uint64_t size, const struct drape_rows *rows,
                              uint64_t *sum);

typedef struct drape_archive {
    drape_context *ctx;
    const char *name; /* name of the file, for messages */
    bool reading;
    bool by_ranks;       /* of a run on several ranks: without what only a rank or a solver remembers */
    drape_status status; /* the first failure */
    uint64_t size;       /* bytes written or read so far */
    drape_write *write;  /* writing: receives the bytes, through the buffer */
    drape_write_rows *write_rows; /* the same for rows; NULL: one process has all of them */
    void *user;
    drape_checksum sum;        /* of the bytes that have left the buffer */
    const unsigned char *from; /* reading: all bytes; the parts end at `end` */
    size_t end;
    size_t used; /* bytes in the buffer */
    unsigned char buffer[DRAPE_ARCHIVE_BUFFER];
} drape_archive;

/* name must outlive the archive. write_rows: NULL if no ranks share what is archived. */
void drape_archive_write_to(drape_archive *a, drape_context *ctx, const char *name, drape_write *write,
                            drape_write_rows *write_rows, void *user);

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

/* Zeros, to a multiple of 8 bytes from the beginning, as rows need it. */
void drape_archive_align(drape_archive *a);

/* Writes an array of `size` bytes of which each rank has some rows; the archive must be aligned. Collective:
 * after a failure, too. */
void drape_archive_rows(drape_archive *a, const struct drape_rows *rows, size_t size);

/* Reads bytes where they are; NULL after a failure. They live as long as those of the archive, and have no
 * alignment. */
const unsigned char *drape_archive_next(drape_archive *a, size_t size);

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
