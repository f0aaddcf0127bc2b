/* contact_archive.c: contact in a checkpoint, and contact that continues from that of another sim of the same
 * cloth. See contact.h. */
#include "contact/contact_parts.h"

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

/* Lists the active set at the beginning of the step, which depends on the positions alone, and the lagged
 * friction there, which also depends on the velocities. */
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

static void archive_stiffness(drape_contact *c, drape_archive *a)
{
    drape_archive_double(a, &c->stiffening.factor);
    drape_archive_double(a, &c->stiffening.largest_gap);
    drape_archive_double(a, &c->stiffening.t);
    drape_archive_doubles(a, c->broad.distance, (size_t)c->model->collider_count);
}

static bool is_stiffness(const drape_contact *c, drape_archive *a)
{
    if (!(c->stiffening.factor >= 1 && isfinite(c->stiffening.factor) && isfinite(c->stiffening.t)))
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
    archive_stiffness(c, a);
    archive_couplings(c, a);
    drape_archive_double(a, &c->seconds);
    drape_archive_double(a, &c->search_seconds);
    if (!drape_archive_has_read(a))
        return;
    if (!drape_all_finite(c->start, points) || !drape_all_finite(c->start_v, points) ||
        !are_finite(c->start_pose, c->model->collider_count))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has positions that are not finite");
    else if (is_stiffness(c, a))
        drape_archive_note(a, restore(c));
}

void drape_contact_archive_stiffness(drape_contact *c, drape_archive *a)
{
    drape_archive_mark(a, "press");
    archive_stiffness(c, a);
    if (!drape_archive_has_read(a) || !is_stiffness(c, a))
        return;
    drape_candidates_forget(&c->step_candidates);
    drape_candidates_forget(&c->query_candidates);
    c->listed = false;
}

/* ---- Contact of another sim ---- */

drape_status drape_contact_continue(drape_contact *to, const drape_contact *from, const int32_t *before)
{
    to->stiffening = from->stiffening;
    to->stiffening.work = 0;
    to->seconds = from->seconds;
    to->search_seconds = from->search_seconds;
    to->longest_path = from->longest_path;
    for (int32_t c = 0; c < to->model->collider_count; c++)
        if (before[c] >= 0 && !to->model->contact.distance_given &&
            !(to->model->colliders[c].shape.distance > 0))
            to->broad.distance[c] = fmax(to->model->contact.distance, from->broad.distance[before[c]]);
    to->broad.rounding = from->broad.rounding;
    /* Pairs of colliders that are gone or have another shape are left out: the next step finds them anew. */
    drape_status status = DRAPE_OK;
    for (int32_t i = 0; !status && i < from->inside.count; i++) {
        drape_pair_key key = from->inside.keys[i];
        const int32_t collider = key.collider, points = to->model->node_count;
        int32_t now = 0, shift = 0; /* its number in `to`; what is added to the numbers of its points */
        while (collider >= 0 && now < to->model->collider_count && before[now] != collider)
            now++;
        if (collider >= 0) {
            if (now == to->model->collider_count || to->model->colliders[now].shape.point_count !=
                                                        from->model->colliders[collider].shape.point_count)
                continue;
            key.collider = now;
            shift = to->broad.first_point[now] - from->broad.first_point[collider];
        }
        for (int a = 0; a < 4; a++)
            key.node[a] += key.node[a] >= points ? shift : 0;
        status = drape_inside_add(&to->inside, &key);
    }
    drape_inside_sort(&to->inside);
    return status;
}
