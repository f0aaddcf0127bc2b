/* export.c: see export.h. */
#include "io/export.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/vec3.h"
#include "colliders/body.h"
#include "model/model.h"

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

void drape_export_body_vertex(const drape_frame *frame, const drape_export_body *body, int32_t number,
                              int32_t vertex, double x[3])
{
    for (size_t k = 0; k < 3; k++)
        x[k] = body->deforms ? frame->points[3 * (size_t)(body->first_point + vertex) + k]
                             : (double)body->vertex[6 * (size_t)vertex + k];
    if (!body->deforms)
        drape_pose_point(&frame->poses[number], x, x);
}

/* ---- The surfaces of colliders ---- */

#define REACH       1.0   /* of an endless body, in diagonals of the cloth; it is cut off at twice that */
#define SAME_NORMAL 0.999 /* cosine of the angle between normals that become one */
#define MAX_NORMALS 16    /* of one place that are compared with further ones */

typedef struct numbered_vertex {
    float value[6];
    int32_t number;
} numbered_vertex;

/* By position. */
static int compare_vertices(const void *left, const void *right)
{
    const numbered_vertex *a = left, *b = right;
    for (int k = 0; k < 3; k++)
        if (a->value[k] != b->value[k])
            return a->value[k] < b->value[k] ? -1 : 1;
    return (a->number > b->number) - (a->number < b->number);
}

/* Corners at the same place with nearly the same normal become one vertex. */
static drape_status weld(drape_arena *arena, drape_arena *scratch, const drape_body *body,
                         drape_export_body *out)
{
    const size_t corners = body->vertex_count;
    numbered_vertex *sorted = drape_arena_take(scratch, corners, sizeof *sorted);
    out->triangle = drape_arena_take(arena, corners, sizeof *out->triangle);
    if (!sorted || !out->triangle)
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < corners; i++) {
        sorted[i].number = (int32_t)i;
        memcpy(sorted[i].value, body->vertex + 6 * i, sizeof sorted[i].value);
    }
    qsort(sorted, corners, sizeof *sorted, compare_vertices);
    size_t count = 0, first = 0; /* vertices, which take the places of corners that were read */
    for (size_t i = 0; i < corners; i++) {
        const numbered_vertex corner = sorted[i];
        if (count > 0 && memcmp(corner.value, sorted[count - 1].value, 3 * sizeof *corner.value) != 0)
            first = count;
        size_t vertex = first; /* of those at the same place, one with nearly this normal */
        for (; vertex < count && vertex < first + MAX_NORMALS; vertex++) {
            const float *a = sorted[vertex].value + 3, *n = corner.value + 3;
            if ((double)a[0] * (double)n[0] + (double)a[1] * (double)n[1] + (double)a[2] * (double)n[2] >=
                SAME_NORMAL)
                break;
        }
        if (vertex == count || vertex == first + MAX_NORMALS) {
            vertex = count++;
            memcpy(sorted[vertex].value, corner.value, sizeof corner.value);
        }
        out->triangle[corner.number] = (int32_t)vertex;
    }
    out->vertex = drape_arena_take(arena, count, 6 * sizeof *out->vertex);
    for (size_t i = 0; out->vertex && i < count; i++)
        memcpy(out->vertex + 6 * i, sorted[i].value, sizeof sorted[i].value);
    out->vertex_count = (int32_t)count;
    out->triangle_count = (int32_t)(corners / 3);
    return out->vertex ? DRAPE_OK : DRAPE_E_MEMORY;
}

drape_status drape_export_bodies_create(drape_arena *arena, const drape_model *model,
                                        drape_export_body **bodies)
{
    drape_export_body *all = drape_arena_take(arena, (size_t)model->collider_count, sizeof *all);
    drape_status status = all ? DRAPE_OK : DRAPE_E_MEMORY;
    int32_t points = 0;
    for (int32_t i = 0; i < model->collider_count && !status; i++) {
        const drape_collider *c = &model->colliders[i];
        all[i].name = c->name;
        all[i].deforms = c->frames.frame_count > 0;
        if (!all[i].deforms) {
            const drape_collider_pose pose = drape_collider_pose_at(c, 0);
            double middle[3] = {0}, normal[3];
            drape_arena scratch = drape_arena_of(arena->ctx);
            drape_body body;
            for (size_t k = 0; k < 3 * (size_t)model->node_count; k++)
                middle[k % 3] += model->rest[k] / model->node_count;
            drape_pose_own(&pose, middle, middle);
            const double off = c->ops->distance(c->values, &c->shape, middle, normal, NULL);
            vec3_add_scaled(-off, normal, middle); /* a plane is shown below the cloth, however far */
            status = drape_body_create(&scratch, c, middle, REACH * model->length, &body);
            if (!status)
                status = weld(arena, &scratch, &body, &all[i]);
            drape_arena_free(&scratch);
            continue;
        }
        all[i].first_point = points;
        all[i].vertex_count = c->shape.point_count;
        all[i].triangle_count = c->shape.triangle_count;
        all[i].triangle = c->shape.triangle;
        points += c->shape.point_count;
    }
    *bodies = all;
    return status;
}

size_t drape_export_points(const drape_model *model)
{
    size_t points = 0;
    for (int32_t i = 0; i < model->collider_count; i++)
        points +=
            model->colliders[i].frames.frame_count > 0 ? (size_t)model->colliders[i].shape.point_count : 0;
    return points;
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
    while (*last)
        last = &(*last)->next;
    *last = file;
    return status;
}

drape_status drape_export_begin_frame(const drape_export_def *def, const drape_frame *frame,
                                      const char *ending)
{
    drape_file_name(def->whole, "frame_%06" PRId64 ".%s", frame->index, ending);
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
