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

int drape_read_at(int fd, void *to, size_t size, off_t offset)
{
    for (char *at = to; size > 0;) {
        const ssize_t n = pread(fd, at, size, offset);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return n < 0 ? errno : EIO;
        at += n;
        offset += n;
        size -= (size_t)n;
    }
    return 0;
}

drape_status drape_file_take(drape_context *ctx, int fd, const char *path, off_t limit, char **bytes,
                             size_t *size)
{
    struct stat info;
    int error = fstat(fd, &info) ? errno : info.st_size > limit ? EFBIG : 0;
    *size = error ? 0 : (size_t)info.st_size;
    *bytes = error ? NULL : drape_alloc(ctx, *size + 1, 1);
    if (*bytes)
        error = drape_read_at(fd, *bytes, *size, 0);
    close(fd);
    if (!error)
        return *bytes ? DRAPE_OK : DRAPE_E_MEMORY;
    drape_free(ctx, *bytes);
    *bytes = NULL;
    return drape_file_fail(ctx, "read", path, error);
}

drape_status drape_file_read(drape_context *ctx, const char *path, off_t limit, char **bytes, size_t *size)
{
    const int fd = drape_file_open(ctx, path);
    *bytes = NULL;
    return fd < 0 ? DRAPE_E_FILE : drape_file_take(ctx, fd, path, limit, bytes, size);
}

/* Bytes of a file that is resumed which will be overwritten. */
struct drape_patch {
    drape_patch *next;
    off_t offset;
    size_t size;
    unsigned char bytes[];
};

static void free_patches(drape_file *file)
{
    for (drape_patch *p; (p = file->patches);) {
        file->patches = p->next;
        drape_free(file->ctx, p);
    }
}

drape_status drape_file_create(drape_context *ctx, size_t path_length, drape_file *file)
{
    *file = (drape_file){.ctx = ctx, .room = path_length + DRAPE_PART_SIZE};
    file->path = drape_alloc(ctx, 2 * file->room + BUFFER_SIZE, 1);
    if (!file->path)
        return DRAPE_E_MEMORY;
    file->part = file->path + file->room;
    file->buffer = file->part + file->room;
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
    free_patches(file);
    *file = (drape_file){.fd = -1};
}

