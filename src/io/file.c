/* file.c: see file.h. */
#include "io/file.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

#define BUFFER_SIZE 65536
#define MAX_PRINT   1024
#define MAX_NAME    256
#define COPY_SIZE   4096 /* bytes that are archived at once */

static drape_status fail(const drape_file *file, const char *deed, int error)
{
    return file->folder ? drape_folder_fail(file->folder, deed, file->path, error)
                        : drape_file_fail(file->ctx, deed, file->path, error);
}

drape_status drape_file_create(drape_context *ctx, size_t path_length, drape_file *file)
{
    *file = (drape_file){.ctx = ctx, .capacity = path_length + DRAPE_PART_SIZE};
    file->path = drape_alloc(ctx, 2 * file->capacity + BUFFER_SIZE, 1);
    if (!file->path)
        return DRAPE_E_MEMORY;
    file->part = file->path + file->capacity;
    file->buffer = file->part + file->capacity;
    return DRAPE_OK;
}

drape_status drape_file_create_in(drape_context *ctx, drape_folder *folder, drape_file *file)
{
    drape_status status = drape_file_create(ctx, MAX_NAME, file);
    file->folder = folder;
    return status;
}

/* What the names of a file are relative to. */
static int base_of(const drape_file *file)
{
    return file->folder ? drape_folder_descriptor(file->folder) : AT_FDCWD;
}

/* 0 or errno. After EINTR the descriptor is closed, too, and no data were lost. */
static int close_descriptor(drape_file *file)
{
    file->open = false;
    return close(file->fd) && errno != EINTR ? errno : 0;
}

/* Removes a file that will not be published. */
static void drop(drape_file *file)
{
    if (*file->part)
        unlinkat(base_of(file), file->part, 0);
    *file->part = 0;
}

void drape_file_abandon(drape_file *file)
{
    if (!file->open)
        return;
    close_descriptor(file);
    drop(file);
}

void drape_file_destroy(drape_file *file)
{
    drape_file_abandon(file);
    if (file->path)
        drape_free(file->ctx, file->path);
    *file = (drape_file){.fd = -1};
}

void drape_file_name(drape_file *file, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(file->path, file->capacity, format, args);
    va_end(args);
}

drape_status drape_file_check_named(drape_context *ctx, const char *path, const char *input)
{
    struct stat named, read;
    const bool link = lstat(path, &named) == 0 && S_ISLNK(named.st_mode);
    if (stat(path, &named))
        return link ? drape_fail(ctx, DRAPE_E_ARGUMENT, "\"%.500s\" is a link to nothing; name a file", path)
                    : DRAPE_OK;
    if (S_ISREG(named.st_mode) && stat(input, &read) == 0 && read.st_dev == named.st_dev &&
        read.st_ino == named.st_ino)
        return drape_fail(ctx, DRAPE_E_ARGUMENT,
                          "\"%.500s\" would be replaced, but it is an input; name another file", path);
    if (link && S_ISREG(named.st_mode))
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "\"%.500s\" is a link; name the file that it leads to",
                          path);
    return DRAPE_OK;
}

/* ---- Opening ---- */

