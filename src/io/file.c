/* file.c: see file.h. */
#include "io/file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define BUFFER_SIZE 65536
#define MAX_PRINT   1024

drape_status drape_file_fail(drape_context *ctx, const char *deed, const char *path, int error)
{
    char text[128];
    if (strerror_r(error, text, sizeof text))
        snprintf(text, sizeof text, "error %d", error);
    return drape_fail(ctx, DRAPE_E_FILE, "cannot %s \"%.500s\": %s", deed, path, text);
}

drape_status drape_file_create(drape_context *ctx, size_t path_length, drape_file *file)
{
    *file = (drape_file){.ctx = ctx, .path_size = path_length + sizeof DRAPE_FILE_PART};
    file->path = drape_alloc(ctx, 2 * file->path_size + BUFFER_SIZE, 1);
    if (!file->path)
        return DRAPE_E_MEMORY;
    file->part = file->path + file->path_size;
    file->buffer = file->part + file->path_size;
    return DRAPE_OK;
}

/* 0 or errno. After EINTR the descriptor is closed, too, and no data were lost. */
static int close_descriptor(drape_file *file)
{
    file->open = false;
    return close(file->fd) && errno != EINTR ? errno : 0;
}

/* Renames the file to its own name or, after an error, removes it. Returns that error, or that of the
 * rename. */
static int settle(drape_file *file, int error)
{
    if (*file->part && !error && rename(file->part, file->path))
        error = errno;
    if (*file->part && error)
        unlink(file->part);
    *file->part = 0;
    return error;
}

void drape_file_abandon(drape_file *file)
{
    if (!file->open)
        return;
    close_descriptor(file);
    settle(file, ECANCELED);
}

void drape_file_destroy(drape_file *file)
{
    drape_file_abandon(file);
    if (file->path)
        drape_free(file->ctx, file->path);
    *file = (drape_file){0};
}

void drape_file_name(drape_file *file, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(file->path, file->path_size, format, args);
    va_end(args);
}

drape_status drape_file_begin(drape_file *file)
{
    struct stat info;
    bool in_place = lstat(file->path, &info) == 0 && !S_ISREG(info.st_mode);
    snprintf(file->part, file->path_size, "%s%s", in_place ? "" : file->path,
             in_place ? "" : DRAPE_FILE_PART);
    file->fd =
        open(in_place ? file->path : file->part, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, (mode_t)0666);
    if (file->fd < 0) {
        *file->part = 0;
        return drape_file_fail(file->ctx, "write", file->path, errno);
    }
    file->open = true;
    file->used = 0;
    file->error = 0;
    file->size = file->kept = 0;
    return DRAPE_OK;
}

/* Writes the buffer to the file. After a failure all further bytes are dropped until the record ends. */
static void flush(drape_file *file)
{
    size_t done = 0;
    while (done < file->used && !file->error) {
        ssize_t n = write(file->fd, file->buffer + done, file->used - done);
        if (n > 0)
            done += (size_t)n;
        else if (n == 0)
            file->error = ENOSPC;
        else if (errno != EINTR)
            file->error = errno;
    }
    file->size += (off_t)done;
    file->used = 0;
}

void drape_file_put(drape_file *file, const void *data, size_t size)
{
    const char *from = data;
    while (size > 0) {
        size_t room = BUFFER_SIZE - file->used, part = size < room ? size : room;
        memcpy(file->buffer + file->used, from, part);
        file->used += part;
        from += part;
        size -= part;
        if (file->used == BUFFER_SIZE)
            flush(file);
    }
}

