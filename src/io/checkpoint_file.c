/* checkpoint_file.c: checkpoints as files: see recorder.h. */
#include "io/recorder.h"

#include "sim/sim.h"

#include <errno.h>
#include <stdint.h>
#include <string.h>

/* ---- Writing ---- */

/* A failure of the file is reported when the file is finished. */
static drape_status put(void *user, const void *bytes, size_t size)
{
    drape_file *file = ((drape_checkpoint *)user)->file;
    if (file)
        drape_file_put(file, bytes, size);
    return DRAPE_OK;
}

static void put_rows(void *user, uint64_t offset, uint64_t size, const drape_rows *rows, uint64_t *sum)
{
    const drape_checkpoint *c = user;
    if (!c->together)
        return;
    const int error = c->ranks->write(c->ranks, (int64_t)offset, false, rows, sum);
    if (c->file)
        drape_file_put_written(c->file, size, *sum, error);
}

void drape_checkpoint_begin(drape_checkpoint *c, drape_context *ctx, const drape_ranks *ranks,
                            drape_file *file)
{
    drape_archive *a = &c->archive;
    char path[DRAPE_RANKS_PATH];
    c->file = file;
    c->ranks = ranks;
    c->together = false;
    drape_archive_write_to(a, ctx, file ? file->path : DRAPE_CHECKPOINT_NAME, put, ranks ? put_rows : NULL,
                           c);
    if (file) {
        file->durable = true;
        drape_archive_note(a, drape_file_begin(file));
    }
    if (!ranks)
        return;
    const bool begun = file && file->open, reached = begun && drape_file_reach(file, path, sizeof path);
    const int error =
        ranks->open(ranks, reached ? path : NULL); /* where rank 0 could not begin, none opens */
    c->together = error == 0;
    if (begun)
        drape_file_put_written(file, 0, 0, reached ? error : ENAMETOOLONG);
}

drape_status drape_checkpoint_end(drape_checkpoint *c)
{
    drape_status status = drape_archive_end(&c->archive);
    /* What the ranks wrote is on the disk before rank 0 gives the file its name. */
    const int error = c->together ? c->ranks->close(c->ranks, true) : 0;
    if (c->ranks && c->file && c->file->open)
        drape_file_put_written(c->file, 0, 0, error);
    status = drape_ranks_agree(c->ranks, c->archive.ctx, status);
    if (!c->file)
        return status;
    if (status)
        drape_file_abandon(c->file);
    else
        status = drape_file_finish(c->file);
    return status ? status : drape_file_sync_names(c->file);
}

/* ---- For hosts ---- */

drape_status drape_sim_save(drape_sim *sim, const char *path)
{
    drape_checkpoint c;
    drape_file file = {0};
    if (!sim)
        return DRAPE_E_ARGUMENT;
    if (!path || !*path)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_save: path is NULL");
    drape_status status = drape_file_create(sim->ctx, strlen(path), &file);
    if (status)
        return status;
    drape_file_name(&file, "%s", path);
    drape_checkpoint_begin(&c, sim->ctx, NULL, &file);
    drape_sim_archive_identity(sim, &c.archive);
    drape_sim_archive(sim, &c.archive);
    status = drape_checkpoint_end(&c);
    drape_file_destroy(&file);
    return status;
}

drape_status drape_sim_restore(drape_sim *sim, const char *path)
{
    drape_archive a;
    char *bytes;
    size_t size;
    drape_status guarded = drape_sim_guard(sim, "drape_sim_restore");
    if (guarded)
        return guarded;
    if (!path || !*path)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_restore: path is NULL");
    drape_status status = drape_file_read(sim->ctx, path, INT64_MAX, &bytes, &size);
    if (!status)
        status = drape_archive_read_from(&a, sim->ctx, path, bytes, size);
    if (!status)
        status = drape_sim_read(sim, &a);
    drape_free(sim->ctx, bytes);
    return status;
}