void drape_file_name(drape_file *file, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(file->path, file->room, format, args);
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
            snprintf(file->part, file->room, "%.*s.drape-%016" PRIx64 DRAPE_FILE_PART,
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
    struct stat info;
    flush(file);
    if (file->durable && !file->error)
        file->error = sync_descriptor(file->fd);
    const bool known = fstat(file->fd, &info) == 0;
    const int closing = close_descriptor(file), error = file->error ? file->error : closing;
    if (error)
        drop(file);
    const drape_status status = error ? fail(file, "write", error) : give_name(file, false);
    if (!status && known)
        file->last = info;
    return status;
}

int drape_file_sum(int fd, off_t size, const drape_patch *patches, drape_checksum *sum)
{
    unsigned char bytes[16384];
    int error = 0;
    *sum = (drape_checksum){0};
    while (!error && sum->size < (uint64_t)size) {
        const uint64_t left = (uint64_t)size - sum->size;
        const size_t n = left < sizeof bytes ? (size_t)left : sizeof bytes;
        const off_t offset = (off_t)sum->size;
        error = drape_read_at(fd, bytes, n, offset);
        for (const drape_patch *p = patches; p; p = p->next) {
            const off_t last = p->offset + (off_t)p->size, read = offset + (off_t)n;
            const off_t begin = p->offset > offset ? p->offset : offset, end = last < read ? last : read;
            if (begin < end)
                memcpy(bytes + (begin - offset), p->bytes + (begin - p->offset), (size_t)(end - begin));
        }
        if (!error)
            drape_checksum_add(sum, bytes, n);
    }
    return error;
}

/* The checksum of the first bytes of the file, as they are; 0 or errno. */
static int sum_up(drape_file *file, off_t size)
{
    const int error = drape_file_sum(file->fd, size, NULL, &file->sum);
    file->kept_sum = file->sum;
    return error;
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
static int account(drape_file *file, off_t offset, const void *data, size_t size)
{
    unsigned char words[PATCHED + 16] = {0};
    const off_t begin = offset / 8 * 8, end = offset + (off_t)size;
    const off_t last = (end + 7) / 8 * 8, was = file->size < last ? file->size : last;
    const int error = was > begin ? drape_read_at(file->fd, words, (size_t)(was - begin), begin) : 0;
    drape_checksum *sum = &file->sum;
    if (error)
        return error;
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

static int write_at(int fd, off_t offset, const void *data, size_t size)
{
    for (const char *from = data; size > 0;) {
        const ssize_t n = pwrite(fd, from, size, offset);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return n < 0 ? errno : ENOSPC;
        from += n;
        offset += n;
        size -= (size_t)n;
    }
    return 0;
}

drape_status drape_file_overwrite(drape_file *file, off_t offset, const void *data, size_t size)
{
    int error = 0;
    if (file->resumed) {
        drape_patch **last = &file->patches;
        if (offset + (off_t)size > file->size)
            return fail(file, "continue", EINVAL);
        while (*last)
            last = &(*last)->next;
        *last = drape_alloc(file->ctx, 1, sizeof **last + size);
        if (!*last)
            return DRAPE_E_MEMORY;
        **last = (drape_patch){.offset = offset, .size = size};
        memcpy((*last)->bytes, data, size);
        return DRAPE_OK;
    }
    for (const char *from = data; size > 0 && !error;) {
        const size_t part = size < PATCHED ? size : PATCHED;
        error = account(file, offset, from, part);
        if (error)
            break;
        error = write_at(file->fd, offset, from, part);
        from += part;
        offset += (off_t)part;
        size -= part;
        if (error)
            sum_up(file, file->kept);
        else if (offset > file->size)
            file->size = file->kept = offset;
    }
    file->kept_sum = file->sum;
    return error ? fail(file, "write", error) : DRAPE_OK;
}

drape_status drape_file_sync(drape_file *file)
{
    int error = file->open ? sync_descriptor(file->fd) : 0;
    return error ? fail(file, "write", error) : DRAPE_OK;
}

/* Opens the folder that a path leads into. Returns -1 with errno. */
static int open_parent(const char *path)
{
    char parent[4096];
    const char *slash = strrchr(path, '/');
    const int length = slash ? (int)(slash - path) : 0;
    snprintf(parent, sizeof parent, "%.*s%s", length, path, slash ? "/" : ".");
    return open(parent, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
}

/* A folder may be writable without being readable. */
drape_status drape_file_sync_names(drape_file *file)
{
    if (file->folder)
        return drape_folder_sync(file->folder);
    const int fd = open_parent(file->path);
    int error = fd < 0 ? errno : sync_descriptor(fd);
    if (fd >= 0)
        close(fd);
    return error && error != EACCES ? fail(file, "write the folder of", error) : DRAPE_OK;
}

bool drape_folder_has(const char *folder, const char *path)
{
    struct stat a, b;
    const int fd = open_parent(path);
    const bool known = fd >= 0 && stat(folder, &a) == 0 && fstat(fd, &b) == 0;
    if (fd >= 0)
        close(fd);
    return known && a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

/* ---- Continuing ---- */

drape_status drape_file_reopen(drape_file *file)
{
    *file->part = 0;
    file->fd = drape_open_regular(base_of(file), file->path, O_RDWR | O_NOFOLLOW);
    if (file->fd < 0)
        return fail(file, "continue", errno);
    file->open = file->resumed = true;
    file->used = 0;
    file->error = 0;
    file->size = file->kept;
    if (fstat(file->fd, &file->last))
        return fail(file, "continue", errno);
    if (file->last.st_size < file->kept)
        return drape_fail(
            file->ctx, DRAPE_E_FILE,
            "cannot continue \"%.300s/%.200s\": it has %lld bytes, and had %lld at the checkpoint",
            drape_folder_path(file->folder), file->path, (long long)file->last.st_size,
            (long long)file->kept);
    return lseek(file->fd, file->kept, SEEK_SET) < 0 ? fail(file, "continue", errno) : DRAPE_OK;
}

drape_status drape_file_compare(drape_file *file)
{
    const int error = drape_file_sum(file->fd, file->kept, file->patches, &file->sum);
    file->kept_sum = file->sum;
    if (error)
        return fail(file, "continue", error);
    return file->sum.sum == file->expected
               ? DRAPE_OK
               : drape_fail(
                     file->ctx, DRAPE_E_PARSE,
                     "cannot continue \"%.300s/%.200s\": it is damaged: its checksum is not that of the "
                     "checkpoint",
                     drape_folder_path(file->folder), file->path);
}

drape_status drape_file_trim(drape_file *file)
{
    int error = 0;
    drape_status status = drape_folder_note(file->folder, file->path, NULL, file->fd, file->durable);
    for (const drape_patch *p = file->patches; p && !status && !error; p = p->next)
        error = write_at(file->fd, p->offset, p->bytes, p->size);
    if (!status && !error && ftruncate(file->fd, file->kept))
        error = errno;
    free_patches(file);
    file->resumed = false;
    return error ? fail(file, "continue", error) : status;
}

drape_status drape_file_close(drape_file *file)
{
    if (!file->open)
        return DRAPE_OK;
    const bool published = !*file->part && file->folder && !file->resumed;
    int error = close_descriptor(file);
    drop(file);
    if (error)
        return fail(file, "close", error);
    return published ? drape_folder_note(file->folder, file->path, &file->kept_sum, -1, file->durable)
                     : DRAPE_OK;
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
