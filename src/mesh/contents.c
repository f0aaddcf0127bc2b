/* contents.c: see contents.h. */
#include "mesh/contents.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define MAX_FILE_SIZE INT32_MAX /* [bytes] */

char *drape_contents_path(drape_arena *arena, const char *folder, const char *file)
{
    if (!folder || !*folder || *file == '/')
        return drape_arena_text(arena, file);
    const size_t size = strlen(folder) + strlen(file) + 2;
    char *path = drape_arena_take(arena, size, 1);
    if (path)
        snprintf(path, size, "%s/%s", folder, file);
    return path;
}

static drape_status fail_file(drape_context *ctx, const char *pointer, const char *path, const char *reason)
{
    return drape_fail_at(ctx, DRAPE_E_FILE, pointer, "%s: cannot be read: %s", path, reason);
}

static drape_status read_open_file(drape_arena *arena, const char *pointer, const char *path, int descriptor,
                                   drape_contents *file)
{
    drape_context *ctx = arena->ctx;
    struct stat about;
    if (fstat(descriptor, &about) != 0)
        return fail_file(ctx, pointer, path, strerror(errno));
    if (S_ISDIR(about.st_mode))
        return fail_file(ctx, pointer, path, strerror(EISDIR));
    if (!S_ISREG(about.st_mode))
        return fail_file(ctx, pointer, path, "Not a regular file");
    if (about.st_size > MAX_FILE_SIZE)
        return drape_fail_at(ctx, DRAPE_E_FILE, pointer, "%s: has %lld bytes; at most %lld can be read", path,
                             (long long)about.st_size, (long long)MAX_FILE_SIZE);
    const size_t announced = (size_t)about.st_size;
    file->data = drape_arena_take(arena, announced + 1, 1);
    if (!file->data)
        return DRAPE_E_MEMORY;
    for (file->size = 0; file->size < announced;) {
        const ssize_t got = read(descriptor, file->data + file->size, announced - file->size);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            return fail_file(ctx, pointer, path, strerror(errno));
        if (got == 0) /* the file has shrunk since */
            break;
        file->size += (size_t)got;
    }
    file->data[file->size] = 0;
    return DRAPE_OK;
}

/* O_NONBLOCK: opening a pipe without a writer would otherwise block for ever. */
drape_status drape_contents_read(drape_arena *arena, const char *pointer, const char *folder,
                                 const char *file, drape_contents *contents)
{
    const char *path = drape_contents_path(arena, folder, file);
    if (!path)
        return DRAPE_E_MEMORY;
    const int descriptor = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (descriptor < 0)
        return fail_file(arena->ctx, pointer, path, strerror(errno));
    const drape_status status = read_open_file(arena, pointer, path, descriptor, contents);
    close(descriptor);
    return status;
}
