/* hold.c: see hold.h. */
#include "realtime/hold.h"

#include "base/finite.h"
#include "base/reason.h"
#include "base/vec3.h"
#include "model/sent.h"
#include "model/support.h"
#include "realtime/room.h"

#include <math.h>
#include <string.h>

/* Attempts at a step that fail in a row, and within one nominal step of time, after which cloth is held. */
#define MOST_IN_A_ROW  10
#define MOST_IN_A_STEP 24

/* Moves the free nodes of a cloth along if its pins all have the same displacement: otherwise pins would be
 * torn from them, and pass through the cloth beside them. */
static void carry(const drape_motion *motion, const drape_state *now, drape_state *next)
{
    const drape_model *m = motion->model;
    const double h = next->t - now->t;
    for (int32_t c = 0; c < m->cloth_count; c++) {
        const drape_cloth *cloth = &m->cloths[c];
        double path[3];
        if (!drape_motion_moves_as_one(motion, cloth->first_node, cloth->mesh.node_count, now->x, next->t,
                                       path))
            continue;
        for (int32_t i = 0; i < cloth->mesh.node_count; i++) {
            const size_t node = (size_t)(cloth->first_node + i);
            if (m->pinned[node])
                continue;
            vec3_add_scaled(1, path, next->x + 3 * node);
            vec3_add_scaled(1 / h, path, next->v + 3 * node);
        }
    }
}

/* The energy to which pins and colliders, which do all the work in a held step, add. */
static double potential(const drape_energy *e)
{
    return e->elastic + e->gravity + e->contact;
}

/* Makes the held step; a status > 0: it is not possible. Errors: DRAPE_E_MEMORY. */
static drape_status make_step(drape_sim *sim, drape_state *next, drape_step_info *info)
{
    const drape_state *now = drape_sim_state(sim);
    const drape_model *m = sim->model;
    const size_t n = 3 * (size_t)m->node_count;
    const drape_schedule *s = &sim->schedule;
    /* a nominal step, or what is left of the advance */
    const double t1 = fmin(s->now + sim->realtime->dt, s->cut ? s->cut_end : s->end), h = t1 - now->t;
    if (!(h > 0))
        return DRAPE_RETRY_REJECTED;
    *info = (drape_step_info){.reason = DRAPE_REASON_HELD,
                              .h = h,
                              .residual = NAN,
                              .tolerance = NAN,
                              .error = NAN,
                              .left = NAN,
                              .own = NAN};
    info->diagnostic =
        (drape_diagnostic){.what = "", .term = "", .element = -1, .node = {-1, -1, -1, -1}, .cloth = -1};
    memcpy(next->x, now->x, n * sizeof *next->x);
    memset(next->v, 0, n * sizeof *next->v);
    next->t = t1;
    carry(drape_system_motion(sim->system), now, next);
    drape_motion_place_pins(drape_system_motion(sim->system), t1, next->x);
    for (size_t i = 0; i < n; i++)
        next->v[i] = m->pinned[i / 3] ? (next->x[i] - now->x[i]) / h : next->v[i];
    drape_supports_hold(drape_system_motion(sim->system), now->t, now->x, t1, next->x);
    drape_supports_hold_velocity(drape_system_motion(sim->system), (const double[]){now->t, t1}, false,
                                 next->v);
    drape_contact *contact = drape_system_contact(sim->system);
    drape_room_expect(contact, t1, true);
    drape_status status = drape_system_begin(sim->system, now);
    if (!status)
        status = drape_room_let_in(contact, next->x, t1);
    drape_sim_add_contact_work(sim);
    const drape_energy before = drape_sim_account(sim);
    if (!status)
        status = drape_system_check_contact(sim->system, next->x, t1, &info->reason, &info->diagnostic);
    if (!status)
        status =
            drape_system_check(sim->system, next->x, now->x, now->internal, &info->reason, &info->diagnostic);
    if (!status && !drape_all_finite(next->x, n))
        status = DRAPE_RETRY_NONFINITE;
    if (status)
        return status;
    const drape_energy after = drape_sim_energy_of(sim, t1, next->x, next->v);
    const bool pins = drape_system_motion(sim->system)->moved_count > 0;
    drape_system_begin_work(sim->system);
    drape_system_work(sim->system)[pins ? DRAPE_BY_PINS : DRAPE_BY_COLLIDERS] =
        potential(&after) - potential(&before) + fmax(0, after.kinetic - before.kinetic);
    return DRAPE_OK;
}

bool drape_hold(drape_sim *sim, drape_trial *trial, bool stopped, drape_status *error)
{
    drape_step_info held;
    drape_state *next = &sim->states[sim->next];
    *error = DRAPE_OK;
    const drape_realtime_memory *m = sim->realtime;
    const bool worn_out = stopped || m->failed >= MOST_IN_A_ROW || m->held_up >= MOST_IN_A_STEP;
    const bool may_help = trial->status >= 0 || trial->status == DRAPE_E_STEP_TOO_SMALL;
    if (!worn_out || !may_help || !m->active || sim->chosen.integrator->own_steps ||
        sim->model->contact.no_room == DRAPE_NO_ROOM_STOP)
        return false;
    drape_status status = make_step(sim, next, &held);
    drape_system_end_step(sim->system);
    if (!status && drape_events_examine(sim, next, &status) != DRAPE_EVENTS_PASS)
        status = status ? status : DRAPE_RETRY_REJECTED;
    *error = status < 0 ? status : DRAPE_OK;
    if (status)
        return false;
    drape_log(sim->ctx, DRAPE_LOG_WARNING,
              "t=%.9g h=%.4g: no step can be made (%s), and the cloth is held where it is",
              drape_sim_time(sim), held.h, drape_system_reason_name(sim->system, trial->info->reason));
    *trial->info = held;
    sim->statistics.steps_held++;
    return true;
}
