/* continue.c: contact that goes on where other contact of the same cloth was. See contact.h. */
#include "contact/parts.h"

#include <math.h>
#include <string.h>

/* The number in `to` of a collider of `from`; -1: it is gone. */
static int32_t collider_now(const drape_contact *to, const int32_t *before, int32_t collider)
{
    for (int32_t c = 0; c < to->model->collider_count; c++)
        if (before[c] == collider)
            return c;
    return -1;
}

static int32_t first_point(const drape_contact *c, int32_t collider)
{
    int32_t first = c->model->node_count;
    for (int32_t k = 0; k < collider; k++)
        first += c->model->colliders[k].shape.point_count;
    return first;
}

/* Whether the points of a collider are the same ones; *shift: what is added to their numbers. */
static bool same_points(const drape_contact *to, int32_t now, const drape_contact *from, int32_t before,
                        int32_t *shift)
{
    *shift = first_point(to, now) - first_point(from, before);
    return to->model->colliders[now].shape.point_count == from->model->colliders[before].shape.point_count;
}

drape_status drape_contact_continue(drape_contact *to, const drape_contact *from, const int32_t *before)
{
    to->press = from->press;
    to->press.work = 0;
    to->seconds = from->seconds;
    to->search_seconds = from->search_seconds;
    to->longest_path = from->longest_path;
    for (int32_t c = 0; c < to->model->collider_count; c++)
        if (before[c] >= 0 && !to->model->contact.distance_given &&
            !(to->model->colliders[c].shape.distance > 0))
            to->broad.distance[c] = fmax(to->model->contact.distance, from->broad.distance[before[c]]);
    to->broad.rounding = from->broad.rounding;
    /* Pairs that are left out, as those of a collider with another shape, count as new ones when the next
     * step begins. */
    drape_status status = DRAPE_OK;
    for (int32_t i = 0; !status && i < from->inside.count; i++) {
        drape_pair_key key = from->inside.keys[i];
        int32_t shift = 0;
        if (key.collider >= 0) {
            const int32_t now = collider_now(to, before, key.collider);
            if (now < 0 || !same_points(to, now, from, key.collider, &shift))
                continue;
            key.collider = now;
        }
        for (int a = 0; a < 4; a++)
            key.node[a] += key.node[a] >= to->model->node_count ? shift : 0;
        status = drape_inside_add(&to->inside, &key);
    }
    drape_inside_sort(&to->inside);
    return status;
}
