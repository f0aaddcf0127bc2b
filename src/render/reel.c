/* reel.c: see reel.h. */
#include "render/reel.h"

#include <math.h>
#include <string.h>

#define SAME_TIME 1e-9 /* [s] of frames that are meant to be at one time */

drape_status drape_reel_create(drape_context *ctx, size_t nodes, bool with_values, drape_reel *reel)
{
    *reel = (drape_reel){
        .ctx = ctx, .nodes = nodes, .with_values = with_values, .low = INFINITY, .high = -INFINITY};
    reel->scratch = drape_alloc(ctx, nodes, sizeof *reel->scratch);
    return reel->scratch ? DRAPE_OK : DRAPE_E_MEMORY;
}

void drape_reel_free(drape_reel *reel)
{
    if (!reel->ctx)
        return;
    drape_free(reel->ctx, reel->times);
    drape_free(reel->ctx, reel->positions);
    drape_free(reel->ctx, reel->values);
    drape_free(reel->ctx, reel->scratch);
    *reel = (drape_reel){.count = 0};
}

void drape_reel_clear(drape_reel *reel)
{
    reel->count = 0;
    reel->low = INFINITY;
    reel->high = -INFINITY;
}

/* Moves used of old to room for more; NULL: the old stays. */
static void *grow(drape_context *ctx, void *old, size_t used, size_t room, size_t size)
{
    void *more = drape_alloc(ctx, room, size);
    if (more && used)
        memcpy(more, old, used * size);
    if (more)
        drape_free(ctx, old);
    return more;
}

static drape_status make_room(drape_reel *r)
{
    if (r->count < r->room)
        return DRAPE_OK;
    size_t room = r->room ? 2 * r->room : 1, frame = r->nodes * sizeof(float);
    double *times = grow(r->ctx, r->times, r->count, room, sizeof *times);
    r->times = times ? times : r->times;
    float *positions = grow(r->ctx, r->positions, r->count, room, 3 * frame);
    r->positions = positions ? positions : r->positions;
    float *values = r->with_values ? grow(r->ctx, r->values, r->count, room, frame) : NULL;
    r->values = values ? values : r->values;
    if (!times || !positions || (r->with_values && !values))
        return DRAPE_E_MEMORY;
    r->room = room;
    return DRAPE_OK;
}

static drape_status keep_values(drape_reel *r, const double *x, drape_sim *sim, const drape_field_ops *field)
{
    drape_status status = field->measure(sim, x, r->scratch);
    for (size_t i = 0; i < r->nodes && !status; i++) {
        r->values[r->count * r->nodes + i] = (float)r->scratch[i];
        r->low = fmin(r->low, r->scratch[i]);
        r->high = fmax(r->high, r->scratch[i]);
    }
    return status;
}

drape_status drape_reel_add(drape_reel *reel, double t, const double *x, drape_sim *sim,
                            const drape_field_ops *field)
{
    drape_status status = make_room(reel);
    if (status)
        return status;
    reel->times[reel->count] = t;
    for (size_t i = 0; i < 3 * reel->nodes; i++)
        reel->positions[3 * reel->nodes * reel->count + i] = (float)x[i];
    if (field)
        status = keep_values(reel, x, sim, field);
    if (!status)
        reel->count++;
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
