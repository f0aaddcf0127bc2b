/*
 * archive.h: a state as bytes, written and read back by the same code: each function that archives something
 * names its parts once, and the archive knows the direction. What is read is put where what is written was.
 *
 *     magic, version of the format     12 bytes
 *     what was archived                in the byte order of the machine, which the reader must share
 *     length of all before, checksum   16 bytes
 *
 * The checksum is FNV-1a, whose every step is a bijection: one byte that differs makes it differ, whatever
 * the rest. It is compared before anything is read, so whoever reads needs to guard against what was archived
 * of something else, not against damage. After a failure nothing is read or written any more and the first
 * status stays: no caller needs to look before the end. Nothing is allocated.
 */
#ifndef DRAPE_BASE_ARCHIVE_H
#define DRAPE_BASE_ARCHIVE_H

#include "base/context.h"

#define DRAPE_ARCHIVE_BUFFER 4096

typedef struct drape_archive {
    drape_context *ctx;
    const char *name; /* of the file, for messages */
    bool reading;
    drape_status status; /* the first failure */
    uint64_t size;       /* bytes so far */
    drape_write *write;  /* writing: where bytes go, through the buffer, and whose it is */
    void *user;
    uint64_t hash;             /* of the bytes that left the buffer */
    const unsigned char *from; /* reading: all of it, of which `end` bytes are to be read */
    size_t end;
    size_t used; /* of the buffer */
    unsigned char buffer[DRAPE_ARCHIVE_BUFFER];
} drape_archive;

/* name outlives the archive. */
void drape_archive_write_to(drape_archive *a, drape_context *ctx, const char *name, drape_write *write,
                            void *user);

/* Checks the whole: length, checksum, version of the format. bytes outlive the archive. Errors, in a->status
 * too: DRAPE_E_PARSE, DRAPE_E_VERSION. */
drape_status drape_archive_read_from(drape_archive *a, drape_context *ctx, const char *name,
                                     const void *bytes, size_t size);

/* Ends what was written with its checksum, or makes sure that all was read. Returns the status. */
drape_status drape_archive_end(drape_archive *a);

/* Parts, in either direction. */
void drape_archive_bytes(drape_archive *a, void *data, size_t size);
void drape_archive_doubles(drape_archive *a, double *values, size_t count);
void drape_archive_double(drape_archive *a, double *value);
void drape_archive_int64(drape_archive *a, int64_t *value);
void drape_archive_int32(drape_archive *a, int32_t *value);
void drape_archive_int(drape_archive *a, int *value);
void drape_archive_bool(drape_archive *a, bool *value);

/* Texts below size bytes. */
void drape_archive_text(drape_archive *a, char *text, size_t size);

/* A name between parts: reading stops where another one stands. */
void drape_archive_mark(drape_archive *a, const char *name);

/* Something that must be the same where it is read, such as a size; what: for the message "WHAT is 3 there, 4
 * here". */
void drape_archive_same(drape_archive *a, const char *what, int64_t value);

/* Whether to go on: for loops and for what must not be done after a failure. */
static inline bool drape_archive_good(const drape_archive *a)
{
    return a->status == DRAPE_OK;
}

/* Reading, and no failure so far. */
static inline bool drape_archive_is_reading(const drape_archive *a)
{
    return a->reading && a->status == DRAPE_OK;
}

/* Notes a failure, unless there was one: the message "NAME: text". Returns the status that stays. */
drape_status drape_archive_fail(drape_archive *a, drape_status status, const char *format, ...)
    DRAPE_PRINTF(3, 4);

/* Of a function that told itself what is wrong. */
void drape_archive_note(drape_archive *a, drape_status status);

#endif