void drape_file_put_word(drape_file *file, uint32_t word)
{
    unsigned char bytes[4];
    for (int b = 0; b < 4; b++)
        bytes[b] = (unsigned char)(word >> 8 * b);
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
    for (size_t i = 0; i < count; i++) {
        unsigned char bytes[8];
        uint64_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        for (int b = 0; b < 8; b++)
            bytes[b] = (unsigned char)(bits >> 8 * b);
        drape_file_put(file, bytes, sizeof bytes);
    }
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

drape_status drape_file_publish(drape_file *file)
{
    flush(file);
    int error = settle(file, file->error);
    if (error) {
        close_descriptor(file);
        return drape_file_fail(file->ctx, "write", file->path, error);
    }
    file->kept = file->size;
    return DRAPE_OK;
}

/* 0 or errno. A file that cannot be synced, such as a pipe, has no disk to wait for. */
static int sync_descriptor(int fd)
{
    int code;
    do
        code = fsync(fd);
    while (code && errno == EINTR);
    return code && errno != EINVAL && errno != ENOTSUP ? errno : 0;
}

/* Closes the file before the rename: some file systems report a full disk only on closing. */
drape_status drape_file_finish(drape_file *file)
{
    flush(file);
    if (file->durable && !file->error)
        file->error = sync_descriptor(file->fd);
    int closing = close_descriptor(file);
    int error = settle(file, file->error ? file->error : closing);
    return error ? drape_file_fail(file->ctx, "write", file->path, error) : DRAPE_OK;
}

/* A file that cannot be cut, such as a pipe, stays as it is; the failure that led here is the one to
 * report. */
void drape_file_cut(drape_file *file, off_t size)
{
    if (ftruncate(file->fd, size) == 0 && lseek(file->fd, size, SEEK_SET) == size)
        file->size = file->kept = size;
}

drape_status drape_file_keep(drape_file *file)
{
    flush(file);
    int error = file->error;
    file->error = 0;
    if (!error) {
        file->kept = file->size;
        return DRAPE_OK;
    }
    drape_file_cut(file, file->kept);
    return drape_file_fail(file->ctx, "write", file->path, error);
}

drape_status drape_file_overwrite(drape_file *file, off_t offset, const void *data, size_t size)
{
    const char *from = data;
    while (size > 0) {
        ssize_t n = pwrite(file->fd, from, size, offset);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return drape_file_fail(file->ctx, "write", file->path, n < 0 ? errno : ENOSPC);
        from += n;
        offset += n;
        size -= (size_t)n;
    }
    return DRAPE_OK;
}

/* Its own failures are ignored: the one that led here is the one to report. */
void drape_file_restore(drape_file *file, off_t offset, const void *data, size_t size)
{
    if (pwrite(file->fd, data, size, offset) == (ssize_t)size)
        drape_file_cut(file, offset + (off_t)size);
}

drape_status drape_file_sync(drape_file *file)
{
    int error = file->open ? sync_descriptor(file->fd) : 0;
    return error ? drape_file_fail(file->ctx, "write", file->path, error) : DRAPE_OK;
}

/* Checks that it is a regular file of at least this size, and reports why not. */
static drape_status check_reopened(drape_file *file, off_t size)
{
    struct stat info;
    if (fstat(file->fd, &info))
        return drape_file_fail(file->ctx, "continue", file->path, errno);
    if (!S_ISREG(info.st_mode))
        return drape_fail(file->ctx, DRAPE_E_FILE, "cannot continue \"%.500s\": it is not a regular file",
                          file->path);
    if (info.st_size < size)
        return drape_fail(file->ctx, DRAPE_E_FILE,
                          "cannot continue \"%.500s\": it has %lld bytes, and had %lld at the checkpoint",
                          file->path, (long long)info.st_size, (long long)size);
    return lseek(file->fd, size, SEEK_SET) == size
               ? DRAPE_OK
               : drape_file_fail(file->ctx, "continue", file->path, errno);
}

drape_status drape_file_reopen(drape_file *file, off_t size)
{
    *file->part = 0;
    file->fd = open(file->path, O_WRONLY | O_CLOEXEC | O_NONBLOCK);
    if (file->fd < 0)
        return drape_file_fail(file->ctx, "continue", file->path, errno);
    file->open = true;
    file->used = 0;
    file->error = 0;
    file->size = file->kept = size;
    return check_reopened(file, size);
}

drape_status drape_file_trim(drape_file *file)
{
    return ftruncate(file->fd, file->kept) == 0 ? DRAPE_OK
                                                : drape_file_fail(file->ctx, "cut", file->path, errno);
}

drape_status drape_file_close(drape_file *file)
{
    int error = file->open ? close_descriptor(file) : 0;
    return error ? drape_file_fail(file->ctx, "close", file->path, error) : DRAPE_OK;
}

/* 0 or errno. An existing folder is a success whatever error mkdir reports, such as EROFS. */
static int make_one(const char *path)
{
    struct stat info;
    if (mkdir(path, (mode_t)0777) == 0)
        return 0;
    int error = errno;
    if (stat(path, &info))
        return error;
    return S_ISDIR(info.st_mode) ? 0 : ENOTDIR;
}

drape_status drape_folder_make(drape_context *ctx, char *path)
{
    int error = 0;
    for (char *slash = strchr(path + 1, '/'); slash && !error; slash = strchr(slash + 1, '/')) {
        *slash = 0;
        error = make_one(path);
        *slash = '/';
    }
    if (!error)
        error = make_one(path);
    return error ? drape_file_fail(ctx, "make the folder", path, error) : DRAPE_OK;
}

static int sync_folder(const char *folder)
{
    int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0)
        return errno == EACCES ? 0 : errno; /* a folder may be writable without being readable */
    int error = sync_descriptor(fd);
    close(fd);
    return error;
}

drape_status drape_folder_sync(drape_context *ctx, char *path)
{
    char *slash = strrchr(path, '/');
    if (slash && slash > path)
        *slash = 0;
    int error = sync_folder(!slash ? "." : slash == path ? "/" : path);
    if (slash)
        *slash = '/';
    return error ? drape_file_fail(ctx, "write the folder of", path, error) : DRAPE_OK;
}
