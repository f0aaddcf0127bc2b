/* archive.c: see archive.h. */
#include "base/archive.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define FORMAT     3
#define OLD_FORMAT 1               /* its checksum was another one */
#define MAGIC      "DRAPE\r\n\x1a" /* its line ends make text-mode transfers break it at once */
#define MAGIC_SIZE 8
#define HEAD       (MAGIC_SIZE + sizeof(uint32_t))
#define TAIL       (2 * sizeof(uint64_t))
#define MARK_SIZE  32

drape_status drape_archive_fail(drape_archive *a, drape_status status, const char *format, ...)
{
    char text[DRAPE_MESSAGE_SIZE / 2];
    va_list values;
    if (a->status)
        return a->status;
    va_start(values, format);
    vsnprintf(text, sizeof text, format, values);
    va_end(values);
    a->status = status;
    return drape_fail(a->ctx, status, "%.400s: %s", a->name, text);
}

void drape_archive_note(drape_archive *a, drape_status status)
{
    if (!a->status)
        a->status = status;
}

/* ---- Writing ---- */

static void flush(drape_archive *a)
{
    if (!a->status && a->used > 0) {
        drape_checksum_add(&a->sum, a->buffer, a->used);
        drape_archive_note(a, a->write(a->user, a->buffer, a->used));
    }
    a->used = 0;
}

static void put(drape_archive *a, const void *data, size_t size)
{
    const unsigned char *from = data;
    a->size += size;
    while (size > 0) {
        size_t space = DRAPE_ARCHIVE_BUFFER - a->used, part = size < space ? size : space;
        memcpy(a->buffer + a->used, from, part);
        a->used += part;
        from += part;
        size -= part;
        if (a->used == DRAPE_ARCHIVE_BUFFER)
            flush(a);
    }
}

void drape_archive_write_to(drape_archive *a, drape_context *ctx, const char *name, drape_write *write,
                            drape_write_rows *write_rows, void *user)
{
    const uint32_t format = FORMAT;
    a->ctx = ctx;
    a->name = name;
    a->reading = a->by_ranks = false;
    a->status = DRAPE_OK;
    a->write = write;
    a->write_rows = write_rows;
    a->user = user;
    a->sum = (drape_checksum){0};
    a->used = 0;
    a->size = 0;
    put(a, MAGIC, MAGIC_SIZE);
    put(a, &format, sizeof format);
}

/* ---- Reading ---- */

drape_status drape_archive_read_from(drape_archive *a, drape_context *ctx, const char *name,
                                     const void *bytes, size_t size)
{
    uint64_t length, sum;
    uint32_t format;
    a->ctx = ctx;
    a->name = name;
    a->reading = true;
    a->by_ranks = false;
    a->status = DRAPE_OK;
    a->from = bytes;
    a->size = HEAD;
    a->end = 0;
    if (size < HEAD + TAIL || memcmp(a->from, MAGIC, MAGIC_SIZE) != 0)
        return drape_archive_fail(a, DRAPE_E_PARSE, "it is not a Drape checkpoint");
    memcpy(&format, a->from + MAGIC_SIZE, sizeof format);
    memcpy(&length, a->from + size - TAIL, sizeof length);
    memcpy(&sum, a->from + size - sizeof sum, sizeof sum);
    const bool whole = length == size - TAIL && drape_checksum_bytes(0, a->from, size - sizeof sum) == sum;
    if (format != OLD_FORMAT && !whole)
        return drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint is damaged: its checksum is wrong");
    if (format != FORMAT)
        return drape_archive_fail(a, DRAPE_E_VERSION,
                                  "the checkpoint has format %" PRIu32 "; this build reads format %d", format,
                                  FORMAT);
    a->end = size - TAIL;
    return a->status;
}

const unsigned char *drape_archive_next(drape_archive *a, size_t size)
{
    if (!a->status && size > a->end - a->size)
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint is truncated");
    if (a->status)
        return NULL;
    a->size += size;
    return a->from + a->size - size;
}

/* ---- Parts ---- */

void drape_archive_bytes(drape_archive *a, void *data, size_t size)
{
    if (size == 0)
        return;
    if (a->reading) {
        const unsigned char *from = drape_archive_next(a, size);
        if (from)
            memcpy(data, from, size);
        else
            memset(data, 0, size);
    } else if (!a->status) {
        put(a, data, size);
    }
}

void drape_archive_align(drape_archive *a)
{
    static const unsigned char zeros[8] = {0};
    unsigned char padding[sizeof zeros] = {0};
    drape_archive_bytes(a, padding, (sizeof zeros - a->size % sizeof zeros) % sizeof zeros);
    if (drape_archive_good(a) && memcmp(padding, zeros, sizeof zeros) != 0)
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has no array where one is expected");
}

void drape_archive_rows(drape_archive *a, const struct drape_rows *rows, size_t size)
{
    uint64_t sum = 0;
    flush(a);
    a->write_rows(a->user, a->size, size, rows, &sum);
    a->sum.sum += sum;
    a->sum.size += size;
    a->size += size;
}

void drape_archive_doubles(drape_archive *a, double *values, size_t count)
{
    drape_archive_bytes(a, values, count * sizeof *values);
}

void drape_archive_double(drape_archive *a, double *value)
{
    drape_archive_bytes(a, value, sizeof *value);
}

void drape_archive_int64(drape_archive *a, int64_t *value)
{
    drape_archive_bytes(a, value, sizeof *value);
}

void drape_archive_int32(drape_archive *a, int32_t *value)
{
    drape_archive_bytes(a, value, sizeof *value);
}

void drape_archive_int(drape_archive *a, int *value)
{
    drape_archive_bytes(a, value, sizeof *value);
}

void drape_archive_bool(drape_archive *a, bool *value)
{
    unsigned char byte = *value;
    drape_archive_bytes(a, &byte, 1);
    *value = byte != 0;
}

void drape_archive_text(drape_archive *a, char *text, size_t size)
{
    int64_t length = a->reading ? 0 : (int64_t)strlen(text);
    drape_archive_int64(a, &length);
    if (length < 0 || (uint64_t)length >= size) {
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has an invalid text of %" PRId64 " bytes",
                           length);
        length = 0;
    }
    drape_archive_bytes(a, text, (size_t)length);
    text[length] = 0;
}

void drape_archive_mark(drape_archive *a, const char *name)
{
    char found[MARK_SIZE];
    snprintf(found, sizeof found, "%s", name);
    drape_archive_text(a, found, sizeof found);
    if (!a->status && strcmp(found, name) != 0)
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has \"%s\" where \"%s\" is expected", found,
                           name);
}

void drape_archive_same(drape_archive *a, const char *what, int64_t value)
{
    int64_t there = value;
    drape_archive_int64(a, &there);
    if (!a->status && there != value)
        drape_archive_fail(a, DRAPE_E_ARGUMENT,
                           "the checkpoint does not fit this sim: %s is %" PRId64 " there, %" PRId64 " here",
                           what, there, value);
}

/* ---- End ---- */

drape_status drape_archive_end(drape_archive *a)
{
    drape_archive_mark(a, "end");
    if (!a->reading) {
        const uint64_t length = a->size;
        put(a, &length, sizeof length);
        flush(a);
        const uint64_t sum = a->sum.sum;
        put(a, &sum, sizeof sum);
        flush(a);
    } else if (!a->status && a->size != a->end) {
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint is longer than expected");
    }
    return a->status;
}
