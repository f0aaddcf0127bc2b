/* checkpoint.c: contact in a checkpoint. See contact.h. */
#include "contact/parts.h"

#include "base/finite.h"
#include "contact/list.h"

static void archive_couplings(drape_contact *c, drape_archive *a)
{
    int32_t count = c->coupling_count;
    drape_archive_int32(a, &count);
    if (a->reading)
        c->coupling_count = 0;
    for (int32_t i = 0; i < count && drape_archive_good(a); i++) {
        int32_t *list = drape_list_grow(c->arena, c->coupling, i, &c->coupling_room, 4 * sizeof *list);
        if (!list) {
            drape_archive_note(a, DRAPE_E_MEMORY);
            return;
        }
        c->coupling = list;
        drape_archive_bytes(a, list + 4 * (size_t)i, 4 * sizeof *list);
        for (size_t k = 0; k < 4 && drape_archive_good(a); k++)
            if (list[4 * (size_t)i + k] < 0 || list[4 * (size_t)i + k] >= c->model->node_count)
                drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint couples a node that is not there");
        c->coupling_count = i + 1;
    }
}

static bool are_finite(const drape_collider_pose *pose, int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        if (!drape_all_finite(pose[i].displacement, 3) || !drape_all_finite(pose[i].velocity, 3))
            return false;
    return true;
}

/* Whether positions and poses are finite, as a search needs. */
static bool is_valid(const drape_contact *c)
{
    const size_t n = 3 * (size_t)c->broad.points;
    return drape_all_finite(c->step_candidates.x, n) && drape_all_finite(c->start, n) &&
           are_finite(c->step_candidates.pose, c->model->collider_count) &&
           are_finite(c->start_pose, c->model->collider_count) && c->step_candidates.margin >= 0 &&
           c->step_candidates.margin <= c->model->length && c->next_margin >= 0 &&
           c->next_margin <= c->model->length;
}

/* The active set at the beginning of the step depends on the positions alone, so a new search finds the
 * same one. */
static drape_status restore_start(drape_contact *c)
{
    const drape_configuration start = {.model = c->model, .x = c->start, .pose = c->start_pose};
    drape_status status = drape_candidates_search(&c->query_candidates, &start, c->next_margin);
    drape_contact_set_rounding(c, c->start);
    if (!status)
        status = drape_active_set_list(&c->active, &c->query_candidates, 0, &start, &c->inside, false);
    return status ? status : drape_contact_lag(c);
}

/* Which candidates the steps have, and so which pairs a new pattern would contain, depends on the positions
 * of their last search. */
static drape_status restore(drape_contact *c)
{
    const drape_configuration at = {
        .model = c->model, .x = c->step_candidates.x, .pose = c->step_candidates.pose};
    drape_status status = c->begun ? restore_start(c) : DRAPE_OK;
    if (!status && c->step_candidates.known)
        status = drape_candidates_search(&c->step_candidates, &at, c->step_candidates.margin);
    c->listed = NULL;
    c->between_steps = c->begun;
    return status;
}

void drape_contact_archive(drape_contact *c, drape_archive *a)
{
    const size_t points = 3 * (size_t)c->broad.points, colliders = (size_t)c->model->collider_count;
    drape_archive_mark(a, "contact");
    drape_archive_bool(a, &c->step_candidates.known);
    drape_archive_bool(a, &c->begun);
    drape_archive_double(a, &c->step_candidates.margin);
    drape_archive_double(a, &c->next_margin);
    drape_archive_doubles(a, c->step_candidates.x, points);
    drape_archive_bytes(a, c->step_candidates.pose, colliders * sizeof *c->step_candidates.pose);
    drape_archive_doubles(a, c->start, points);
    drape_archive_bytes(a, c->start_pose, colliders * sizeof *c->start_pose);
    drape_inside_archive(&c->inside, a);
    drape_archive_double(a, &c->press.factor);
    drape_archive_double(a, &c->press.widest);
    drape_archive_double(a, &c->press.t);
    archive_couplings(c, a);
    drape_archive_double(a, &c->seconds);
    drape_archive_double(a, &c->search_seconds);
    if (!drape_archive_has_read(a))
        return;
    if (!is_valid(c))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has positions that are not finite");
    else
        drape_archive_note(a, restore(c));
}