drape_status drape_file_begin(drape_file *file)
{
    if (file->folder && !drape_folder_is_name(file->path))
        return drape_fail(file->ctx, DRAPE_E_FILE,
                          "cannot write \"%.300s\" into the folder \"%.300s\": not the name of a file in it",
                          file->path, drape_folder_path(file->folder));
    struct stat info;
    const char *slash = strrchr(file->path, '/');
    uint64_t number;
    *file->part = 0;
    file->fd = -1;
    if (!file->folder && stat(file->path, &info) == 0 && !S_ISREG(info.st_mode)) {
        /* A pipe that nobody reads is an error at once. What is then written to it blocks as usual. */
        file->fd = open(file->path, O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
        if (file->fd >= 0)
            fcntl(file->fd, F_SETFL, fcntl(file->fd, F_GETFL) & ~O_NONBLOCK);
    } else if (getrandom(&number, sizeof number, 0) == (ssize_t)sizeof number) { /* a name beside its own */
        if (file->folder)
            drape_folder_part(file->folder, number, file->part);
        else
            snprintf(file->part, file->capacity, "%.*s.drape-%016" PRIx64 DRAPE_FILE_PART,
                     slash ? (int)(slash + 1 - file->path) : 0, file->path, number);
        file->fd = openat(base_of(file), file->part, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC,
                          (mode_t)0666);
    }
    if (file->fd < 0) {
        const int error = errno;
        *file->part = 0;
        return fail(file, "write", error);
    }
    file->open = true;
    file->used = 0;
    file->error = 0;
    file->size = file->kept = 0;
    file->sum = (drape_checksum){0};
    memset(file->change, 0, sizeof file->change);
    return DRAPE_OK;
}

/* ---- Writing ---- */

/* Writes the buffer to the file. After a failure all further bytes are dropped until the record ends. */
static void flush(drape_file *file)
{
    size_t done = 0;
    while (done < file->used && !file->error) {
        const char *from = file->buffer + done;
        ssize_t n = pwrite(file->fd, from, file->used - done, file->size + (off_t)done);
        if (n < 0 && errno == ESPIPE)
            n = write(file->fd, from, file->used - done);
        if (n > 0)
            done += (size_t)n;
        else if (n == 0)
            file->error = ENOSPC;
        else if (errno != EINTR)
            file->error = errno;
    }
    drape_checksum_add(&file->sum, file->buffer, done);
    file->size += (off_t)done;
    file->used = 0;
}

void drape_file_put(drape_file *file, const void *data, size_t size)
{
    const char *from = data;
    while (size > 0) {
        const size_t left = BUFFER_SIZE - file->used, part = size < left ? size : left;
        memcpy(file->buffer + file->used, from, part);
        file->used += part;
        from += part;
        size -= part;
        if (file->used == BUFFER_SIZE)
            flush(file);
    }
}

void drape_file_put_written(drape_file *file, uint64_t size, uint64_t sum, int error)
{
    flush(file);
    if (!file->error)
        file->error = error;
    if (file->error)
        return;
    file->sum.sum += sum;
    file->sum.size += size;
    file->size += (off_t)size;
}

bool drape_file_reach(const drape_file *file, char *path, size_t size)
{
    const int length =
        snprintf(path, size, "%s/%s", drape_folder_path(file->folder), *file->part ? file->part : file->path);
    return length > 0 && (size_t)length < size;
}

static void split_word(uint32_t word, unsigned char bytes[4])
{
    for (int b = 0; b < 4; b++)
        bytes[b] = (unsigned char)(word >> 8 * b);
}

void drape_file_put_word(drape_file *file, uint32_t word)
{
    unsigned char bytes[4];
    split_word(word, bytes);
    drape_file_put(file, bytes, sizeof bytes);
}

void drape_file_put_float(drape_file *file, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    drape_file_put_word(file, bits);
}

void drape_file_put_text(drape_file *file, const char *text)
{
    drape_file_put(file, text, strlen(text));
}

void drape_file_put_doubles(drape_file *file, const double *values, size_t count)
{
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    drape_file_put(file, values, count * sizeof *values);
#else
    for (size_t i = 0; i < count; i++) {
        uint64_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        bits = __builtin_bswap64(bits);
        drape_file_put(file, &bits, sizeof bits);
    }
#endif
}

void drape_file_print(drape_file *file, const char *format, ...)
{
    char text[MAX_PRINT];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    drape_file_put_text(file, text);
}

/* ---- Overwriting ---- */

int64_t drape_file_end(const drape_file *file)
{
    return (int64_t)file->size + (int64_t)file->used;
}

/* The checksum changes by that of the words that the bytes touch. */
void drape_file_overwrite(drape_file *file, off_t offset, const void *data, size_t size)
{
    const off_t begin = offset / 8 * 8, end = offset + (off_t)size, last = (end + 7) / 8 * 8;
    drape_checksum before, after;
    flush(file);
    if (!file->error)
        file->error = drape_disk_sum(file->fd, begin, last < file->size ? last : file->size, NULL, &before);
    if (!file->error)
        file->error = drape_write_at(file->fd, offset, data, size);
    if (file->error)
        return;
    file->size = end > file->size ? end : file->size;
    file->error = drape_disk_sum(file->fd, begin, last < file->size ? last : file->size, NULL, &after);
    file->sum.sum += after.sum - before.sum;
    if (last >= file->size) {
        file->sum.size = after.size;
        memcpy(file->sum.tail, after.tail, sizeof after.tail);
    }
}

void drape_file_overwrite_word(drape_file *file, off_t offset, uint32_t word)
{
    unsigned char bytes[4];
    split_word(word, bytes);
    drape_file_overwrite(file, offset, bytes, sizeof bytes);
}

void drape_file_declare(drape_file *file, int64_t offset, size_t size)
{
    drape_disk_bytes *c = file->change;
    while (c < file->change + DRAPE_DISK_BYTES && c->size > 0)
        c++;
    assert(c < file->change + DRAPE_DISK_BYTES);
    *c = (drape_disk_bytes){.offset = offset, .size = (int64_t)size};
}

/* ---- Ending ---- */

/* Records the file in its manifest, then gives it its name. */
static drape_status give_name(drape_file *file, bool growing)
{
    drape_status status = DRAPE_OK;
    if (!*file->part)
        return DRAPE_OK;
    if (!file->folder) {
        status = rename(file->part, file->path) ? fail(file, "write", errno) : DRAPE_OK;
    } else {
        status =
            drape_folder_note(file->folder, file->path, growing ? NULL : &file->sum, file->fd, file->durable);
        if (!status)
            status = drape_folder_publish(file->folder, file->part, file->path, &file->last);
    }
    if (status)
        drop(file);
    *file->part = 0;
    return status;
}

drape_status drape_file_publish(drape_file *file)
{
    flush(file);
    drape_status status = file->error ? fail(file, "write", file->error) : give_name(file, true);
    if (status)
        drape_file_abandon(file);
    else if (fstat(file->fd, &file->last))
        file->last = (struct stat){0};
    file->kept = file->size;
    return status;
}

/* Closes the file before the rename: some file systems report a full disk only on closing. */
drape_status drape_file_finish(drape_file *file)
{
    struct stat info;
    flush(file);
    if (file->durable && !file->error)
        file->error = drape_disk_sync(file->fd);
    const bool known = fstat(file->fd, &info) == 0;
    const int closing = close_descriptor(file), error = file->error ? file->error : closing;
    if (error)
        drop(file);
    const drape_status status = error ? fail(file, "write", error) : give_name(file, false);
    if (!status && known)
        file->last = info;
    return status;
}

/* A file that cannot be cut, such as a pipe, stays as it is. */
drape_status drape_file_keep(drape_file *file)
{
    flush(file);
    const int error = file->error;
    file->error = 0;
    if (!error) {
        file->kept = file->size;
        return DRAPE_OK;
    }
    if (ftruncate(file->fd, file->kept) == 0) {
        file->size = file->kept;
        drape_disk_sum(file->fd, 0, file->size, NULL, &file->sum);
    }
    return fail(file, "write", error);
}

drape_status drape_file_sync(drape_file *file)
{
    int error = file->open ? drape_disk_sync(file->fd) : 0;
    return error ? fail(file, "write", error) : DRAPE_OK;
}

/* A folder may be writable without being readable. */
drape_status drape_file_sync_names(drape_file *file)
{
    if (file->folder)
        return drape_folder_sync(file->folder);
    const int fd = drape_disk_open_parent(file->path);
    int error = fd < 0 ? errno : drape_disk_sync(fd);
    if (fd >= 0)
        close(fd);
    return error && error != EACCES ? fail(file, "write the folder of", error) : DRAPE_OK;
}

/* ---- Resuming ---- */

void drape_file_archive(drape_file *file, drape_archive *a)
{
    int64_t kept = file->kept, sum = (int64_t)file->sum.sum;
    drape_archive_int64(a, &kept);
    drape_archive_int64(a, &sum);
    for (drape_disk_bytes *c = file->change; c < file->change + DRAPE_DISK_BYTES; c++) {
        drape_archive_int64(a, &c->offset);
        drape_archive_int64(a, &c->size);
        if (drape_archive_has_read(a)) {
            if (c->size < 0 || c->size > kept || c->offset < -kept ||
                drape_disk_place(c, kept) > kept - c->size)
                drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint overwrites bytes beyond a file");
            c->bytes = drape_archive_next(a, (size_t)c->size);
        }
        for (int64_t done = 0; !a->reading && done < c->size && !a->status;) {
            unsigned char bytes[COPY_SIZE];
            const size_t n = c->size - done < COPY_SIZE ? (size_t)(c->size - done) : COPY_SIZE;
            const int error = drape_read_at(file->fd, bytes, n, drape_disk_place(c, kept) + (off_t)done);
            if (error)
                drape_archive_note(a, fail(file, "read", error));
            drape_archive_bytes(a, bytes, n);
            done += (int64_t)n;
        }
    }
    if (drape_archive_has_read(a)) {
        file->kept = file->size = (off_t)kept;
        file->sum.sum = (uint64_t)sum;
    }
}

drape_status drape_file_reopen(drape_file *file)
{
    const uint64_t expected = file->sum.sum;
    *file->part = 0;
    file->fd = drape_open_regular(drape_folder_descriptor(file->folder), file->path, O_RDWR | O_NOFOLLOW);
    file->open = file->fd >= 0;
    if (!file->open || fstat(file->fd, &file->last))
        return fail(file, "continue", errno);
    if (file->last.st_size < file->kept)
        return drape_fail(
            file->ctx, DRAPE_E_FILE,
            "cannot continue \"%.300s/%.200s\": it has %lld bytes, and had %lld at the checkpoint",
            drape_folder_path(file->folder), file->path, (long long)file->last.st_size,
            (long long)file->kept);
    const int error = drape_disk_sum(file->fd, 0, file->kept, file->change, &file->sum);
    if (error)
        return fail(file, "continue", error);
    return file->sum.sum == expected
               ? DRAPE_OK
               : drape_folder_damaged(file->folder, file->path, "its checksum is not that of the checkpoint");
}

drape_status drape_file_trim(drape_file *file)
{
    drape_status status = drape_folder_note(file->folder, file->path, NULL, file->fd, file->durable);
    int error = 0;
    for (drape_disk_bytes *c = file->change; c < file->change + DRAPE_DISK_BYTES && !status && !error; c++)
        error = drape_write_at(file->fd, drape_disk_place(c, file->kept), c->bytes, (size_t)c->size);
    if (!status && !error && ftruncate(file->fd, file->kept))
        error = errno;
    return error ? fail(file, "continue", error) : status;
}

drape_status drape_file_close(drape_file *file)
{
    if (!file->open)
        return DRAPE_OK;
    const bool published = !*file->part && file->folder;
    int error = file->durable ? drape_disk_sync(file->fd) : 0;
    const int closing = close_descriptor(file);
    error = error ? error : closing;
    drop(file);
    if (error)
        return fail(file, "close", error);
    return published ? drape_folder_note(file->folder, file->path, &file->sum, -1, file->durable) : DRAPE_OK;
}
