/* checkpoint.c: see checkpoint.h. */
#include "io/checkpoint.h"

#include "sim/sim.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* ---- Reading ---- */

static drape_status read_all(drape_context *ctx, int fd, const char *path, char *to, size_t size)
{
    size_t done = 0;
    while (done < size) {
        ssize_t n = read(fd, to + done, size - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0) /* the file was shortened meanwhile */
            return drape_file_fail(ctx, "read", path, n < 0 ? errno : EIO);
        done += (size_t)n;
    }
    return DRAPE_OK;
}

static drape_status take_file(drape_context *ctx, int fd, const char *path, void **bytes, size_t *size)
{
    struct stat info;
    if (fstat(fd, &info))
        return drape_file_fail(ctx, "read", path, errno);
    if (!S_ISREG(info.st_mode))
        return drape_fail(ctx, DRAPE_E_FILE, "cannot read \"%.500s\": it is not a regular file", path);
    *size = (size_t)info.st_size;
    *bytes = drape_alloc(ctx, *size, 1);
    if (!*bytes)
        return DRAPE_E_MEMORY;
    drape_status status = read_all(ctx, fd, path, *bytes, *size);
    if (status) {
        drape_free(ctx, *bytes);
        *bytes = NULL;
    }
    return status;
}

drape_status drape_checkpoint_read(drape_context *ctx, const char *path, bool *there, void **bytes,
                                   size_t *size)
{
    *bytes = NULL;
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (there)
        *there = fd >= 0;
    if (fd < 0 && there && (errno == ENOENT || errno == ENOTDIR))
        return DRAPE_OK;
    if (fd < 0)
        return drape_file_fail(ctx, "read", path, errno);
    drape_status status = take_file(ctx, fd, path, bytes, size);
    close(fd);
    return status;
}

/* ---- Writing ---- */

/* A failure of the file is reported when the file is finished. */
static drape_status put(void *user, const void *bytes, size_t size)
{
    drape_file_put(user, bytes, size);
    return DRAPE_OK;
}

void drape_checkpoint_begin(drape_archive *a, drape_context *ctx, drape_file *file)
{
    file->durable = true;
    drape_archive_write_to(a, ctx, file->path, put, file);
    drape_archive_note(a, drape_file_begin(file));
}

drape_status drape_checkpoint_end(drape_archive *a, drape_file *file)
{
    drape_status status = drape_archive_end(a);
    if (status)
        drape_file_abandon(file);
    else
        status = drape_file_finish(file);
    return status ? status : drape_file_sync_names(file);
}

/* ---- For hosts ---- */

drape_status drape_sim_save(drape_sim *sim, const char *path)
{
    drape_archive a;
    drape_file file = {0};
    if (!sim)
        return DRAPE_E_ARGUMENT;
    if (!path || !*path)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_save: path is NULL");
    drape_status status = drape_file_create(sim->ctx, strlen(path), &file);
    if (status)
        return status;
    drape_file_name(&file, "%s", path);
    drape_checkpoint_begin(&a, sim->ctx, &file);
    drape_sim_archive_identity(sim, &a);
    drape_sim_archive(sim, &a);
    status = drape_checkpoint_end(&a, &file);
    drape_file_destroy(&file);
    return status;
}

drape_status drape_sim_restore(drape_sim *sim, const char *path)
{
    drape_archive a;
    void *bytes;
    size_t size;
    drape_status guarded = drape_sim_guard(sim, "drape_sim_restore");
    if (guarded)
        return guarded;
    if (!path || !*path)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_restore: path is NULL");
    drape_status status = drape_checkpoint_read(sim->ctx, path, NULL, &bytes, &size);
    if (!status)
        status = drape_archive_read_from(&a, sim->ctx, path, bytes, size);
    if (!status)
        status = drape_sim_read(sim, &a);
    drape_free(sim->ctx, bytes);
    return status;
}
