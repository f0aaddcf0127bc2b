/* bodies.c: see bodies.h. */
#include "io/bodies.h"

#include <stdlib.h>
#include <string.h>

#include "base/vec3.h"
#include "colliders/body.h"

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

/* The number of a vertex that there is at the same place with nearly this normal; -1: there is none. first,
 * count: the vertices at the place. */
static int32_t find_vertex(const numbered_vertex *kept, size_t first, size_t count, const float *normal)
{
    for (size_t i = first; i < count && i < first + MAX_NORMALS; i++) {
        double along = 0;
        for (int k = 0; k < 3; k++)
            along += (double)kept[i].value[3 + k] * (double)normal[k];
        if (along >= SAME_NORMAL)
            return (int32_t)i;
    }
    return -1;
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
        int32_t vertex = find_vertex(sorted, first, count, corner.value + 3);
        if (vertex < 0) {
            vertex = (int32_t)count;
            memcpy(sorted[count++].value, corner.value, sizeof corner.value);
        }
        out->triangle[corner.number] = vertex;
    }
    out->vertex = drape_arena_take(arena, count, 6 * sizeof *out->vertex);
    for (size_t i = 0; out->vertex && i < count; i++)
        memcpy(out->vertex + 6 * i, sorted[i].value, sizeof sorted[i].value);
    out->vertex_count = (int32_t)count;
    out->triangle_count = (int32_t)(corners / 3);
    return out->vertex ? DRAPE_OK : DRAPE_E_MEMORY;
}

static drape_status make_rigid(drape_arena *arena, const drape_model *model, int32_t collider,
                               drape_export_body *out)
{
    const drape_collider *c = &model->colliders[collider];
    const drape_collider_pose pose = drape_collider_pose_at(c, 0);
    double middle[3] = {0};
    drape_arena scratch = drape_arena_of(arena->ctx);
    drape_body body;
    for (size_t i = 0; i < 3 * (size_t)model->node_count; i++)
        middle[i % 3] += model->rest[i] / model->node_count;
    drape_pose_own(&pose, middle, middle);
    double normal[3];
    const double off = c->ops->distance(c->values, &c->shape, middle, normal, NULL);
    vec3_add_scaled(-off, normal, middle); /* what is shown of a plane is below the cloth, however far */
    drape_status status = drape_body_create(&scratch, c, middle, REACH * model->length, &body);
    if (!status)
        status = weld(arena, &scratch, &body, out);
    drape_arena_free(&scratch);
    return status;
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
            status = make_rigid(arena, model, i, &all[i]);
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
