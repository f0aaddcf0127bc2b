/* import.c: reads a whole mesh file into memory and passes it to the format that its extension names. */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "mesh/mesh.h"

#define MAX_FILE_SIZE INT32_MAX /* [bytes] */

typedef struct contents {
    char *data; /* size bytes, then a 0 byte */
    size_t size;
} contents;

static drape_status unknown_ending(drape_context *ctx, const char *pointer, const char *file)
{
    char known[256] = "";
    size_t used = 0;
    for (int i = 0; drape_imports[i] && used < sizeof known; i++)
        used += (size_t)snprintf(known + used, sizeof known - used, "%s%s", i ? ", " : "",
                                 drape_imports[i]->ending);
    return drape_fail_at(ctx, DRAPE_E_ARGUMENT, pointer, "%s: unknown ending; known are %s", file, known);
}

static const drape_import_ops *find_import(const char *file)
{
    const size_t length = strlen(file);
    for (int i = 0; drape_imports[i]; i++) {
        const size_t ending = strlen(drape_imports[i]->ending);
        if (length > ending && strcasecmp(file + length - ending, drape_imports[i]->ending) == 0)
            return drape_imports[i];
    }
    return NULL;
}

/* Returns folder/file, or file alone if it is absolute or there is no folder; NULL with a message if memory
 * is out. */
static char *join(drape_arena *arena, const char *folder, const char *file)
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

/* Reads up to the announced size, or to the end of the file if it has shrunk since. */
static drape_status read_descriptor(drape_context *ctx, const char *pointer, const char *path, int descriptor,
                                    contents *file)
{
    const size_t announced = file->size;
    file->size = 0;
    while (file->size < announced) {
        const ssize_t got = read(descriptor, file->data + file->size, announced - file->size);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            return fail_file(ctx, pointer, path, strerror(errno));
        if (got == 0)
            break;
        file->size += (size_t)got;
    }
    file->data[file->size] = 0;
    return DRAPE_OK;
}

static drape_status read_open_file(drape_arena *arena, const char *pointer, const char *path, int descriptor,
                                   contents *file)
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
    file->size = (size_t)about.st_size;
    file->data = drape_arena_take(arena, file->size + 1, 1);
    return file->data ? read_descriptor(ctx, pointer, path, descriptor, file) : DRAPE_E_MEMORY;
}

/* O_NONBLOCK: opening a pipe without a writer would otherwise block for ever. */
static drape_status read_whole_file(drape_arena *arena, const char *pointer, const char *path, contents *file)
{
    const int descriptor = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (descriptor < 0)
        return fail_file(arena->ctx, pointer, path, strerror(errno));
    const drape_status status = read_open_file(arena, pointer, path, descriptor, file);
    close(descriptor);
    return status;
}

drape_status drape_mesh_from_file(drape_context *ctx, const char *pointer, const char *folder,
                                  const char *file, drape_mesh *mesh)
{
    char place[sizeof ctx->pointer];
    snprintf(place, sizeof place, "%s/file", pointer);
    const drape_import_ops *import = find_import(file);
    if (!import)
        return unknown_ending(ctx, place, file);

    const locale_t old = drape_locale_enter();
    const drape_mesh_source source = {.pointer = place, .file = file};
    drape_arena arena = drape_arena_of(ctx);
    contents whole = {0};
    char *path = join(&arena, folder, file);
    drape_status status = path ? read_whole_file(&arena, place, path, &whole) : DRAPE_E_MEMORY;
    if (!status)
        status = import->read(ctx, &source, whole.data, whole.size, mesh);
    drape_arena_free(&arena);
    drape_locale_leave(old);
    return status;
}
