/* reach.c: what cloth could meet within some time: see contact.h. */
#include "contact/parts.h"

#include "base/clock.h"
#include "base/vec3.h"

/* Whether a node could come within the activation distance of the smooth surface of a collider on a straight
 * path in the coordinates of that: the gap changes by no more than the node moves there. */
static bool may_touch(const drape_contact *c, int32_t collider, int32_t node, const drape_straight_path *path)
{
    const drape_collider *k = &c->model->colliders[collider];
    const double distance = c->broad.distance[collider];
    double own[2][3], move[3], gaps = 0;
    bool keeps = true;
    for (int end = 0; end < 2; end++) {
        const drape_configuration *at = &path->end[end];
        drape_pose_own(&at->pose[collider], at->x + 3 * (size_t)node, own[end]);
        keeps = keeps && drape_distant_keeps(&c->broad.distant, collider, node, own[end], distance);
    }
    for (int end = 0; end < 2 && !keeps; end++)
        gaps += k->ops->distance(k->values, &k->shape, own[end], NULL, NULL);
    vec3_sub(own[1], own[0], move);
    return !keeps && 0.5 * (gaps - vec3_norm(move)) < distance;
}

static void note(void *user, const drape_pair *pair)
{
    bool *found = user;
    (void)pair;
    *found = true;
}

bool drape_contact_may_meet(drape_contact *c, const double *x, const double *v, double t, double seconds)
{
    const drape_model *m = c->model;
    const double start = drape_clock_seconds();
    const drape_straight_path path = {
        {{.model = m, .x = c->from, .pose = c->path_pose}, {.model = m, .x = c->to, .pose = c->kink_pose}}};
    bool meets = false;
    drape_contact_poses(c, t, c->path_pose);
    drape_contact_poses(c, t + seconds, c->kink_pose);
    drape_contact_fill(c, x, c->path_pose, c->from);
    for (size_t i = 0; i < 3 * (size_t)m->node_count; i++)
        c->to[i] = x[i] + seconds * v[i];
    drape_motion_place_pins(c->motion, t + seconds, c->to);
    drape_contact_fill(c, c->to, c->kink_pose, c->to);
    for (int32_t k = 0; k < m->collider_count; k++)
        for (int32_t i = 0; i < m->free_count && !meets && m->colliders[k].ops->smooth; i++)
            meets =
                !drape_model_ignores(m, k, m->node_of_free[i]) && may_touch(c, k, m->node_of_free[i], &path);
    if (!meets)
        drape_candidates_find(&c->broad, &path, 0, true, NULL, note, &meets);
    c->seconds += drape_clock_seconds() - start;
    return meets;
}
