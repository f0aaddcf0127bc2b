/* scene_copy.c: see scene_copy.h. A scene names files as sources of the meshes of cloths, and in the text
 * parameters of colliders. */
#include "io/scene_copy.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "io/file.h"
#include "model/scene_text.h"

#define MESH_NAME   "scene_mesh_%d%.15s"
#define MESH_ROOM   48 /* for the name of a copied mesh */
#define COPIED_ONCE 16384

typedef struct copier {
    drape_context *ctx;
    drape_scene *scene;
    const char *path, *folder;
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

/* ---- Meshes ---- */

/* The path of a mesh as it is opened here: relative to the folder of the scene. NULL: out of memory. */
static char *whole_path(const copier *c, const char *file)
{
    const char *slash = strrchr(c->path, '/');
    size_t size = strlen(c->path) + strlen(file) + 2;
    char *whole = drape_alloc(c->ctx, size, 1);
    if (whole && slash && *file != '/')
        snprintf(whole, size, "%.*s/%s", (int)(slash - c->path), c->path, file);
    else if (whole)
        snprintf(whole, size, "%s", file);
    return whole;
}

static drape_status copy_bytes(copier *c, int from, const char *source)
{
    char bytes[COPIED_ONCE];
    ssize_t count;
    drape_status status = drape_file_begin(&c->out);
    if (status)
        return status;
    while ((count = read(from, bytes, sizeof bytes)) != 0) {
        if (count < 0 && errno != EINTR)
            return drape_file_fail(c->ctx, "read the mesh", source, errno);
        if (count > 0)
            drape_file_put(&c->out, bytes, (size_t)count);
    }
    return drape_file_finish(&c->out);
}

/* A file that cannot be read twice, such as a pipe, is not copied. */
static drape_status copy_file(copier *c, const char *source, const char *pointer)
{
    struct stat info;
    char name[MESH_ROOM];
    const char *ending = strrchr(source, '.');
    if (stat(source, &info) || !S_ISREG(info.st_mode))
        return DRAPE_OK;
    int from = open(source, O_RDONLY | O_CLOEXEC);
    if (from < 0)
        return drape_file_fail(c->ctx, "read the mesh", source, errno);
    snprintf(name, sizeof name, MESH_NAME, c->files++, ending ? ending : "");
    drape_file_name(&c->out, "%s/%s", c->folder, name);
    drape_status status = copy_bytes(c, from, source);
    close(from);
    return status ? status : drape_scene_set(c->scene, pointer, name);
}

static drape_status keep_file(copier *c, const char *file, const char *pointer)
{
    char *source = whole_path(c, file);
    if (!source)
        return DRAPE_E_MEMORY;
    drape_status status = copy_file(c, source, pointer);
    drape_free(c->ctx, source);
    return status;
}

static bool is_text(const drape_collider *collider, const char *name)
{
    for (int i = 0; i < collider->ops->entry.param_count; i++)
        if (strcmp(collider->ops->entry.params[i].name, name) == 0)
            return collider->ops->entry.params[i].kind == DRAPE_PARAM_TEXT;
    return false;
}

static drape_status keep_collider(copier *c, const drape_collider *collider, int index)
{
    drape_status status = DRAPE_OK;
    for (size_t i = 0; !status && i < collider->choice.setting_count; i++) {
        const drape_setting *setting = &collider->choice.settings[i];
        char pointer[DRAPE_POINTER_SIZE];
        snprintf(pointer, sizeof pointer, "/colliders/%d/%s", index, setting->name);
        if (setting->text && is_text(collider, setting->name))
            status = keep_file(c, setting->text, pointer);
    }
    return status;
}

static drape_status keep_meshes(copier *c, const drape_model *model)
{
    drape_status status = DRAPE_OK;
    for (int32_t i = 0; !status && i < model->cloth_count; i++) {
        char pointer[DRAPE_POINTER_SIZE];
        snprintf(pointer, sizeof pointer, "/cloth/%d/mesh/file", (int)i);
        if (model->cloths[i].file)
            status = keep_file(c, model->cloths[i].file, pointer);
    }
    for (int32_t i = 0; !status && i < model->collider_count; i++)
        status = keep_collider(c, &model->colliders[i], (int)i);
    return status;
}

/* ---- The scene ---- */

static void put(void *user, const char *text, size_t size)
{
    drape_file_put(user, text, size);
}

static drape_status keep_scene(copier *c)
{
    drape_file_name(&c->out, "%s/" DRAPE_SCENE_COPY, c->folder);
    drape_status status = drape_file_begin(&c->out);
    if (status)
        return status;
    drape_scene_print(c->scene, put, &c->out);
    return drape_file_finish(&c->out);
}

drape_status drape_scene_copy(drape_context *ctx, drape_scene *scene, const drape_model *model,
                              const char *path, const char *folder)
{
    copier c = {.ctx = ctx, .scene = scene, .path = path, .folder = folder};
    drape_status status = drape_file_create(ctx, strlen(folder) + MESH_ROOM, &c.out);
    if (!status)
        status = keep_meshes(&c, model);
    if (!status)
        status = keep_scene(&c);
    drape_file_destroy(&c.out);
    return status;
}
