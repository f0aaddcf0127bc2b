/* catch_up.c: see catch_up.h. */
#include "realtime/catch_up.h"

#include "base/rotation.h"
#include "base/vec3.h"
#include "colliders/colliders.h"
#include "host/place.h"
#include "model/sent.h"

#include <math.h>

#define HURRY 1.5

/* Whether all nodes stay apart from a collider that is not sent with them when they are displaced by a path:
 * a distance changes by no more than the length of the path. */
static bool stays_apart(const drape_sim *sim, int32_t collider, const double path[3])
{
    const drape_model *m = sim->model;
    const drape_state *now = drape_sim_state(sim);
    const double length = vec3_norm(path), apart = drape_model_mean_edge(m) + m->contact.distance;
    drape_collider_pose pose;
    drape_motion_pose(drape_system_motion(sim->system), collider, now->t, now->t, &pose);
    bool stays = !drape_motion_deforms(drape_system_motion(sim->system), collider);
    for (int32_t i = 0; i < m->node_count && stays; i++) {
        const double *x = now->x + 3 * (size_t)i;
        double to[3] = {x[0], x[1], x[2]};
        vec3_add_scaled(1, path, to);
        const double before = drape_collider_distance(&m->colliders[collider], &pose, x, NULL, NULL),
                     after = drape_collider_distance(&m->colliders[collider], &pose, to, NULL, NULL);
        stays = drape_model_ignores(m, collider, i) || (before + after - length) / 2 > apart;
    }
    return stays;
}

static drape_status go_ahead(drape_sim *sim, double end, const double path[3])
{
    const drape_motion *motion = drape_system_motion(sim->system);
    const drape_place_list all = {NULL, -1};
    const double t = drape_sim_state(sim)->t;
    drape_placement by = {.given = true, .turn = DRAPE_NO_ROTATION, .shift = {path[0], path[1], path[2]}};
    int32_t *sent = drape_alloc(sim->ctx, (size_t)sim->model->collider_count + 1, sizeof *sent), count = 0;
    if (!sent)
        return DRAPE_E_MEMORY;
    for (int32_t c = 0; c < sim->model->collider_count; c++)
        if (drape_motion_sends_collider(motion, c, t, end))
            sent[count++] = c;
    const drape_status status =
        drape_sim_place_parts(sim, &all, &(drape_place_list){sent, count}, &by, false);
    drape_free(sim->ctx, sent);
    return status;
}

drape_status drape_sim_catch_up(drape_sim *sim, double owed, drape_catch_up *rates)
{
    drape_realtime_memory *m = sim->realtime;
    const drape_state *now = drape_sim_state(sim);
    const drape_motion *motion = drape_system_motion(sim->system);
    drape_sent_part part = {.t = now->t, .end = now->t + owed};
    double ahead[3] = {0};
    *rates = (drape_catch_up){drape_motion_sends(motion, part.t, part.end), 1, 1};
    if (!rates->sent) /* then all motion is in simulated time */
        m->behind = m->pins_behind = 0;
    if (!(m->behind > 0 || m->pins_behind > 0))
        return DRAPE_OK;
    const double dropped = m->pins_behind / (owed + m->pins_behind), sent = owed + m->behind;
    bool goes = drape_motion_sends_pins(motion, part.t, part.end) &&
                drape_motion_moves_as_one(motion, 0, sim->model->node_count, now->x, part.end, part.common);
    vec3_add_scaled(dropped, part.common, ahead);
    /* The cloth and the colliders that are sent go ahead if the cloth stays apart from the other
     * colliders. */
    for (int32_t c = 0; c < sim->model->collider_count && goes; c++)
        goes = drape_motion_sends_collider(motion, c, part.t, part.end) || stays_apart(sim, c, ahead);
    for (int k = 0; k < 3; k++) {
        part.common[k] = goes ? part.common[k] : 0;
        part.left[k] = goes ? (1 - dropped) * part.common[k] : 0;
    }
    part.share = fmin(1, (isinf(m->cap) ? HURRY : 1) * owed / sent);
    const drape_status status = goes && dropped > 0 ? go_ahead(sim, part.end, ahead) : DRAPE_OK;
    if (status)
        return status;
    drape_motion_shorten(drape_system_steer(sim->system), &part);
    m->behind = (1 - part.share) * sent;
    m->pins_behind = goes ? 0 : m->behind;
    rates->bodies = part.share * sent / owed;
    rates->pins = goes ? 1 : rates->bodies;
    return DRAPE_OK;
}

void drape_sim_fall_behind(drape_sim *sim, const drape_catch_up *rates, double left, double dropped)
{
    drape_realtime_memory *m = sim->realtime;
    if (!rates->sent)
        return;
    m->behind = fmax(0, m->behind + dropped + (rates->bodies - 1) * left);
    m->pins_behind = fmax(0, m->pins_behind + dropped + (rates->pins - 1) * left);
}
