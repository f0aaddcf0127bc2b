/* stage.c: see stage.h. */
#include "render/stage.h"

#include <string.h>

#define FLOOR_GAP 0.02f /* radii below the lowest point */

static const float nowhere[3] = {0};

static void set_pose(drape_stage_body *body, const drape_collider_pose *pose)
{
    for (int k = 0; k < 3; k++)
        body->offset[k] = (float)pose->displacement[k];
    for (int i = 0; i < 9; i++)
        body->turn[i] = pose->turned ? (float)pose->turn[i % 3 * 3 + i / 3] : (float)(i % 4 == 0);
}

/* The place of a vertex of a body. */
static void place(const drape_stage_body *body, const float *vertex, float *p)
{
    for (int k = 0; k < 3; k++)
        p[k] = body->turn[k] * vertex[0] + body->turn[k + 3] * vertex[1] + body->turn[k + 6] * vertex[2] +
               body->offset[k];
}

static drape_status create_bodies(drape_stage *s)
{
    const drape_model *m = s->model;
    static const int sizes[] = {3, 3, 0};
    s->bodies = drape_arena_take(&s->arena, (size_t)m->collider_count, sizeof *s->bodies);
    s->collider = drape_arena_take(&s->arena, (size_t)m->collider_count, sizeof *s->collider);
    for (int32_t c = 0; s->bodies && s->collider && c < m->collider_count; c++) {
        drape_stage_body *body = &s->bodies[s->body_count++];
        const drape_collider_pose pose = drape_collider_pose_at(&m->colliders[c], 0);
        double center[3];
        const double middle[3] = {(s->low[0] + s->high[0]) / 2, (s->low[1] + s->high[1]) / 2,
                                  (s->low[2] + s->high[2]) / 2};
        drape_pose_own(&pose, middle, center);
        set_pose(body, &pose);
        s->collider[c] = &m->colliders[c];
        if (m->colliders[c].frames.frame_count > 0) {
            const size_t points = (size_t)m->colliders[c].shape.point_count;
            body->points = drape_arena_take(&s->arena, points, 3 * sizeof(double));
            if (!body->points || drape_deformed_create(&s->arena, &m->colliders[c], &body->deformed))
                return DRAPE_E_MEMORY;
            s->collider[c] = &body->deformed->collider;
        }
        if (drape_body_create(&s->arena, &m->colliders[c], center, 2.5 * m->length, &body->shape))
            return DRAPE_E_MEMORY;
        drape_gl_mesh_create(&body->mesh, sizes, false);
        drape_gl_mesh_fill(&body->mesh, body->shape.vertex, body->shape.vertex_count, false);
        s->has_ground |= body->shape.endless;
    }
    return drape_arena_status(&s->arena);
}

static drape_status create_cloth(drape_stage *s)
{
    static const int vertex[] = {3, 3, 3, 2, 1, 1, 0}, segment[] = {3, 3, 0}, point[] = {3, 0};
    const size_t nodes = (size_t)s->model->surface.node_count;
    s->pinned = drape_arena_take(&s->arena, nodes, sizeof *s->pinned);
    if (!s->pinned)
        return DRAPE_E_MEMORY;
    drape_render_pinned(s->model, s->pinned);
    for (size_t i = 0; i < nodes; i++)
        s->pin_count += s->pinned[i];
    s->pin = drape_arena_take(&s->arena, s->pin_count, 3 * sizeof *s->pin);
    drape_status status = drape_skin_create(&s->arena, s->model, &s->skin);
    s->skin.collider = s->collider;
    if (status)
        return status;
    drape_gl_mesh_create(&s->cloth, vertex, false);
    drape_gl_mesh_create(&s->hem, vertex, false);
    drape_gl_mesh_create(&s->wires, segment, true);
    drape_gl_mesh_create(&s->pins, point, false);
    drape_gl_mesh_index(&s->cloth, s->skin.index, s->skin.index_count);
    drape_gl_mesh_index(&s->hem, s->skin.hem_index, s->skin.hem_index_count);
    return DRAPE_OK;
}

static void extend_box(drape_stage *s, const float *points, size_t count, size_t stride, const float *offset)
{
    for (size_t i = 0; i < count; i++)
        for (size_t k = 0; k < 3; k++) {
            float x = points[stride * i + k] + offset[k];
            s->low[k] = fminf(s->low[k], x);
            s->high[k] = fmaxf(s->high[k], x);
        }
}

static void empty_box(drape_stage *s)
{
    for (int k = 0; k < 3; k++) {
        s->low[k] = INFINITY;
        s->high[k] = -INFINITY;
    }
}

