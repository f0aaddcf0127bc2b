/* stage.c: see stage.h. */
#include "render/stage.h"

#include <string.h>

#define FLOOR_GAP 0.02f /* radii below the lowest point */

static drape_status create_bodies(drape_stage *s)
{
    const drape_model *m = s->model;
    static const int sizes[] = {3, 3, 0};
    drape_status status = DRAPE_OK;
    s->bodies = drape_alloc(s->ctx, (size_t)m->collider_count, sizeof *s->bodies);
    if (!s->bodies)
        return DRAPE_E_MEMORY;
    s->body_count = m->collider_count;
    for (int32_t c = 0; c < m->collider_count && !status; c++) {
        drape_stage_body *body = &s->bodies[c];
        const drape_collider_pose pose = drape_collider_pose_at(&m->colliders[c], 0);
        double center[3];
        for (int k = 0; k < 3; k++) {
            center[k] = (s->low[k] + s->high[k]) / 2 - pose.displacement[k];
            body->offset[k] = (float)pose.displacement[k];
        }
        status = drape_body_create(s->ctx, &m->colliders[c], center, 2.5 * m->length, &body->shape);
        drape_gl_mesh_create(&body->mesh, sizes, false);
        drape_gl_mesh_fill(&body->mesh, body->shape.vertex, body->shape.vertex_count, false);
        s->has_ground |= body->shape.endless;
    }
    return status;
}

static drape_status create_cloth(drape_stage *s)
{
    static const int vertex[] = {3, 3, 3, 2, 1, 1, 0}, segment[] = {3, 3, 0}, point[] = {3, 0};
    drape_status status = drape_skin_create(s->ctx, s->model, &s->skin);
    for (int32_t i = 0; i < s->model->node_count; i++)
        s->pin_count += s->model->pinned[i];
    s->pin = drape_alloc(s->ctx, s->pin_count, 3 * sizeof *s->pin);
    drape_gl_mesh_create(&s->cloth, vertex, false);
    drape_gl_mesh_create(&s->wires, segment, true);
    drape_gl_mesh_create(&s->pins, point, false);
    if (!status && s->pin)
        drape_gl_mesh_index(&s->cloth, s->skin.index, s->skin.index_count);
    return status ? status : s->pin ? DRAPE_OK : DRAPE_E_MEMORY;
}

static void see(drape_stage *s, const float *points, size_t count, size_t stride, const float *offset)
{
    for (size_t i = 0; i < count; i++)
        for (size_t k = 0; k < 3; k++) {
            float x = points[stride * i + k] + offset[k];
            s->low[k] = fminf(s->low[k], x);
            s->high[k] = fmaxf(s->high[k], x);
        }
}

static void see_doubles(drape_stage *s, const double *x, size_t count)
{
    static const float nowhere[3] = {0};
    for (size_t i = 0; i < count; i++) {
        const float p[3] = {(float)x[3 * i], (float)x[3 * i + 1], (float)x[3 * i + 2]};
        see(s, p, 1, 3, nowhere);
    }
}

static void forget_seen(drape_stage *s)
{
    for (int k = 0; k < 3; k++) {
        s->low[k] = INFINITY;
        s->high[k] = -INFINITY;
    }
}

drape_status drape_stage_create(drape_context *ctx, const drape_model *model, drape_stage *stage)
{
    *stage = (drape_stage){.ctx = ctx, .model = model};
    forget_seen(stage);
    see_doubles(stage, model->rest, (size_t)model->node_count);
    drape_status status = create_bodies(stage);
    if (!status)
        status = create_cloth(stage);
    forget_seen(stage);
    if (status)
        drape_stage_free(stage);
    return status;
}

void drape_stage_free(drape_stage *stage)
{
    if (!stage->ctx)
        return;
    for (int32_t c = 0; stage->bodies && c < stage->body_count; c++) {
        drape_gl_mesh_free(&stage->bodies[c].mesh);
        drape_body_free(stage->ctx, &stage->bodies[c].shape);
    }
    drape_gl_mesh_free(&stage->cloth);
    drape_gl_mesh_free(&stage->wires);
    drape_gl_mesh_free(&stage->pins);
    drape_skin_free(&stage->skin);
    drape_free(stage->ctx, stage->pin);
    drape_free(stage->ctx, stage->bodies);
    *stage = (drape_stage){.radius = 0};
}

static void place_bodies(drape_stage *s, double t)
{
    for (int32_t c = 0; c < s->body_count; c++) {
        const drape_collider_pose pose = drape_collider_pose_at(&s->model->colliders[c], t);
        for (int k = 0; k < 3; k++)
            s->bodies[c].offset[k] = (float)pose.displacement[k];
    }
}

void drape_stage_see(drape_stage *stage, const float *positions)
{
    static const float nowhere[3] = {0};
    see(stage, positions, (size_t)stage->model->node_count, 3, nowhere);
}

void drape_stage_settle(drape_stage *stage)
{
    for (int32_t c = 0; c < stage->body_count; c++)
        if (!stage->bodies[c].shape.endless)
            see(stage, stage->bodies[c].shape.vertex, stage->bodies[c].shape.vertex_count, 6,
                stage->bodies[c].offset);
    float size = 0;
    for (int k = 0; k < 3; k++) {
        stage->center[k] = (stage->low[k] + stage->high[k]) / 2;
        size += (stage->high[k] - stage->low[k]) * (stage->high[k] - stage->low[k]);
    }
    stage->radius = fmaxf(sqrtf(size) / 2, 1e-6f);
    stage->floor = stage->low[1] - FLOOR_GAP * stage->radius;
}

void drape_stage_frame(drape_stage *stage, drape_framing *framing, double t, const float *positions)
{
    static const float nowhere[3] = {0};
    place_bodies(stage, t);
    drape_framing_add(framing, positions, (size_t)stage->model->node_count, nowhere);
    for (int32_t c = 0; c < stage->body_count; c++) {
        const drape_stage_body *body = &stage->bodies[c];
        for (size_t i = 0; !body->shape.endless && i < body->shape.vertex_count; i++)
            drape_framing_add(framing, body->shape.vertex + 6 * i, 1, body->offset);
    }
}

static void set_pins(drape_stage *s, const float *positions)
{
    float *to = s->pin;
    for (size_t i = 0; i < (size_t)s->model->node_count; i++)
        if (s->model->pinned[i]) {
            memcpy(to, positions + 3 * i, 3 * sizeof *to);
            to += 3;
        }
    drape_gl_mesh_fill(&s->pins, s->pin, s->pin_count, true);
}

void drape_stage_set(drape_stage *stage, const drape_moment *moment, bool wires)
{
    place_bodies(stage, moment->t);
    drape_skin_fit(&stage->skin, moment->positions, moment->values);
    drape_gl_mesh_fill(&stage->cloth, stage->skin.vertex[0].p, stage->skin.vertex_count, true);
    stage->wire_count = 0;
    if (!wires)
        return;
    drape_skin_wire(&stage->skin);
    drape_gl_mesh_fill(&stage->wires, stage->skin.segment, stage->skin.segment_count, true);
    stage->wire_count = stage->skin.segment_count;
    set_pins(stage, moment->positions);
}
