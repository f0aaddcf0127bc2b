/* checkpoint.c: contact in a checkpoint, and contact that goes on where other contact of the same cloth was.
 * See contact.h. */
#include "contact/parts.h"

#include "base/finite.h"
#include "base/list.h"

#include <math.h>
#include <string.h>

static void archive_couplings(drape_contact *c, drape_archive *a)
{
    static const int32_t unread[4];
    int32_t count = c->coupling_count;
    drape_archive_int32(a, &count);
    if (a->reading)
        c->coupling_count = 0;
    for (int32_t i = 0; i < count && drape_archive_good(a); i++) {
        if (a->reading && !drape_list_append(c->arena, &c->coupling, &c->coupling_count,
                                             &c->coupling_capacity, unread, sizeof unread)) {
            drape_archive_note(a, DRAPE_E_MEMORY);
            return;
        }
        int32_t *nodes = c->coupling + 4 * (size_t)i;
        drape_archive_bytes(a, nodes, 4 * sizeof *nodes);
        for (size_t k = 0; k < 4 && drape_archive_good(a); k++)
            if (nodes[k] < 0 || nodes[k] >= c->model->node_count)
                drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint couples a node that is not there");
    }
}

static bool are_finite(const drape_collider_pose *pose, int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        if (!drape_all_finite(pose[i].displacement, 3) || !drape_all_finite(pose[i].velocity, 3) ||
            !drape_all_finite(pose[i].turn, 9) || !drape_all_finite(pose[i].gradient, 9) ||
            !isfinite(pose[i].t))
            return false;
    return true;
}

static bool are_distances(const drape_contact *c)
{
    for (int32_t i = 0; i < c->model->collider_count; i++)
        if (!(c->broad.distance[i] >= drape_collider_activation(c->model, i) &&
              isfinite(c->broad.distance[i])))
            return false;
    return true;
}

/* The active set at the beginning of the step depends on the positions alone, whatever the candidates;
 * lagged friction also on the velocities. */
static drape_status restore(drape_contact *c)
{
    const drape_configuration start = {.model = c->model, .x = c->start, .pose = c->start_pose};
    drape_candidates_forget(&c->step_candidates);
    drape_candidates_forget(&c->query_candidates);
    c->listed = false;
    drape_contact_forget_bodies(c);
    c->between_steps = c->begun;
    if (!c->begun)
        return DRAPE_OK;
    drape_contact_set_rounding(c, c->start);
    drape_status status = drape_contact_list(c, &start);
    memcpy(c->v, c->start_v, 3 * (size_t)c->broad.points * sizeof *c->v);
    memcpy(c->pose, c->start_pose, (size_t)c->model->collider_count * sizeof *c->pose);
    if (!status)
        drape_contact_measure_start(c);
    return status ? status : drape_contact_lag(c);
}

static void archive_press(drape_contact *c, drape_archive *a)
{
    drape_archive_double(a, &c->press.factor);
    drape_archive_double(a, &c->press.widest);
    drape_archive_double(a, &c->press.t);
    drape_archive_doubles(a, c->broad.distance, (size_t)c->model->collider_count);
}

static bool is_press(const drape_contact *c, drape_archive *a)
{
    if (!(c->press.factor >= 1 && isfinite(c->press.factor) && isfinite(c->press.t)))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has a stiffness of contact below the scene's");
    else if (!are_distances(c))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has an activation distance below the scene's");
    return drape_archive_good(a);
}

void drape_contact_archive(drape_contact *c, drape_archive *a)
{
    const size_t points = 3 * (size_t)c->broad.points, colliders = (size_t)c->model->collider_count;
    drape_archive_mark(a, "contact");
    drape_archive_bool(a, &c->begun);
    drape_archive_double(a, &c->start_t);
    drape_archive_doubles(a, c->start, points);
    drape_archive_doubles(a, c->start_v, points);
    for (size_t i = 0; i < colliders; i++) {
        drape_collider_pose *pose = &c->start_pose[i];
        drape_archive_doubles(a, pose->displacement, 3);
        drape_archive_doubles(a, pose->velocity, 3);
        drape_archive_doubles(a, pose->turn, 9);
        drape_archive_doubles(a, pose->gradient, 9);
        drape_archive_bool(a, &pose->turned);
        drape_archive_bool(a, &pose->spins);
        drape_archive_double(a, &pose->t);
    }
    drape_inside_archive(&c->inside, a);
    archive_press(c, a);
    archive_couplings(c, a);
    drape_archive_double(a, &c->seconds);
    drape_archive_double(a, &c->search_seconds);
    if (!drape_archive_has_read(a))
        return;
    if (!drape_all_finite(c->start, points) || !drape_all_finite(c->start_v, points) ||
        !are_finite(c->start_pose, c->model->collider_count))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has positions that are not finite");
    else if (is_press(c, a))
        drape_archive_note(a, restore(c));
}

void drape_contact_archive_press(drape_contact *c, drape_archive *a)
{
    drape_archive_mark(a, "press");
    archive_press(c, a);
    if (!drape_archive_has_read(a) || !is_press(c, a))
        return;
    drape_candidates_forget(&c->step_candidates);
    drape_candidates_forget(&c->query_candidates);
    c->listed = false;
}

/* ---- Other contact goes on ---- */

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
