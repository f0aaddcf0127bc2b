/* frame.c: see frame.h. */
#include "io/frame.h"

#include <stdlib.h>
#include <string.h>

#include "base/vec3.h"
#include "colliders/body.h"

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

static drape_status make_rigid(drape_arena *arena, const drape_model *model, const drape_collider *c,
                               drape_export_body *out)
{
    const drape_collider_pose pose = drape_collider_pose_at(c, 0);
    double middle[3] = {0}, normal[3];
    drape_arena scratch = drape_arena_of(arena->ctx);
    drape_body body;
    for (size_t k = 0; k < 3 * (size_t)model->node_count; k++)
        middle[k % 3] += model->rest[k] / model->node_count;
    drape_pose_own(&pose, middle, middle);
    const double off = c->ops->distance(c->values, &c->shape, middle, normal, NULL);
    vec3_add_scaled(-off, normal, middle); /* a plane is shown below the cloth, however far */
    drape_status status = drape_body_create(&scratch, c, middle, REACH * model->length, &body);
    if (!status)
        status = weld(arena, &scratch, &body, out);
    drape_arena_free(&scratch);
    return status;
}

static drape_status make_bodies(drape_arena *arena, const drape_model *model, const drape_motion *motion,
                                drape_frames *f)
{
    int32_t points = model->surface.node_count;
    f->body_count = model->collider_count;
    f->bodies = drape_arena_take(arena, (size_t)f->body_count, sizeof *f->bodies);
    f->poses = drape_arena_take(arena, 2 * (size_t)f->body_count, sizeof *f->poses);
    drape_status status = drape_arena_status(arena);
    for (int32_t i = 0; i < model->collider_count && !status; i++) {
        const drape_collider *c = &model->colliders[i];
        drape_export_body *body = &f->bodies[i];
        *body = (drape_export_body){.name = c->name,
                                    .deforms = c->frames.frame_count > 0,
                                    .moves = drape_motion_moves_collider(motion, i),
                                    .vertex_count = c->shape.point_count,
                                    .triangle_count = c->shape.triangle_count,
                                    .triangle = c->shape.triangle,
                                    .first_point = points};
        if (body->deforms)
            points += body->vertex_count;
        else
            status = make_rigid(arena, model, c, body);
    }
    return status;
}

int32_t drape_frame_points(const drape_model *model)
{
    int32_t points = 0;
    for (int32_t i = 0; i < model->collider_count; i++)
        points += model->colliders[i].frames.frame_count > 0 ? model->colliders[i].shape.point_count : 0;
    return points;
}

/* ---- Frames ---- */

drape_status drape_frames_create(drape_arena *arena, const drape_model *model, const drape_motion *motion,
                                 bool fields, bool bodies, bool rotates, drape_frames *f)
{
    const drape_render_surface *s = &model->surface;
    const size_t nodes = (size_t)s->node_count, triangles = (size_t)s->triangle_count, copies = 1 + rotates;
    *f = (drape_frames){.rotates = rotates,
                        .points = nodes + (bodies ? (size_t)drape_frame_points(model) : 0)};
    f->positions = drape_arena_take(arena, copies * f->points, 3 * sizeof(double));
    if (s->bound)
        f->normals = drape_arena_take(arena, (size_t)model->node_count, 3 * sizeof(double));
    if (fields) {
        f->node_density = drape_arena_take(arena, (size_t)model->node_count, sizeof(double));
        f->triangle_strain = drape_arena_take(arena, (size_t)model->triangle_count, 2 * sizeof(double));
        f->velocities = drape_arena_take(arena, copies * nodes, 3 * sizeof(double));
        f->density = drape_arena_take(arena, nodes, sizeof(double));
        f->strain = drape_arena_take(arena, triangles, 2 * sizeof(double));
        f->pinned = drape_arena_take(arena, nodes, 1);
        f->triangle = drape_arena_take(arena, triangles, sizeof *f->triangle);
        if (f->triangle)
            drape_render_triangles(model, f->triangle);
    }
    drape_status status = bodies ? make_bodies(arena, model, motion, f) : DRAPE_OK;
    return status ? status : drape_arena_status(arena);
}

/* (x, y, z) to (x, -z, y): a quarter turn about x. */
static const double *rotate(const double *from, size_t count, double *to)
{
    for (size_t i = 0; i < 3 * count; i += 3) {
        to[i] = from[i];
        to[i + 1] = -from[i + 2];
        to[i + 2] = from[i + 1];
    }
    return to;
}

static void rotate_pose(const drape_collider_pose *from, drape_collider_pose *to)
{
    to->turned = true;
    rotate(from->displacement, 1, to->displacement);
    for (int k = 0; k < 3; k++) { /* the rows of the rotation */
        to->turn[k] = from->turned ? from->turn[k] : k == 0;
        to->turn[3 + k] = from->turned ? -from->turn[6 + k] : -(double)(k == 2);
        to->turn[6 + k] = from->turned ? from->turn[3 + k] : k == 1;
    }
}

void drape_frames_make(drape_frames *f, const drape_model *model, const drape_motion *motion,
                       const double *velocities)
{
    const drape_render_surface *s = &model->surface;
    const size_t nodes = (size_t)s->node_count;
    drape_frame *frame = &f->frame;
    if (f->normals)
        drape_model_normals(model, frame->nodes, f->normals);
    drape_render_positions(model, -1, frame->nodes, f->normals, f->positions);
    for (int32_t i = 0; i < f->body_count; i++) { /* where the colliders are at that time */
        const drape_export_body *body = &f->bodies[i];
        double *x = f->positions + 3 * (size_t)body->first_point;
        drape_motion_pose(motion, i, frame->time, frame->time, &f->poses[i]);
        if (body->deforms)
            drape_motion_points(motion, i, frame->time, x);
        for (int32_t p = 0; body->deforms && p < body->vertex_count; p++, x += 3)
            drape_pose_point(&f->poses[i], x, x);
    }
    if (f->node_density) {
        drape_model_strain(model, frame->nodes, f->triangle_strain);
        drape_render_values(model, velocities, 3, f->velocities);
        drape_render_values(model, f->node_density, 1, f->density);
        for (int32_t t = 0; t < s->triangle_count; t++)
            memcpy(f->strain + 2 * (size_t)t, f->triangle_strain + 2 * (size_t)f->triangle[t],
                   2 * sizeof *f->strain);
        drape_render_pinned(model, f->pinned);
    }
    frame->positions = f->positions;
    frame->velocities = f->velocities;
    frame->strain = f->strain;
    frame->energy_density = f->density;
    frame->pinned = f->pinned;
    frame->poses = f->poses;
    f->rotated = *frame;
    if (!f->rotates)
        return;
    f->rotated.positions = rotate(f->positions, f->points, f->positions + 3 * f->points);
    if (f->velocities)
        f->rotated.velocities = rotate(f->velocities, nodes, f->velocities + 3 * nodes);
    for (int32_t i = 0; i < f->body_count; i++)
        rotate_pose(&f->poses[i], &f->poses[f->body_count + i]);
    f->rotated.poses = f->poses + f->body_count;
}
