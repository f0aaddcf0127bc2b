/* report.c: see report.h. The page is page.html with its style and scripts, which embed.py puts together when
 * Drape is built; the data of the run go between its two parts. */
#include "report/report.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "base/json_read.h"
#include "io/csv.h"
#include "io/export.h"
#include "io/summary.h"
#include "model/scene.h"
#include "report/data.h"
#include "report/page.h"

#define DEFAULT_NAME "report.html"
#define SCENE_LIMIT  ((off_t)64 << 20)

/* ---- What is read ---- */

static drape_status read_run(drape_context *ctx, const char *folder, drape_report_source *source)
{
    char *scene, *text = NULL;
    size_t size = 0;
    json_error_t error = {0};
    *source = (drape_report_source){.ctx = ctx};
    drape_status status = drape_record_scene(ctx, folder, &scene);
    if (!status)
        status = drape_file_read(ctx, scene, SCENE_LIMIT, &source->scene_text, &size);
    if (!status)
        status = drape_model_load(ctx, scene, &source->model);
    drape_free(ctx, scene);
    if (!status)
        status = drape_record_open(ctx, folder, source->model->node_count, &source->record);
    char *path = status ? NULL : drape_record_path(ctx, folder, "summary.json");
    if (status || !path)
        return status ? status : DRAPE_E_MEMORY;
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

/* ---- The page ---- */

static void begin_block(drape_file *file, const char *id)
{
    drape_file_print(file, "<script type=\"text/plain\" id=\"%s\">", id);
}

static void end_block(drape_file *file)
{
    drape_file_put_text(file, "</script>\n");
}

static drape_status put_page(const drape_report_data *data, drape_file *file)
{
    drape_file_put(file, drape_page_head, drape_page_head_size);
    begin_block(file, "run");
    drape_status status = drape_report_put_json(data, file);
    end_block(file);
    begin_block(file, "triangles");
    drape_report_put_triangles(data, file);
    end_block(file);
    for (int f = 0; !status && f < DRAPE_REPORT_FIELDS; f++) {
        begin_block(file, data->fields[f].name);
        status = drape_report_put_field(data, f, file);
        end_block(file);
    }
    for (int32_t b = 0; !status && b < data->body_count; b++) {
        begin_block(file, data->bodies[b].block);
        status = drape_report_put_body(data, b, file);
        end_block(file);
    }
    drape_file_put(file, drape_page_tail, drape_page_tail_size);
    return status;
}

/* A page that was not named goes into the folder of the run. One that was must not be a file of the run. */
static drape_status create_file(const drape_report_source *run, const drape_report_def *def,
                                drape_folder **folder, drape_file *file)
{
    static const char *const inputs[] = {"scene.json", "positions.npy", DRAPE_ENERGY_NAME, DRAPE_STEPS_NAME,
                                         DRAPE_SUMMARY_NAME};
    drape_status status = DRAPE_OK;
    if (def->out) {
        for (size_t i = 0; i < sizeof inputs / sizeof *inputs && !status; i++) {
            char path[4096];
            snprintf(path, sizeof path, "%s/%s", def->run, inputs[i]);
            status = drape_file_check_named(run->ctx, def->out, path);
        }
        return status ? status : drape_export_begin(run->ctx, NULL, def->out, file);
    }
    status = drape_folder_open(run->ctx, def->run, false, folder);
    if (!status)
        status = drape_folder_check(*folder, drape_folder_is_named, NULL, DEFAULT_NAME);
    if (!status)
        status = drape_folder_begin(*folder, NULL, NULL);
    return status ? status : drape_export_begin(run->ctx, *folder, DEFAULT_NAME, file);
}

/* Reads all of the run before the file is created. */
static drape_status write_page(const drape_report_source *run, const drape_report_def *def,
                               drape_report_result *result, bool *input)
{
    drape_folder *folder = NULL;
    drape_report_data data;
    drape_file file = {0};
    drape_status status = drape_report_data_make(run, def->max_bytes, &data);
    result->frames = run->record.frames;
    result->kept = data.kept;
    if (!status) {
        status = create_file(run, def, &folder, &file);
        *input = status == DRAPE_E_ARGUMENT;
    }
    if (!status) {
        status = put_page(&data, &file);
        *input = status == DRAPE_E_PARSE || status == DRAPE_E_FILE;
    }
    if (!status)
        status = drape_file_finish(&file);
    result->bytes = (int64_t)file.size;
    drape_file_destroy(&file);
    drape_folder_close(&folder);
    drape_arena_free(&data.arena);
    return status;
}

drape_status drape_report_write(drape_context *ctx, const drape_report_def *def, drape_report_result *result,
                                bool *input)
{
    drape_report_source run;
    *input = true;
    *result = (drape_report_result){.frames = 0};
    int length = def->out ? snprintf(result->path, sizeof result->path, "%s", def->out)
                          : snprintf(result->path, sizeof result->path, "%s/" DEFAULT_NAME, def->run);
    if (length >= (int)sizeof result->path)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "the name of the page is longer than %zu bytes",
                          sizeof result->path - 1);
    locale_t old = drape_locale_enter();
    drape_status status = read_run(ctx, def->run, &run);
    if (!status)
        status = write_page(&run, def, result, input);
    drape_record_close(&run.record);
    json_decref(run.summary);
    drape_model_destroy(&run.model);
    drape_free(ctx, run.scene_text);
    drape_locale_leave(old);
    return status;
}
