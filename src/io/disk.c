/* disk.c: see disk.h. */
#include "io/disk.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define READ_SIZE 16384 /* bytes that are read at once for a checksum */

drape_status drape_file_fail(drape_context *ctx, const char *deed, const char *path, int error)
{
    char text[128];
    if (strerror_r(error, text, sizeof text))
        snprintf(text, sizeof text, "error %d", error);
    return drape_fail(ctx, error == ENOMEM ? DRAPE_E_MEMORY : DRAPE_E_FILE, "cannot %s \"%.500s\": %s", deed,
                      path, text);
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

int drape_write_at(int fd, off_t offset, const void *data, size_t size)
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

off_t drape_disk_place(const drape_disk_bytes *c, off_t size)
{
    return (off_t)c->offset + (c->offset < 0 ? size : 0);
}

int drape_disk_sum(int fd, off_t begin, off_t end, const drape_disk_bytes *change, drape_checksum *sum)
{
    unsigned char bytes[READ_SIZE];
    *sum = (drape_checksum){.size = (uint64_t)begin};
    for (off_t next; begin < end; begin = next) {
        next = end - begin < READ_SIZE ? end : begin + READ_SIZE;
        const int error = drape_read_at(fd, bytes, (size_t)(next - begin), begin);
        if (error)
            return error;
        for (const drape_disk_bytes *c = change; c && c < change + DRAPE_DISK_BYTES; c++) {
            const off_t at = drape_disk_place(c, end), first = at > begin ? at : begin,
                        last = at + c->size < next ? at + (off_t)c->size : next;
            if (first < last)
                memcpy(bytes + (first - begin), c->bytes + (first - at), (size_t)(last - first));
        }
        drape_checksum_add(sum, bytes, (size_t)(next - begin));
    }
    return 0;
}

int drape_disk_sync(int fd)
{
    int code;
    do
        code = fsync(fd);
    while (code && errno == EINTR);
    return code && errno != EINVAL && errno != ENOTSUP ? errno : 0;
}

/* ---- Folders ---- */

char *drape_disk_path(drape_context *ctx, const char *folder, const char *name)
{
    size_t size = strlen(folder) + strlen(name) + 2;
    char *path = drape_alloc(ctx, size, 1);
    if (path)
        snprintf(path, size, "%s/%s", folder, name);
    return path;
}

int drape_disk_open_parent(const char *path)
{
    char parent[4096];
    const char *slash = strrchr(path, '/');
    const int length = slash ? (int)(slash - path) : 0;
    snprintf(parent, sizeof parent, "%.*s%s", length, path, slash ? "/" : ".");
    return open(parent, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
}

bool drape_folder_has(const char *folder, const char *path)
{
    struct stat a, b;
    const int fd = drape_disk_open_parent(path);
    const bool known = fd >= 0 && stat(folder, &a) == 0 && fstat(fd, &b) == 0;
    if (fd >= 0)
        close(fd);
    return known && a.st_dev == b.st_dev && a.st_ino == b.st_ino;
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