drape_status drape_stage_create(drape_context *ctx, const drape_model *model, drape_stage *stage)
{
    *stage = (drape_stage){.arena = drape_arena_of(ctx), .model = model};
    empty_box(stage);
    for (int32_t i = 0; i < model->surface.node_count; i++) {
        const double *x = model->surface.rest + 3 * (size_t)i;
        extend_box(stage, (const float[]){(float)x[0], (float)x[1], (float)x[2]}, 1, 3, nowhere);
    }
    drape_status status = create_bodies(stage);
    if (!status)
        status = create_cloth(stage);
    empty_box(stage);
    if (status)
        drape_stage_free(stage);
    return status;
}

void drape_stage_free(drape_stage *stage)
{
    for (int32_t c = 0; c < stage->body_count; c++)
        drape_gl_mesh_free(&stage->bodies[c].mesh);
    drape_gl_mesh_free(&stage->cloth);
    drape_gl_mesh_free(&stage->hem);
    drape_gl_mesh_free(&stage->wires);
    drape_gl_mesh_free(&stage->pins);
    drape_arena_free(&stage->arena);
    *stage = (drape_stage){.radius = 0};
}

static void move_bodies(drape_stage *s, double t)
{
    for (int32_t c = 0; c < s->body_count; c++) {
        const drape_collider_pose pose = drape_collider_pose_at(&s->model->colliders[c], t);
        drape_stage_body *body = &s->bodies[c];
        set_pose(body, &pose);
        if (!body->deformed)
            continue;
        drape_sequence_points(&s->model->colliders[c].frames, t, body->points);
        drape_deformed_move(body->deformed, body->points);
        drape_body_follow(&body->deformed->collider.shape, &body->shape);
    }
}

void drape_stage_add(drape_stage *stage, const float *positions)
{
    extend_box(stage, positions, (size_t)stage->model->surface.node_count, 3, nowhere);
}

void drape_stage_finish(drape_stage *stage)
{
    for (int32_t c = 0; c < stage->body_count; c++) {
        const drape_stage_body *body = &stage->bodies[c];
        for (size_t i = 0; !body->shape.endless && i < body->shape.vertex_count; i++) {
            float p[3];
            place(body, body->shape.vertex + 6 * i, p);
            extend_box(stage, p, 1, 3, nowhere);
        }
    }
    float size = 0;
    for (int k = 0; k < 3; k++) {
        stage->center[k] = (stage->low[k] + stage->high[k]) / 2;
        size += (stage->high[k] - stage->low[k]) * (stage->high[k] - stage->low[k]);
    }
    stage->radius = fmaxf(sqrtf(size) / 2, 1e-6f);
    stage->floor = stage->low[1] - FLOOR_GAP * stage->radius;
}

void drape_stage_frame(drape_stage *stage, drape_framing *framing, double t, const float *positions,
                       const float *offset)
{
    move_bodies(stage, t);
    drape_framing_add(framing, positions, (size_t)stage->model->surface.node_count, offset);
    for (int32_t c = 0; c < stage->body_count; c++) {
        const drape_stage_body *body = &stage->bodies[c];
        for (size_t i = 0; !body->shape.endless && i < body->shape.vertex_count; i++) {
            float p[3];
            place(body, body->shape.vertex + 6 * i, p);
            drape_framing_add(framing, p, 1, offset);
        }
    }
}

void drape_stage_set(drape_stage *stage, const drape_moment *moment, bool wires)
{
    float *pin = stage->pin;
    move_bodies(stage, moment->t);
    for (int32_t c = 0; c < stage->body_count; c++)
        if (stage->bodies[c].deformed)
            drape_gl_mesh_fill(&stage->bodies[c].mesh, stage->bodies[c].shape.vertex,
                               stage->bodies[c].shape.vertex_count, true);
    drape_skin_update(&stage->skin, moment->t, moment->positions, moment->values);
    drape_gl_mesh_fill(&stage->cloth, stage->skin.vertex[0].p, stage->skin.vertex_count, true);
    stage->wire_count = 0;
    if (!wires) {
        drape_skin_update_hem(&stage->skin);
        drape_gl_mesh_fill(&stage->hem, stage->skin.hem[0].p, stage->skin.hem_count, true);
        return;
    }
    drape_skin_update_segments(&stage->skin);
    drape_gl_mesh_fill(&stage->wires, stage->skin.segment, stage->skin.segment_count, true);
    stage->wire_count = stage->skin.segment_count;
    for (size_t i = 0; i < (size_t)stage->model->surface.node_count; i++)
        if (stage->pinned[i]) {
            memcpy(pin, moment->positions + 3 * i, 3 * sizeof *pin);
            pin += 3;
        }
    drape_gl_mesh_fill(&stage->pins, stage->pin, stage->pin_count, true);
}
