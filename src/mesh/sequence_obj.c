/*
 * sequence_obj.c: one OBJ file for each frame: those of a folder ("walk/"), in the order of their names, or
 * those of a pattern with one number ("walk_%04d.obj"), from 0 or 1 on to the last that exists; a single file
 * is one frame. The triangles are those of the first file, and the same in all.
 */
#include "base/list.h"
#include "mesh/contents.h"
#include "mesh/sequence.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* The names of the files, relative to the folder of the source. */
typedef struct name_list {
    drape_arena *arena;
    char **name;
    int32_t count, capacity;
} name_list;

static drape_status add_name(name_list *list, const char *name)
{
    char *copy = drape_arena_text(list->arena, name);
    return copy && drape_list_append(list->arena, &list->name, &list->count, &list->capacity, &copy,
                                     sizeof copy)
               ? DRAPE_OK
               : DRAPE_E_MEMORY;
}

static int compare(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

static drape_status list_folder(const drape_sequence_source *source, name_list *list)
{
    drape_status status = DRAPE_OK;
    const char *path = drape_contents_path(list->arena, source->folder, source->file.file);
    if (!path)
        return DRAPE_E_MEMORY;
    DIR *folder = opendir(path);
    if (!folder)
        return drape_fail_at(source->ctx, DRAPE_E_FILE, source->file.pointer, "%s: cannot be read: %s", path,
                             strerror(errno));
    for (const struct dirent *entry; !status && (entry = readdir(folder));) {
        if (!drape_ends_in(entry->d_name, ".obj"))
            continue;
        char *name = drape_contents_path(list->arena, source->file.file, entry->d_name);
        status = name ? add_name(list, name) : DRAPE_E_MEMORY;
    }
    closedir(folder);
    if (!status && list->count > 1)
        qsort(list->name, (size_t)list->count, sizeof *list->name, compare);
    return status;
}

/* Splits a pattern at its number: "%d", or "%04d" with 0 to 9 digits. */
static bool split(const char *pattern, size_t *before, int *width, const char **after)
{
    const char *percent = strchr(pattern, '%'), *at = percent;
    *width = 0;
    if (!percent)
        return false;
    at++;
    if (*at == '0' && at[1] >= '1' && at[1] <= '9') {
        *width = at[1] - '0';
        at += 2;
    }
    *before = (size_t)(percent - pattern);
    *after = at + 1;
    return *at == 'd' && !strchr(at + 1, '%');
}

static drape_status list_pattern(const drape_sequence_source *source, name_list *list)
{
    const char *pattern = source->file.file, *after;
    size_t before;
    int width;
    if (!strchr(pattern, '%'))
        return add_name(list, pattern);
    if (!split(pattern, &before, &width, &after))
        return drape_mesh_fail(source->ctx, &source->file, 0,
                               "a sequence of OBJ files is a folder, with a / at its end, or a pattern with "
                               "one number, such as walk_%%04d.obj");
    const size_t size = strlen(pattern) + 16;
    char *name = drape_arena_take(list->arena, size, 1);
    if (!name)
        return DRAPE_E_MEMORY;
    for (int number = 0;; number++) {
        snprintf(name, size, "%.*s%0*d%s", (int)before, pattern, width, number, after);
        const char *path = drape_contents_path(list->arena, source->folder, name);
        if (!path)
            return DRAPE_E_MEMORY;
        if (access(path, F_OK) == 0)
            DRAPE_TRY(add_name(list, name));
        else if (number > 0)
            return DRAPE_OK;
    }
}

static drape_status read_frames(const drape_sequence_source *source, const name_list *list, drape_mesh *mesh,
                                drape_sequence *out)
{
    drape_status status = DRAPE_OK;
    DRAPE_TRY(drape_mesh_read(source->ctx, source->file.pointer, source->folder, list->name[0], mesh));
    DRAPE_TRY(drape_sequence_allocate(source, mesh, list->count, out));
    const size_t numbers = 3 * (size_t)mesh->node_count;
    for (int32_t f = 0; !status && f < list->count; f++) {
        const drape_mesh_source file = {.pointer = source->file.pointer, .file = list->name[f]};
        drape_mesh frame = {0};
        status = drape_mesh_read(source->ctx, source->file.pointer, source->folder, list->name[f], &frame);
        if (!status && frame.node_count != mesh->node_count)
            status = drape_mesh_fail(source->ctx, &file, 0, "frame %d: %d nodes; the first frame has %d",
                                     (int)f, (int)frame.node_count, (int)mesh->node_count);
        if (!status && !drape_faces_same(&frame, mesh))
            status = drape_mesh_fail(source->ctx, &file, 0,
                                     "frame %d: its faces differ from those of the first frame", (int)f);
        if (!status)
            memcpy(out->x + (size_t)f * numbers, frame.x, numbers * sizeof *out->x);
        drape_mesh_free(&frame);
    }
    return status;
}

static drape_status read_obj(const drape_sequence_source *source, drape_mesh *mesh, drape_sequence *out)
{
    const char *file = source->file.file;
    name_list list = {.arena = source->scratch};
    DRAPE_TRY(file[strlen(file) - 1] == '/' ? list_folder(source, &list) : list_pattern(source, &list));
    if (list.count == 0)
        return drape_mesh_fail(source->ctx, &source->file, 0, "there are no such OBJ files");
    return read_frames(source, &list, mesh, out);
}

const drape_sequence_ops drape_sequence_obj = {
    .entry = {.name = "obj",
              .summary = "one OBJ file for each frame: a folder, with a / at its end, or a pattern such as "
                         "walk_%04d.obj; a single file is one frame",
              .reference = "Wavefront OBJ"},
    .endings = {".obj", "/"},
    .has_triangles = true,
    .many_files = true,
    .read = read_obj,
};
