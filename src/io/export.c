/* export.c: see export.h. */
#include "io/export.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define NAME_ROOM  64 /* longest name of a frame file */
#define FRAME_WORD "frame_"

/* ---- One file ---- */

drape_status drape_export_clean(drape_context *ctx, const char *folder, const char *name)
{
    struct stat info;
    size_t size = strlen(folder) + strlen(name) + 2;
    char *path = drape_alloc(ctx, size, 1);
    drape_status status = DRAPE_OK;
    if (!path)
        return DRAPE_E_MEMORY;
    snprintf(path, size, "%s/%s", folder, name);
    if (lstat(path, &info) == 0 && S_ISREG(info.st_mode) && remove(path) != 0)
        status = drape_file_fail(ctx, "remove the old frames", path, errno);
    drape_free(ctx, path);
    return status;
}

drape_status drape_export_begin(drape_context *ctx, const char *folder, const char *name, drape_file *file)
{
    drape_status status = drape_file_create(ctx, strlen(folder) + strlen(name) + 2, file);
    if (status)
        return status;
    drape_file_name(file, "%s/%s", folder, name);
    return drape_file_begin(file);
}

drape_status drape_export_reopen(drape_context *ctx, const char *folder, const char *name, off_t size,
                                 drape_file *file)
{
    drape_status status = drape_file_create(ctx, strlen(folder) + strlen(name) + 2, file);
    if (status)
        return status;
    drape_file_name(file, "%s/%s", folder, name);
    return drape_file_reopen(file, size);
}

void drape_export_archive_size(drape_archive *a, off_t *size)
{
    int64_t bytes = *size;
    drape_archive_int64(a, &bytes);
    *size = (off_t)bytes;
}

/* ---- One file for each frame ---- */

/* Whether the name is frame_, at least so many digits, a dot and the ending, or that with ".part", as a
 * killed run leaves it. *frame: its number; INT64_MAX with ".part", so that it counts as a late frame. */
static bool is_frame_file(const char *name, size_t least, const char *ending, int64_t *frame)
{
    size_t word = strlen(FRAME_WORD);
    if (strncmp(name, FRAME_WORD, word) != 0)
        return false;
    size_t digits = strspn(name + word, "0123456789");
    const char *rest = name + word + digits;
    size_t length = strlen(ending);
    if (digits < least || *rest != '.' || strncmp(rest + 1, ending, length) != 0)
        return false;
    rest += 1 + length;
    *frame = *rest ? INT64_MAX : (int64_t)strtoll(name + word, NULL, 10);
    return !*rest || strcmp(rest, DRAPE_FILE_PART) == 0;
}

/* Removes the frames from number `from` on. */
static drape_status remove_frames(drape_context *ctx, const char *folder, size_t digits, const char *ending,
                                  int64_t from)
{
    DIR *dir = opendir(folder);
    if (!dir)
        return drape_file_fail(ctx, "read the folder", folder, errno);
    drape_status status = DRAPE_OK;
    struct dirent *entry;
    int64_t frame;
    while (errno = 0, !status && (entry = readdir(dir))) {
        if (is_frame_file(entry->d_name, digits, ending, &frame) && frame >= from &&
            unlinkat(dirfd(dir), entry->d_name, 0) && errno != ENOENT)
            status = drape_file_fail(ctx, "remove the old frame", entry->d_name, errno);
    }
    if (!status && errno)
        status = drape_file_fail(ctx, "read the folder", folder, errno);
    closedir(dir);
    return status;
}

drape_status drape_frame_files_clean(drape_context *ctx, const char *folder, size_t digits,
                                     const char *ending)
{
    return remove_frames(ctx, folder, digits, ending, 0);
}

drape_status drape_frame_files_open(drape_context *ctx, const drape_export_def *def, const char *ending,
                                    drape_frame_files *frames)
{
    frames->model = def->model;
    frames->folder = def->folder;
    frames->ending = ending;
    drape_status status = drape_file_create(ctx, strlen(def->folder) + NAME_ROOM, &frames->file);
    frames->file.durable = def->durable;
    return status;
}

drape_status drape_frame_files_resume(drape_context *ctx, const drape_export_def *def, const char *ending,
                                      int64_t count, drape_frame_files *frames)
{
    struct stat info;
    drape_status status = drape_frame_files_open(ctx, def, ending, frames);
    for (int64_t k = 0; !status && k < count; k++) {
        drape_file_name(&frames->file, "%s/" DRAPE_FRAME_NAME, frames->folder, k, ending);
        if (stat(frames->file.path, &info))
            status = drape_file_fail(ctx, "continue", frames->file.path, errno);
    }
    return status;
}

drape_status drape_frame_files_cut(drape_context *ctx, void *state, int64_t frames)
{
    const drape_frame_files *files = state;
    return remove_frames(ctx, files->folder, DRAPE_FRAME_DIGITS, files->ending, frames);
}

void drape_frame_files_archive(void *state, drape_archive *a)
{
    (void)state, (void)a;
}

drape_status drape_frame_files_begin(drape_frame_files *frames, int64_t frame)
{
    drape_file_name(&frames->file, "%s/" DRAPE_FRAME_NAME, frames->folder, frame, frames->ending);
    return drape_file_begin(&frames->file);
}

drape_status drape_frame_files_end(drape_frame_files *frames)
{
    return drape_file_finish(&frames->file);
}

void drape_frame_files_close(drape_frame_files *frames)
{
    drape_file_destroy(&frames->file);
}

/* ---- OBJ ---- */

void drape_obj_put_nodes(drape_file *file, const double *x, int32_t count)
{
    for (int32_t i = 0; i < count; i++, x += 3)
        drape_file_print(file, "v %.17g %.17g %.17g\n", x[0], x[1], x[2]);
}

void drape_obj_put_triangles(drape_file *file, const int32_t *triangle, int32_t count)
{
    for (int32_t i = 0; i < count; i++, triangle += 3)
        drape_file_print(file, "f %" PRId32 " %" PRId32 " %" PRId32 "\n", triangle[0] + 1, triangle[1] + 1,
                         triangle[2] + 1);
}
