/* file.c: see file.h. */
#include "io/file.h"

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
#define PATCHED     4096 /* bytes that are overwritten at once */

drape_status drape_file_fail(drape_context *ctx, const char *deed, const char *path, int error)
{
    char text[128];
    if (strerror_r(error, text, sizeof text))
        snprintf(text, sizeof text, "error %d", error);
    return drape_fail(ctx, error == ENOMEM ? DRAPE_E_MEMORY : DRAPE_E_FILE, "cannot %s \"%.500s\": %s", deed,
                      path, text);
}

/* The same for a file, by its whole name. */
static drape_status fail(const drape_file *file, const char *deed, int error)
{
    char path[512];
    if (!file->folder)
        return drape_file_fail(file->ctx, deed, file->path, error);
    snprintf(path, sizeof path, "%.300s/%.200s", drape_folder_path(file->folder), file->path);
    return drape_file_fail(file->ctx, deed, path, error);
}

int drape_open_regular(int dir, const char *path, int flags)
{
    struct stat info;
    const int fd = openat(dir, path, flags | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    if (fd >= 0 && fstat(fd, &info) == 0 && S_ISREG(info.st_mode))
        return fd;
    const bool special = fd >= 0 || errno == ELOOP || errno == ENXIO || errno == EISDIR;
    if (fd >= 0)
        close(fd);
    errno = special ? EINVAL : errno;
    return -1;
}

int drape_file_open(drape_context *ctx, const char *path)
{
    const int fd = drape_open_regular(AT_FDCWD, path, O_RDONLY), error = errno;
    if (fd < 0 && error != EINVAL)
        drape_file_fail(ctx, "read", path, error);
    else if (fd < 0)
        drape_fail(ctx, DRAPE_E_FILE, "cannot read \"%.500s\": it is not a regular file", path);
    errno = error;
    return fd;
}

drape_status drape_file_take(drape_context *ctx, int fd, const char *path, off_t limit, char **bytes,
                             size_t *size)
{
    struct stat info;
    int error = fstat(fd, &info) ? errno : info.st_size > limit ? EFBIG : 0;
    char *to = *bytes = error ? NULL : drape_alloc(ctx, (size_t)info.st_size + 1, 1);
    for (*size = 0; to && !error && *size < (size_t)info.st_size;) {
        const ssize_t n = read(fd, to + *size, (size_t)info.st_size - *size);
        if (n > 0)
            *size += (size_t)n;
        else if (n == 0) /* it was shortened meanwhile */
            error = EIO;
        else if (errno != EINTR)
            error = errno;
    }
    close(fd);
    if (!error)
        return to ? DRAPE_OK : DRAPE_E_MEMORY;
    drape_free(ctx, to);
    *bytes = NULL;
    return drape_file_fail(ctx, "read", path, error);
}

drape_status drape_file_read(drape_context *ctx, const char *path, off_t limit, char **bytes, size_t *size)
{
    const int fd = drape_file_open(ctx, path);
    *bytes = NULL;
    return fd < 0 ? DRAPE_E_FILE : drape_file_take(ctx, fd, path, limit, bytes, size);
}

drape_status drape_file_create(drape_context *ctx, size_t path_length, drape_file *file)
{
    *file = (drape_file){.ctx = ctx, .dir = -1, .path_size = path_length + 1};
    file->path = drape_alloc(ctx, file->path_size + BUFFER_SIZE, 1);
    if (!file->path)
        return DRAPE_E_MEMORY;
    file->buffer = file->path + file->path_size;
    return DRAPE_OK;
}

drape_status drape_file_create_in(drape_context *ctx, drape_folder *folder, drape_file *file)
{
    drape_status status = drape_file_create(ctx, MAX_NAME, file);
    file->folder = folder;
    file->dir = drape_folder_descriptor(folder);
    return status;
}

/* 0 or errno. After EINTR the descriptor is closed, too, and no data were lost. */
static int close_descriptor(drape_file *file)
{
    file->open = false;
    return close(file->fd) && errno != EINTR ? errno : 0;
}

static const char *name_of(const drape_file *file)
{
    const char *slash = strrchr(file->path, '/');
    return slash ? slash + 1 : file->path;
}

/* Removes a file that will not be published. */
static void drop(drape_file *file)
{
    if (*file->part)
        unlinkat(file->dir, file->part, 0);
    *file->part = 0;
}

void drape_file_abandon(drape_file *file)
{
    if (!file->open)
        return;
    close_descriptor(file);
    drop(file);
}

static void leave_folder(drape_file *file)
{
    if (!file->folder && file->path && file->dir >= 0)
        close(file->dir);
    if (!file->folder)
        file->dir = -1;
}

void drape_file_destroy(drape_file *file)
{
    drape_file_abandon(file);
    leave_folder(file);
    if (file->path) {
        drape_free(file->ctx, file->rehearsed);
        drape_free(file->ctx, file->path);
    }
    *file = (drape_file){.dir = -1};
}

void drape_file_name(drape_file *file, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(file->path, file->path_size, format, args);
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

/* A pipe that nobody reads is an error at once. What is then written to it blocks as usual. */
static int open_device(const char *path)
{
    int fd = open(path, O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    if (fd >= 0)
        fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) & ~O_NONBLOCK);
    return fd;
}

static int open_part(drape_file *file)
{
    uint64_t token;
    if (file->folder)
        drape_folder_part(file->folder, file->part);
    else if (getrandom(&token, sizeof token, 0) == (ssize_t)sizeof token)
        snprintf(file->part, sizeof file->part, ".drape-%016" PRIx64 DRAPE_FILE_PART, token);
    else
        return -1;
    int fd = openat(file->dir, file->part, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, (mode_t)0666);
    if (fd < 0)
        *file->part = 0;
    return fd;
}

static int open_named(drape_file *file)
{
    struct stat info;
    *file->part = 0;
    if (stat(file->path, &info) == 0 && !S_ISREG(info.st_mode))
        return open_device(file->path);
    leave_folder(file);
    file->dir = drape_folder_enter(file->path);
    return file->dir < 0 ? -1 : open_part(file);
}

drape_status drape_file_begin(drape_file *file)
{
    if (file->folder && !drape_folder_is_name(file->path))
        return drape_fail(file->ctx, DRAPE_E_FILE,
                          "cannot write \"%.300s\" into the folder \"%.300s\": not the name of a file in it",
                          file->path, drape_folder_path(file->folder));
    file->fd = file->folder ? open_part(file) : open_named(file);
    if (file->fd < 0)
        return fail(file, "write", errno);
    file->open = true;
    file->used = 0;
    file->error = 0;
    file->size = file->kept = 0;
    file->sum = file->kept_sum = (drape_checksum){0};
    return DRAPE_OK;
}

/* ---- Writing ---- */

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
    drape_checksum_add(&file->sum, file->buffer, done);
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

void drape_file_put_written(drape_file *file, uint64_t size, uint64_t sum, int error)
{
    flush(file);
    const off_t end = file->size + (off_t)size;
    if (!file->error)
        file->error = error;
    if (file->error)
        return;
    if (lseek(file->fd, end, SEEK_SET) != end) {
        file->error = errno;
        return;
    }
    file->sum.sum += sum;
    file->sum.size += size;
    file->size = end;
}

bool drape_file_reach(const drape_file *file, char *path, size_t size)
{
    const int length =
        snprintf(path, size, "%s/%s", drape_folder_path(file->folder), *file->part ? file->part : file->path);
    return length > 0 && (size_t)length < size;
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

/* ---- Ending ---- */

/* Records the file in its manifest, then gives it its name. Returns 0, or the status of a failure, with its
 * message. */
static drape_status give_name(drape_file *file, bool growing)
{
    drape_status status = DRAPE_OK;
    if (!*file->part)
        return DRAPE_OK;
    if (!file->folder) {
        if (renameat(file->dir, file->part, file->dir, name_of(file)))
            status = fail(file, "write", errno);
    } else {
        status = growing ? drape_folder_note_growing(file->folder, file->path, file->fd, file->durable)
                         : drape_folder_note(file->folder, file->path, &file->sum, file->durable);
        if (!status)
            status = drape_folder_publish(file->folder, file->part, file->path,
                                          file->last.st_ino ? &file->last : NULL);
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
    file->kept_sum = file->sum;
    return status;
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
    struct stat info = {0};
    flush(file);
    if (file->durable && !file->error)
        file->error = sync_descriptor(file->fd);
    if (fstat(file->fd, &info))
        info = (struct stat){0};
    int closing = close_descriptor(file), error = file->error ? file->error : closing;
    if (error) {
        drop(file);
        return fail(file, "write", error);
    }
    drape_status status = give_name(file, false);
    if (!status)
        file->last = info;
    return status;
}

/* Reads the first bytes of the file for their checksum; 0 or errno. */
static int sum_up(drape_file *file, off_t size)
{
    unsigned char bytes[PATCHED];
    drape_checksum sum = {0};
    while (sum.size < (uint64_t)size) {
        const uint64_t left = (uint64_t)size - sum.size;
        ssize_t n = pread(file->fd, bytes, left < PATCHED ? (size_t)left : PATCHED, (off_t)sum.size);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return n < 0 ? errno : EIO;
        drape_checksum_add(&sum, bytes, (size_t)n);
    }
    file->sum = file->kept_sum = sum;
    return 0;
}

/* A file that cannot be cut, such as a pipe, stays as it is; the failure that led here is the one to
 * report. */
void drape_file_cut(drape_file *file, off_t size)
{
    if (ftruncate(file->fd, size) || lseek(file->fd, size, SEEK_SET) != size)
        return;
    file->size = file->kept = size;
    sum_up(file, size);
}

drape_status drape_file_keep(drape_file *file)
{
    flush(file);
    int error = file->error;
    file->error = 0;
    if (!error) {
        file->kept = file->size;
        file->kept_sum = file->sum;
        return DRAPE_OK;
    }
    drape_file_cut(file, file->kept);
    return fail(file, "write", error);
}

/* Accounts for at most PATCHED bytes that are about to be overwritten; 0 or errno. */
static int patch(drape_file *file, off_t offset, const void *data, size_t size)
{
    unsigned char words[PATCHED + 16] = {0};
    const off_t begin = offset / 8 * 8, end = offset + (off_t)size;
    const off_t last = (end + 7) / 8 * 8, was = file->size < last ? file->size : last;
    for (off_t at = begin; at < was;) {
        ssize_t n = pread(file->fd, words + (at - begin), (size_t)(was - at), at);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return n < 0 ? errno : EIO;
        at += n;
    }
    drape_checksum *sum = &file->sum;
    if (was > begin)
        sum->sum -= drape_checksum_bytes((uint64_t)begin, words, (size_t)(was - begin));
    memcpy(words + (offset - begin), data, size);
    const off_t becomes = was > end ? was : end;
    sum->sum += drape_checksum_bytes((uint64_t)begin, words, (size_t)(becomes - begin));
    if (becomes >= file->size) {
        sum->size = (uint64_t)becomes;
        memcpy(sum->tail, words + (becomes / 8 * 8 - begin), (size_t)(becomes % 8));
    }
    return 0;
}

/* Reads the beginning of the file as far as `size`, and takes it out of the checksum: it is added again
 * when it is known how it would be. */
static drape_status read_beginning(drape_file *file, size_t size)
{
    const size_t had = file->rehearsed_size;
    unsigned char *grown = drape_alloc(file->ctx, size, 1);
    if (!grown)
        return DRAPE_E_MEMORY;
    if (had)
        memcpy(grown, file->rehearsed, had);
    drape_free(file->ctx, file->rehearsed);
    file->rehearsed = grown;
    for (size_t at = had; at < size;) {
        ssize_t n = pread(file->fd, grown + at, size - at, (off_t)at);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return fail(file, "continue", n < 0 ? errno : EIO);
        at += (size_t)n;
    }
    file->sum.sum -= drape_checksum_bytes(had, grown + had, size - had);
    file->rehearsed_size = size;
    return DRAPE_OK;
}

/* Overwrites bytes of the file only in memory. */
static drape_status rehearse(drape_file *file, size_t offset, const void *data, size_t size)
{
    const size_t words = (offset + size + 7) / 8 * 8, all = (size_t)file->size;
    const size_t end = words < all ? words : all;
    drape_status status = DRAPE_OK;
    if (offset + size > all)
        return fail(file, "continue", EINVAL);
    if (end > file->rehearsed_size)
        status = read_beginning(file, end);
    if (!status)
        memcpy(file->rehearsed + offset, data, size);
    return status;
}

/* Before a file is changed that an earlier process completed, the manifest says that it grows again. */
static drape_status announce(drape_file *file)
{
    if (!file->reopened)
        return DRAPE_OK;
    file->reopened = false;
    return drape_folder_note_growing(file->folder, file->path, file->fd, file->durable);
}

static drape_status write_at(drape_file *file, off_t offset, const char *from, size_t size)
{
    while (size > 0) {
        ssize_t n = pwrite(file->fd, from, size, offset);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return fail(file, "write", n < 0 ? errno : ENOSPC);
        from += n;
        offset += n;
        size -= (size_t)n;
    }
    return DRAPE_OK;
}

drape_status drape_file_overwrite(drape_file *file, off_t offset, const void *data, size_t size)
{
    const char *from = data;
    drape_status status = DRAPE_OK;
    for (size_t part; size > 0 && !status; size -= part, from += part, offset += (off_t)part) {
        part = size < PATCHED ? size : PATCHED;
        if (file->folder && drape_folder_rehearses(file->folder)) {
            status = rehearse(file, (size_t)offset, from, part);
            continue;
        }
        const int error = patch(file, offset, from, part);
        if (error)
            return fail(file, "write", error);
        status = announce(file);
        if (!status)
            status = write_at(file, offset, from, part);
        if (status)
            sum_up(file, file->kept);
        if (!status && offset + (off_t)part > file->size)
            file->size = file->kept = offset + (off_t)part;
    }
    if (!status && !file->rehearsed)
        file->kept_sum = file->sum;
    return status;
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
    return error ? fail(file, "write", error) : DRAPE_OK;
}

/* A folder may be writable without being readable. */
drape_status drape_file_sync_names(drape_file *file)
{
    if (file->folder)
        return drape_folder_sync(file->folder);
    int fd = file->dir < 0 ? -1 : openat(file->dir, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0)
        return file->dir < 0 || errno == EACCES ? DRAPE_OK : fail(file, "write the folder of", errno);
    int error = sync_descriptor(fd);
    close(fd);
    return error ? fail(file, "write the folder of", error) : DRAPE_OK;
}

/* ---- Continuing ---- */

drape_status drape_file_reopen(drape_file *file)
{
    struct stat info;
    char path[512];
    snprintf(path, sizeof path, "%.300s/%.200s", drape_folder_path(file->folder), file->path);
    *file->part = 0;
    file->fd = drape_folder_open_file(file->folder, file->path, O_RDWR);
    if (file->fd < 0 && errno == EINVAL)
        return drape_fail(file->ctx, DRAPE_E_FILE, "cannot continue \"%.500s\": it is not a regular file",
                          path);
    if (file->fd < 0 || fstat(file->fd, &info))
        return fail(file, "continue", errno);
    file->open = file->reopened = true;
    file->used = 0;
    file->error = 0;
    file->size = file->kept;
    file->last = info;
    if (info.st_size < file->kept)
        return drape_fail(file->ctx, DRAPE_E_FILE,
                          "cannot continue \"%.500s\": it has %lld bytes, and had %lld at the checkpoint",
                          path, (long long)info.st_size, (long long)file->kept);
    int error = sum_up(file, file->kept);
    if (!error && lseek(file->fd, file->kept, SEEK_SET) != file->kept)
        error = errno;
    return error ? fail(file, "continue", error) : DRAPE_OK;
}

/* The rehearsal ends with the checksum of the bytes that are there. */
static drape_status compare(drape_file *file)
{
    const bool same =
        file->sum.sum + drape_checksum_bytes(0, file->rehearsed, file->rehearsed_size) == file->expected;
    drape_free(file->ctx, file->rehearsed);
    file->rehearsed = NULL;
    file->rehearsed_size = 0;
    int error = sum_up(file, file->kept);
    if (error)
        return fail(file, "continue", error);
    return same ? DRAPE_OK
                : drape_fail(
                      file->ctx, DRAPE_E_PARSE,
                      "cannot continue \"%.300s/%.200s\": it is damaged: its checksum is not that of the "
                      "checkpoint",
                      drape_folder_path(file->folder), file->path);
}

drape_status drape_file_trim(drape_file *file)
{
    if (drape_folder_rehearses(file->folder))
        return compare(file);
    drape_status status = announce(file);
    if (!status && ftruncate(file->fd, file->kept))
        status = fail(file, "cut", errno);
    return status;
}

drape_status drape_file_close(drape_file *file)
{
    if (!file->open)
        return DRAPE_OK;
    const bool published = !*file->part && file->folder;
    int error = close_descriptor(file);
    drop(file);
    if (error)
        return fail(file, "close", error);
    return published ? drape_folder_note(file->folder, file->path, &file->kept_sum, file->durable) : DRAPE_OK;
}

/* ---- Folders ---- */

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
