/* distant.c: see distant.h. */
#include "contact/distant.h"

#include "base/vec3.h"
#include "colliders/colliders.h"

#include <math.h>

#define STALE 0.25 /* of its gap: a node that has moved by more is looked at again */

drape_status drape_distant_create(drape_arena *arena, const drape_model *model, drape_distant *out)
{
    const size_t count = (size_t)model->collider_count * (size_t)model->node_count;
    *out = (drape_distant){.model = model, .seen = drape_arena_take(arena, count, sizeof *out->seen)};
    for (size_t i = 0; out->seen && i < count; i++)
        out->seen[i].gap = -INFINITY;
    return drape_arena_status(arena);
}

void drape_distant_update(drape_distant *distant, const double *x, const drape_collider_pose *pose,
                          double rounding)
{
    const drape_model *m = distant->model;
    for (int32_t k = 0; k < m->collider_count; k++) {
        const drape_collider *collider = &m->colliders[k];
        if (!collider->ops->smooth || collider->frames.frame_count > 0)
            continue;
        for (int32_t i = 0; i < m->free_count; i++) {
            const int32_t node = m->node_of_free[i];
            drape_sighting *seen = &distant->seen[(size_t)k * (size_t)m->node_count + (size_t)node];
            double own[3];
            drape_pose_own(&pose[k], x + 3 * (size_t)node, own);
            if (drape_distant_keeps(distant, k, node, own, (1 - STALE) * seen->gap))
                continue;
            const double gap = collider->ops->distance(collider->values, &collider->shape, own, NULL, NULL);
            *seen = (drape_sighting){.own = {own[0], own[1], own[2]}, .gap = gap - rounding};
        }
    }
}
