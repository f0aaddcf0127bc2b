/* export.c: see export.h. */
#include "io/export.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model/model.h"

#define FRAME_WORD "frame_"

void drape_export_body_vertex(const drape_frame *frame, const drape_export_body *body, int32_t number,
                              int32_t vertex, double x[3])
{
    for (size_t k = 0; k < 3; k++)
        x[k] = body->deforms ? frame->points[3 * (size_t)(body->first_point + vertex) + k]
                             : (double)body->vertex[6 * (size_t)vertex + k];
    if (!body->deforms)
        drape_pose_point(&frame->poses[number], x, x);
}

/* ---- One file ---- */

drape_status drape_export_begin(drape_context *ctx, drape_folder *folder, const char *name, drape_file *file)
{
    drape_status status = drape_file_create_in(ctx, folder, file);
    if (status)
        return status;
    drape_file_name(file, "%s", name);
    return drape_file_begin(file);
}

void drape_export_archive_file(drape_archive *a, drape_file *file)
{
    int64_t bytes = file->kept, sum = (int64_t)file->kept_sum.sum;
    drape_archive_int64(a, &bytes);
    drape_archive_int64(a, &sum);
    if (drape_archive_has_read(a)) {
        file->kept = (off_t)bytes;
        file->expected = (uint64_t)sum;
    }
}

drape_status drape_export_reopen(drape_context *ctx, drape_folder *folder, const char *name, drape_file *file)
{
    const off_t kept = file->kept;
    const uint64_t expected = file->expected;
    drape_status status = drape_file_create_in(ctx, folder, file);
    if (status)
        return status;
    file->kept = kept;
    file->expected = expected;
    drape_file_name(file, "%s", name);
    return drape_file_reopen(file);
}

/* ---- One file for each frame ---- */

bool drape_frame_files_name(const char *name, size_t digits, const char *ending, int64_t *frame)
{
    const size_t word = strlen(FRAME_WORD);
    if (strncmp(name, FRAME_WORD, word) != 0)
        return false;
    const size_t found = strspn(name + word, "0123456789");
    const char *rest = name + word + found;
    if (frame)
        *frame = (int64_t)strtoll(name + word, NULL, 10);
    return found >= digits && *rest == '.' && strcmp(rest + 1, ending) == 0;
}

drape_status drape_frame_files_open(drape_context *ctx, const drape_export_def *def, const char *ending,
                                    drape_frame_files *frames)
{
    frames->surface = &def->model->surface;
    frames->folder = def->folder;
    frames->ending = ending;
    drape_status status = drape_file_create_in(ctx, def->folder, &frames->file);
    frames->file.durable = def->durable;
    return status;
}

drape_status drape_frame_files_resume(drape_context *ctx, const drape_export_def *def, const char *ending,
                                      int64_t count, drape_frame_files *frames)
{
    drape_status status = drape_frame_files_open(ctx, def, ending, frames);
    for (int64_t k = 0; !status && k < count; k++) {
        drape_file_name(&frames->file, DRAPE_FRAME_NAME, k, ending);
        status = drape_folder_verify(def->folder, frames->file.path);
    }
    return status;
}

/* The frames from a number on. */
typedef struct late {
    const char *ending;
    int64_t from;
} late;

static bool is_late(const void *user, const char *name)
{
    const late *l = user;
    int64_t frame;
    return drape_frame_files_name(name, DRAPE_FRAME_DIGITS, l->ending, &frame) && frame >= l->from;
}

drape_status drape_frame_files_cut(drape_context *ctx, void *state, int64_t frames)
{
    const drape_frame_files *files = state;
    const late l = {files->ending, frames};
    (void)ctx;
    return drape_folder_remove(files->folder, is_late, &l);
}

void drape_frame_files_archive(void *state, drape_archive *a)
{
    (void)state, (void)a;
}

drape_status drape_frame_files_begin(drape_frame_files *frames, int64_t frame)
{
    drape_file_name(&frames->file, DRAPE_FRAME_NAME, frame, frames->ending);
    return drape_file_begin(&frames->file);
}

drape_status drape_frame_files_end(drape_frame_files *frames)
{
    return drape_file_finish(&frames->file);
}

drape_status drape_frame_files_close(drape_context *ctx, void *state)
{
    (void)ctx;
    drape_file_destroy(&((drape_frame_files *)state)->file);
    return DRAPE_OK;
}

/* ---- OBJ ---- */

static void put_name(drape_file *file, const char *statement, const char *name, size_t length)
{
    drape_file_put_text(file, statement);
    drape_file_put_text(file, " ");
    for (; length > 0; name++, length--)
        drape_file_put(file, (unsigned char)*name < ' ' ? "_" : name, 1);
    drape_file_put_text(file, "\n");
}

void drape_obj_put_name(drape_file *file, const char *statement, const char *name)
{
    put_name(file, statement, name, strlen(name));
}

/* One statement for each line of the names. */
static void put_names(drape_file *file, const char *statement, const char *names)
{
    for (const char *end = names; *end; names = end + 1) {
        end = names + strcspn(names, "\n");
        put_name(file, statement, names, (size_t)(end - names));
    }
}

void drape_obj_put_material_files(drape_file *file, const drape_render_surface *surface)
{
    for (int32_t c = 0; c < surface->cloth_count; c++) {
        const char *own = surface->cloths[c].mesh->faces.material_file;
        bool named = !own;
        for (int32_t b = 0; b < c && !named; b++) {
            const char *other = surface->cloths[b].mesh->faces.material_file;
            named = other && strcmp(own, other) == 0;
        }
        if (!named)
            put_names(file, "mtllib", own);
    }
}

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

/* A material stays in force, also for other objects, until another is named. */
static void use_material(drape_obj *obj, const char *material)
{
    if (!material && obj->material)
        material = DRAPE_NO_MATERIAL;
    if (!material || (obj->material && strcmp(material, obj->material) == 0))
        return;
    drape_obj_put_name(obj->file, "usemtl", material);
    obj->material = material;
}

void drape_obj_put_faces(drape_obj *obj, const drape_render_surface *surface, int32_t cloth)
{
    const drape_render_cloth *from = &surface->cloths[cloth];
    const drape_faces *faces = &from->mesh->faces;
    drape_file *file = obj->file;
    for (int32_t i = 0; i < faces->uv_count; i++)
        drape_file_print(file, "vt %.17g %.17g\n", faces->uv[2 * (size_t)i], faces->uv[2 * (size_t)i + 1]);
    if (faces->count == 0) {
        use_material(obj, NULL);
        drape_obj_put_triangles(file, surface->triangle + 3 * (size_t)from->first_triangle,
                                from->mesh->triangle_count);
    }
    for (int32_t f = 0; f < faces->count; f++) {
        use_material(obj, faces->material[f] < 0 ? NULL : faces->name[faces->material[f]]);
        drape_file_put_text(file, "f");
        for (int32_t c = faces->first[f]; c < faces->first[f + 1]; c++) {
            drape_file_print(file, " %" PRId32, from->first_node + faces->node[c] + 1);
            if (faces->uv_of[c] >= 0)
                drape_file_print(file, "/%" PRId64, (int64_t)obj->uvs + faces->uv_of[c] + 1);
        }
        drape_file_put_text(file, "\n");
    }
    obj->uvs += faces->uv_count;
}
