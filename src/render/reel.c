/* reel.c: see reel.h. */
#include "render/reel.h"

#include "model/model.h"

#include <math.h>

#define SAME_TIME 1e-9 /* [s] two frames that differ by less are at one time */

drape_status drape_reel_create(drape_context *ctx, const drape_model *model, bool with_values,
                               drape_reel *reel)
{
    const size_t nodes = (size_t)model->node_count, shown = (size_t)model->surface.node_count;
    *reel = (drape_reel){
        .arena = drape_arena_of(ctx), .model = model, .nodes = shown, .with_values = with_values};
    drape_reel_clear(reel);
    reel->scratch = drape_arena_take(&reel->arena, nodes, sizeof *reel->scratch);
    if (model->surface.bound) {
        reel->normals = drape_arena_take(&reel->arena, nodes, 3 * sizeof *reel->normals);
        reel->shown = drape_arena_take(&reel->arena, shown, 3 * sizeof *reel->shown);
        reel->shown_values = drape_arena_take(&reel->arena, shown, sizeof *reel->shown_values);
    }
    return drape_arena_status(&reel->arena);
}

void drape_reel_free(drape_reel *reel)
{
    drape_arena_free(&reel->arena);
    *reel = (drape_reel){.count = 0};
}

void drape_reel_clear(drape_reel *reel)
{
    reel->count = 0;
    reel->low = INFINITY;
    reel->high = -INFINITY;
}

drape_status drape_reel_add(drape_reel *r, double t, const double *x, drape_sim *sim,
                            const drape_field_ops *field)
{
    const double *values = r->shown ? r->shown_values : r->scratch;
    if (r->count == r->capacity) {
        r->capacity = r->capacity ? 2 * r->capacity : 1;
        r->times = drape_arena_resize(&r->arena, r->times, r->capacity, sizeof *r->times);
        r->positions = drape_arena_resize(&r->arena, r->positions, r->capacity, 3 * r->nodes * sizeof(float));
        if (r->with_values)
            r->values = drape_arena_resize(&r->arena, r->values, r->capacity, r->nodes * sizeof(float));
    }
    drape_status status = drape_arena_status(&r->arena);
    if (status)
        return status;
    if (r->shown) {
        drape_model_normals(r->model, x, r->normals);
        drape_render_positions(r->model, -1, x, r->normals, r->shown);
    }
    const double *shown = r->shown ? r->shown : x;
    r->times[r->count] = t;
    for (size_t i = 0; i < 3 * r->nodes; i++)
        r->positions[3 * r->nodes * r->count + i] = (float)shown[i];
    if (field)
        status = field->measure(sim, x, r->scratch);
    if (field && !status && r->shown)
        drape_render_values(r->model, r->scratch, 1, r->shown_values);
    for (size_t i = 0; field && i < r->nodes && !status; i++) {
        r->values[r->count * r->nodes + i] = (float)values[i];
        r->low = fmin(r->low, values[i]);
        r->high = fmax(r->high, values[i]);
    }
    if (!status)
        r->count++;
    return status;
}

const float *drape_reel_positions(const drape_reel *reel, size_t frame)
{
    return reel->positions + 3 * reel->nodes * frame;
}

const float *drape_reel_values(const drape_reel *reel, size_t frame)
{
    return reel->with_values ? reel->values + reel->nodes * frame : NULL;
}

size_t drape_reel_at(const drape_reel *reel, double t)
{
    size_t frame = 0;
    while (frame + 1 < reel->count && reel->times[frame + 1] <= t + SAME_TIME)
        frame++;
    return frame;
}
