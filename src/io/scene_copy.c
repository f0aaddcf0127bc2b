/* scene_copy.c: see scene_copy.h. A scene names files as sources of the meshes of cloths and of their
 * starts, and in the text parameters of colliders. */
#include "io/scene_copy.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/param.h"
#include "io/file.h"
#include "model/scene_text.h"

#define MESH_NAME    "scene_mesh_%d%s"
#define MAX_ENDING   14
#define ALPHANUMERIC "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
#define COPIED_ONCE  16384

typedef struct copier {
    drape_context *ctx;
    drape_scene *scene;
    int files; /* number of files copied so far */
    drape_file out;
} copier;

bool drape_scene_copy_is(const char *path, const char *folder)
{
    struct stat scene, there;
    char name[4096];
    int length = snprintf(name, sizeof name, "%s/" DRAPE_SCENE_COPY, folder);
    return length < (int)sizeof name && stat(path, &scene) == 0 && stat(name, &there) == 0 &&
           scene.st_dev == there.st_dev && scene.st_ino == there.st_ino;
}

/* ---- The files that a scene names ---- */

typedef struct visitor {
    drape_context *ctx;
    const char *scene;
    drape_file_visit *visit;
    void *user;
} visitor;

/* Files are relative to the folder of the scene. */
static drape_status visit_file(const visitor *v, const char *file, const char *pointer)
{
    const char *slash = strrchr(v->scene, '/');
    size_t size = strlen(v->scene) + strlen(file) + 2;
    char *whole = drape_alloc(v->ctx, size, 1);
    if (!whole)
        return DRAPE_E_MEMORY;
    if (slash && *file != '/')
        snprintf(whole, size, "%.*s/%s", (int)(slash - v->scene), v->scene, file);
    else
        snprintf(whole, size, "%s", file);
    drape_status status = v->visit(v->user, whole, pointer);
    drape_free(v->ctx, whole);
    return status;
}

drape_status drape_scene_files(drape_context *ctx, const drape_model *model, const char *scene,
                               drape_file_visit *visit, void *user)
{
    const visitor v = {ctx, scene, visit, user};
    char pointer[DRAPE_POINTER_SIZE];
    drape_status status = DRAPE_OK;
    for (int c = 0; c < model->cloth_count; c++) {
        const drape_cloth *cloth = &model->cloths[c];
        const struct {
            const char *file, *key;
        } named[] = {{cloth->file, "mesh/file"},
                     {cloth->start_file, "start/file"},
                     {cloth->velocity_file, "start/velocities"},
                     {cloth->render_file, "render_mesh/file"}};
        for (size_t i = 0; !status && i < sizeof named / sizeof *named; i++) {
            snprintf(pointer, sizeof pointer, "/cloth/%d/%s", c, named[i].key);
            if (named[i].file)
                status = visit_file(&v, named[i].file, pointer);
        }
    }
    for (int c = 0; c < model->collider_count; c++) {
        const drape_collider *collider = &model->colliders[c];
        const drape_entry *entry = &collider->ops->entry;
        for (size_t i = 0; !status && i < collider->choice.setting_count; i++) {
            const drape_setting *setting = &collider->choice.settings[i];
            const int param = drape_param_find(entry->params, entry->param_count, setting->name);
            snprintf(pointer, sizeof pointer, "/colliders/%d/%s", c, setting->name);
            if (setting->text && param >= 0 && entry->params[param].kind == DRAPE_PARAM_TEXT)
                status = visit_file(&v, setting->text, pointer);
        }
    }
    return status;
}

/* ---- Copies ---- */

/* A file that cannot be read twice, such as a pipe, is not copied. */
static drape_status copy_file(void *user, const char *source, const char *pointer)
{
    copier *c = user;
    struct stat info;
    char bytes[COPIED_ONCE];
    ssize_t count = 0;
    if (stat(source, &info) || S_ISDIR(info.st_mode)) {
        /* What is several files, as a folder of frames or their pattern, is not copied: the scene names it by
         * its whole path. */
        char folder[PATH_MAX];
        if (*source == '/' || !getcwd(folder, sizeof folder))
            return DRAPE_OK;
        char *whole = drape_disk_path(c->ctx, folder, source);
        const drape_status kept = whole ? drape_scene_set(c->scene, pointer, whole) : DRAPE_E_MEMORY;
        drape_free(c->ctx, whole);
        return kept;
    }
    if (!S_ISREG(info.st_mode))
        return DRAPE_OK;
    const int from = drape_file_open(c->ctx, source);
    if (from < 0)
        return DRAPE_E_FILE;
    const char *dot = strrchr(source, '.');
    const size_t length = dot ? strspn(dot + 1, ALPHANUMERIC) : 0;
    const bool tells = length > 0 && length <= MAX_ENDING && !dot[1 + length]; /* which format it has */
    drape_file_name(&c->out, MESH_NAME, c->files++, tells ? dot : "");
    drape_status status = drape_file_begin(&c->out);
    while (!status && (count = read(from, bytes, sizeof bytes)) != 0) {
        if (count > 0)
            drape_file_put(&c->out, bytes, (size_t)count);
        else if (errno != EINTR)
            status = drape_file_fail(c->ctx, "read the file", source, errno);
    }
    if (!status)
        status = drape_file_finish(&c->out);
    close(from);
    return status ? status : drape_scene_set(c->scene, pointer, c->out.path);
}

/* ---- The scene ---- */

static void put(void *user, const char *text, size_t size)
{
    drape_file_put(user, text, size);
}

drape_status drape_scene_copy(drape_context *ctx, drape_scene *scene, const drape_model *model,
                              const char *path, drape_folder *folder)
{
    copier c = {.ctx = ctx, .scene = scene};
    drape_status status = drape_file_create_in(ctx, folder, &c.out);
    if (!status)
        status = drape_scene_files(ctx, model, path, copy_file, &c);
    if (!status) {
        drape_file_name(&c.out, DRAPE_SCENE_COPY);
        status = drape_file_begin(&c.out);
    }
    if (!status) {
        drape_scene_print(scene, put, &c.out);
        status = drape_file_finish(&c.out);
    }
    drape_file_destroy(&c.out);
    return status;
}
