/* source.c: see source.h. */
#include "report/source.h"

#include <errno.h>

#include "base/json_read.h"
#include "model/scene.h"

#define SCENE_LIMIT ((off_t)64 << 20)

static drape_status read_scene(drape_report_source *source, const char *folder)
{
    char *path;
    size_t size;
    drape_status status = drape_record_scene(source->ctx, folder, &path);
    if (!status)
        status = drape_file_read(source->ctx, path, SCENE_LIMIT, &source->scene_text, &size);
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
    size_t size = 0;
    json_error_t error = {0};
    const int fd = drape_file_open(ctx, path);
    if (fd >= 0)
        status = drape_file_take(ctx, fd, path, SCENE_LIMIT, &text, &size);
    else if (errno != ENOENT) /* a run that was killed has none */
        status = DRAPE_E_FILE;
    if (text)
        source->summary = drape_json_read(text, size, 0, &error);
    if (text && !source->summary && json_error_code(&error) == json_error_out_of_memory)
        status = drape_fail_memory(ctx, size);
    drape_free(ctx, text);
    drape_free(ctx, path);
    return status;
}

void drape_report_source_close(drape_report_source *source)
{
    drape_record_close(&source->record);
    json_decref(source->summary);
    drape_model_destroy(&source->model);
    drape_free(source->ctx, source->scene_text);
    *source = (drape_report_source){.ctx = NULL};
}
