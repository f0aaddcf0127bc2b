/* export.c: see export.h. */
#include "io/export.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

bool drape_export_names(const drape_exporter_ops *ops, const char *name)
{
    for (const char *const *pattern = ops->names; *pattern; pattern++)
        if (drape_folder_matches(*pattern, name, NULL))
            return true;
    return false;
}

int64_t drape_export_frame_of(const drape_exporter_ops *ops, const char *name)
{
    int64_t frame;
    for (const char *const *pattern = ops->names; *pattern; pattern++)
        if (strstr(*pattern, DRAPE_FRAME_DIGITS) && drape_folder_matches(*pattern, name, &frame))
            return frame;
    return -1;
}

/* ---- Files ---- */

drape_status drape_export_begin(drape_context *ctx, drape_folder *folder, const char *name, drape_file *file)
{
    drape_status status =
        folder ? drape_file_create_in(ctx, folder, file) : drape_file_create(ctx, strlen(name), file);
    if (status)
        return status;
    drape_file_name(file, "%s", name);
    return drape_file_begin(file);
}

drape_status drape_export_open(const drape_export_def *def, const char *name, drape_file *file)
{
    drape_file **last = def->growing;
    drape_status status = def->resumes ? drape_file_create_in(def->ctx, def->folder, file)
                                       : drape_export_begin(def->ctx, def->folder, name, file);
    if (!status && def->resumes)
        drape_file_name(file, "%s", name);
    file->durable = def->durable;
    while (*last)
        last = &(*last)->next;
    *last = file;
    return status;
}

void drape_export_frame_name(const char *pattern, int64_t frame, char *name, size_t size)
{
    const char *digits = strstr(pattern, DRAPE_FRAME_DIGITS);
    snprintf(name, size, "%.*s%0*" PRId64 "%s", (int)(digits - pattern), pattern,
             (int)(sizeof DRAPE_FRAME_DIGITS - 1), frame, digits + sizeof DRAPE_FRAME_DIGITS - 1);
}

drape_status drape_export_begin_frame(const drape_export_def *def, const drape_frame *frame,
                                      const char *pattern)
{
    char name[DRAPE_FRAME_NAME];
    drape_export_frame_name(pattern, frame->index, name, sizeof name);
    drape_file_name(def->whole, "%s", name);
    return drape_file_begin(def->whole);
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
