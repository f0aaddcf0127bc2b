/* source.c: see source.h. */
#include "report/source.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/json_read.h"
#include "model/scene.h"

#define SCENE_LIMIT ((off_t)64 << 20)

/* Reads a whole file as a 0-terminated text. */
static drape_status read_text(drape_context *ctx, const char *path, char **out)
{
    struct stat info;
    int fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0 || fstat(fd, &info) || !S_ISREG(info.st_mode) || info.st_size > SCENE_LIMIT) {
        int error = fd < 0 ? errno : EFBIG;
        if (fd >= 0)
            close(fd);
        return drape_file_fail(ctx, "read", path, error);
    }
    size_t size = (size_t)info.st_size, used = 0;
    ssize_t count = 1;
    *out = drape_alloc(ctx, size + 1, 1);
    while (*out && used < size && (count = read(fd, *out + used, size - used)) > 0)
        used += (size_t)count;
    drape_status status = !*out ? DRAPE_E_MEMORY : count < 0 ? drape_file_fail(ctx, "read", path, errno) : 0;
    close(fd);
    return status;
}

static drape_status read_scene(drape_report_source *source, const char *folder)
{
    char *path;
    drape_status status = drape_record_scene(source->ctx, folder, &path);
    if (!status)
        status = read_text(source->ctx, path, &source->scene_text);
    if (!status)
        status = drape_model_load(source->ctx, path, &source->model);
    drape_free(source->ctx, path);
    return status;
}

drape_status drape_report_source_open(drape_context *ctx, const char *folder, drape_report_source *source)
{
    *source = (drape_report_source){.ctx = ctx};
    drape_status status = read_scene(source, folder);
    if (!status)
        status = drape_record_open(ctx, folder, source->model->node_count, &source->record);
    char *path = status ? NULL : drape_record_path(ctx, folder, "summary.json");
    if (status || !path)
        return status ? status : DRAPE_E_MEMORY;
    char *text = NULL;
    json_error_t error = {0};
    status = read_text(ctx, path, &text);
    if (!status)
        source->summary = drape_json_read(text, strlen(text), 0, &error);
    if (!status && !source->summary && json_error_code(&error) == json_error_out_of_memory)
        status = drape_fail_memory(ctx, strlen(text));
    drape_free(ctx, text);
    drape_free(ctx, path);
    return status == DRAPE_E_MEMORY ? status : DRAPE_OK; /* a run that was killed has none */
}

void drape_report_source_close(drape_report_source *source)
{
    drape_record_close(&source->record);
    json_decref(source->summary);
    drape_model_destroy(&source->model);
    drape_free(source->ctx, source->scene_text);
    *source = (drape_report_source){.ctx = NULL};
}
